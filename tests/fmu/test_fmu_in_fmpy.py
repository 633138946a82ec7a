"""The FMUs in a master that others wrote."""

import re
import shutil
from math import isnan, nan
from pathlib import Path
from zipfile import ZipFile

import pytest

from adhesion_can.config import load_configuration
from adhesion_can.fmu import library
from adhesion_can.fmu.contents import KINDS, SLAVES, FmuContents
from adhesion_can.fmu.export import export_fmu
from adhesion_can.fmu.variables import Causality
from tests.fmu.drives import coupled, in_phase, readings_by_name, stepped

pytest.importorskip("fmpy", reason="needs the extra 'test'")
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def config():
    return load_configuration()


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_valid_and_runs(fmus, kind):
    from fmpy import simulate_fmu
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(fmus[kind])) == []
    rows = simulate_fmu(str(fmus[kind]), stop_time=0.1)
    assert rows["time"][-1] == pytest.approx(0.1)
    if kind == "locomotive":
        assert rows["wheel_speed_1"][-1] > 0.0


@pytest.mark.usefixtures("quick_compiler")
def test_integers_are_valid_too(tmp_path, config):
    from fmpy import read_model_description
    from fmpy.validation import validate_fmu

    path = tmp_path / "s.fmu"
    export_fmu(FmuContents("service", config, integers=True), path, [library.own_platform()])
    assert validate_fmu(str(path)) == []
    types = {one.type for one in read_model_description(str(path)).modelVariables}
    assert types == {"Real", "Integer"}


@pytest.mark.usefixtures("quick_compiler")
@pytest.mark.parametrize("kind", KINDS)
def test_it_is_valid_with_a_configuration_too(tmp_path, kind):
    from fmpy.validation import validate_fmu

    file, path = tmp_path / "mine.toml", tmp_path / f"{kind}.fmu"
    file.write_text("[vehicle]\naxles = 4\n")
    contents = FmuContents(kind, load_configuration(file), config_file=file)
    export_fmu(contents, path, [library.own_platform()])
    assert validate_fmu(str(path)) == []


@pytest.mark.costly
def test_the_service_gives_what_its_slave_gives_to_the_bit(host, config):
    slave = SLAVES["service"](config)
    drive = in_phase(config, 2.0)
    changes = {t_us: readings_by_name(config, frames) for t_us, frames in drive.items()}
    expected = stepped(slave, changes, 2_000_000, 10_000)
    one = host.initialize("service")
    integers = {one.name for one in slave.variables if one.enumeration is not None}
    outputs = [one for one in slave.variables if one.causality is Causality.OUTPUT]
    reals = [one.name for one in outputs if one.name not in integers]
    numbers = 0
    for t_us in range(0, 2_000_000, 10_000):
        for name, value in changes.get(t_us, {}).items():
            host.put(one, **{name: int(value) if name in integers else value})
        one.doStep(t_us / 1e6, 0.01)
        after = expected[t_us + 10_000]
        for name, value in zip(reals, host.read(one, *reals), strict=True):
            assert value == after[name] or (isnan(value) and isnan(after[name])), (t_us, name)
            numbers += not isnan(value)
        assert one.getInteger([one.references["status"]]) == [after["status"]]
    assert numbers > 1000
    assert host.said == []


@pytest.mark.slow
def test_the_three_coupled_give_what_one_process_gives(host, config):
    slaves = [SLAVES[kind](config) for kind in KINDS]
    expected = coupled(slaves, 1.5, duration=1.5)
    parts = [host.initialize(kind, **only(kind, duration=1.5)) for kind in KINDS]
    fields = [fields_of(slave) for slave in slaves]
    values = outputs_of(parts, fields)
    tracking = used = 0.0
    for number in range(750):
        for part, field in zip(parts, fields, strict=True):
            for (name, is_integer), reference in field["input"].items():
                if name in values:
                    setter = part.setInteger if is_integer else part.setReal
                    setter([reference], [values[name]])
        for part in parts:
            part.doStep(number * 2e-3, 2e-3)
        values = outputs_of(parts, fields)
        tracking += values["status"] == 1
        used += values["true_adhesion_used"]
    assert (tracking / 750, used / 750) == expected
    assert used > 0.0


def only(kind, **start):
    return start if kind == "locomotive" else {}


def fields_of(slave):
    """References by name and whether it is an integer, by causality."""
    found = {"input": {}, "output": {}, "parameter": {}}
    for reference, one in enumerate(slave.variables):
        found[one.causality][one.name, one.enumeration is not None] = reference
    return found


def outputs_of(parts, fields):
    values = {}
    for part, field in zip(parts, fields, strict=True):
        for is_integer, get in ((False, part.getReal), (True, part.getInteger)):
            rows = {name: r for (name, whole), r in field["output"].items() if whole is is_integer}
            if rows:
                values |= zip(rows, get(list(rows.values())), strict=True)
    return values


@pytest.mark.costly
def test_two_instances_do_not_mix_and_reset_starts_again(host):
    first, second = host.initialize("locomotive", seed=1), host.initialize("locomotive", seed=2)
    names = ("wheel_speed_1", "vehicle_speed", "true_force_1")
    runs = [[], []]
    for t_ms in range(0, 40, 2):
        for one, run in zip((first, second), runs, strict=True):
            one.doStep(t_ms / 1e3, 0.002)
            run.append(host.read(one, *names))
    assert runs[0] != runs[1]
    second.reset()
    second.setupExperiment(startTime=0.0)
    second.enterInitializationMode()
    second.exitInitializationMode()
    again = []
    for t_ms in range(0, 40, 2):
        second.doStep(t_ms / 1e3, 0.002)
        again.append(host.read(second, *names))
    assert again == runs[0]  # its seed is that of the start again


def test_while_it_is_initialised_outputs_follow_the_parameters(host):
    one = host.instantiate("locomotive")
    one.setupExperiment(startTime=0.0)
    one.enterInitializationMode()
    assert host.read(one, "true_mu_max_1") == [pytest.approx(0.373, abs=1e-3)]
    host.put(one, scenario=2)
    assert host.read(one, "true_mu_max_1")[0] < 0.3
    with pytest.raises(Exception, match="fmi2SetInteger"):
        host.put(one, creep_speed_setpoint=1)
    assert "another type" in host.said[-1]


def test_what_is_not_possible_is_refused_with_words(host):
    from fmpy.fmi1 import FMICallException

    one = host.initialize("service")
    with pytest.raises(FMICallException):
        one.setReal([one.references["mu_max"]], [0.3])
    assert "is an output" in host.said[-1]
    with pytest.raises(FMICallException):
        host.put(one, cycle_WheelSpeeds1=0.02)
    assert "is a fixed parameter" in host.said[-1]
    with pytest.raises(FMICallException):
        one.getReal([99_999])
    assert "no variable has the value reference 99999" in host.said[-1]
    with pytest.raises(FMICallException):
        one.getFMUState()
    assert "fmi2GetFMUstate is not supported" in host.said[-1]
    with pytest.raises(FMICallException):
        one.doStep(0.0, nan)
    one.doStep(0.0, 0.01)
    with pytest.raises(FMICallException):
        one.doStep(0.0, 0.01)
    assert "the step before ended at 0.01 s" in host.said[-1]
    with pytest.raises(FMICallException):
        one.doStep(0.01, 0.01)
    assert "the Python process has failed; reset or free the FMU" in host.said[-1]


def test_an_error_of_the_slave_comes_with_its_fix(host):
    from fmpy.fmi1 import FMICallException

    one = host.initialize("service")
    with pytest.raises(FMICallException):
        one.doStep(0.0, 0.5)
    (said,) = host.said
    assert re.search(r"cycle_\w+: a step of 0.5 s misses readings.*set this parameter", said)


@pytest.mark.usefixtures("quick_compiler")
def test_an_archive_is_the_same_each_time_and_holds_what_it_was_made_of(fmus, tmp_path, config):
    path = tmp_path / "again.fmu"
    model = tmp_path / "m.toml"
    export_fmu(FmuContents("service", config), path, [library.own_platform()])
    assert path.read_bytes() == fmus["service"].read_bytes()
    model.write_text("[base]\nc1 = 0.4\nc2 = 60.0\nc3 = 0.3\n")
    file = tmp_path / "c.toml"
    file.write_text("[service]\ntarget_share = 0.9\n")
    own = load_configuration(file)
    contents = FmuContents("service", own, config_file=file, model_file=model)
    export_fmu(contents, path, [library.own_platform()])
    with ZipFile(path) as archive:
        assert archive.read("resources/config.toml") == file.read_bytes()
        assert archive.read("resources/model.toml") == model.read_bytes()
        assert archive.read("resources/database.dbc") == config.database.path.read_bytes()
        with ZipFile(fmus["service"]) as plain:
            assert archive.read("modelDescription.xml") != plain.read("modelDescription.xml")


@pytest.mark.costly
def test_the_python_of_the_guide_gives_what_the_slave_gives(fmus, tmp_path, monkeypatch, config):
    guide = (ROOT / "docs" / "guides" / "fmu.md").read_text()
    (code,) = (one for one in re.findall(r"```python\n(.*?)```", guide, re.DOTALL) if "fmpy" in one)
    drive = in_phase(config, 3.0, scenario="wet")
    changes = {t_us: readings_by_name(config, frames) for t_us, frames in drive.items()}
    monkeypatch.chdir(tmp_path)
    shutil.copy(fmus["service"], "service.fmu")
    latest, lines = {}, []
    for t_us in range(0, 3_000_001, 10_000):
        latest |= changes.get(t_us, {})
        lines.append(",".join(map(repr, (t_us / 1e6, *latest.values()))))
    Path("signals.csv").write_text("\n".join([",".join(("time", *latest)), *lines]) + "\n")
    names = {}
    exec(compile(code, "fmu.md", "exec"), names)  # noqa: S102  as a reader would
    expected = stepped(SLAVES["service"](config), changes, 3_000_000, 10_000)[3_000_000]
    last = names["result"][-1]
    assert last["status"] == expected["status"] == 1
    # FMPy interpolates inputs between the rows, and so to the last digits of the time.
    assert last["mu_max"] == pytest.approx(expected["mu_max"], rel=1e-9)
    assert last["lambda_m"] == pytest.approx(expected["lambda_m"], rel=1e-9)
