"""The public interface: what `import adhesion_can` gives, on arrays, paths and objects."""

import doctest
import json
import subprocess
import sys
from importlib import import_module

import numpy as np
import pytest

import adhesion_can
from adhesion_can.errors import ConfigError, InputError, RecordingError
from tests.api.drives import WET, drive_file, humid_table

C1, C2, C3 = 0.4, 40.0, 0.06
SLIP = np.linspace(0.001, 0.2, 500)
ADHESION = C1 * (1 - np.exp(-C2 * SLIP)) - C3 * SLIP


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return drive_file(tmp_path_factory.mktemp("drive") / "wet.log")


def test_every_public_name_is_there_and_documented():
    for name in adhesion_can.__all__:
        value = getattr(adhesion_can, name)
        assert value.__doc__, name
    assert adhesion_can.__version__.count(".") == 2
    assert set(adhesion_can.__all__) <= set(dir(adhesion_can))
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = adhesion_can.nothing


def test_importing_the_package_imports_no_library():
    code = "import sys, adhesion_can; print('numpy' in sys.modules, 'scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


@pytest.mark.parametrize(
    "name",
    ["adhesion_can", *(f"adhesion_can.api.{n}" for n in ("configuration", "identification"))],
)
def test_the_examples_of_the_docstrings_run(name):
    result = doctest.testmod(import_module(name))
    assert result.attempted
    assert not result.failed


def test_plain_arrays_are_identified():
    result = adhesion_can.identify(SLIP, ADHESION)
    assert result.whole.theta == pytest.approx((C1, C2, C3), rel=1e-4)
    assert len(result.segments) == 1


def test_lists_are_arrays_too():
    result = adhesion_can.identify(SLIP.tolist(), ADHESION.tolist())
    assert result.whole.c1 == pytest.approx(C1, rel=1e-4)


def test_times_show_a_change_of_the_surface():
    slip = np.tile(np.linspace(0.001, 0.2, 100), 10)
    half = len(slip) // 2
    adhesion = C1 * (1 - np.exp(-C2 * slip)) - C3 * slip
    adhesion[half:] *= 0.5
    result = adhesion_can.identify(slip, adhesion, time_s=0.05 * np.arange(len(slip)))
    assert len(result.segments) == 2
    first, second = (segment.estimate.mu_max for segment in result.segments)
    assert second == pytest.approx(first / 2, rel=1e-3)


@pytest.mark.parametrize(
    ("slip", "adhesion", "words"),
    [
        (SLIP, ADHESION[:-1], r"slip \(500,\), adhesion \(499,\)"),
        (SLIP.reshape(2, -1), ADHESION.reshape(2, -1), "shapes differ"),
        (["a", "b"], [0.1, 0.2], "not numbers"),
        (100 + SLIP, ADHESION, "no usable sample"),
        ([], [], "no usable sample"),
    ],
)
def test_arrays_that_do_not_fit_are_an_error_that_says_why(slip, adhesion, words):
    with pytest.raises(InputError, match=words):
        adhesion_can.identify(slip, adhesion)


def test_one_array_alone_is_an_error():
    with pytest.raises(InputError, match="adhesion: is missing"):
        adhesion_can.identify(SLIP)


def test_times_out_of_order_are_an_error():
    with pytest.raises(InputError, match="ascending"):
        adhesion_can.identify(SLIP, ADHESION, time_s=-np.arange(500.0))


def test_results_are_json_and_html():
    result = adhesion_can.identify(SLIP, ADHESION)
    document = json.loads(json.dumps(result.to_dict()))
    assert document["mu_max"]["value"] == result.whole.mu_max
    assert document["segments"][0]["samples"] == 500
    for shown in (result, result.whole):
        assert "<table>" in shown._repr_html_()


def test_a_recording_is_identified_by_path_and_by_object(drive):
    by_path = adhesion_can.identify(str(drive))
    by_object = adhesion_can.identify(adhesion_can.Recording(drive))
    assert by_path.to_dict() == by_object.to_dict()
    assert by_path.whole.mu_max == pytest.approx(WET.mu_max, rel=0.03)


@pytest.mark.costly
def test_a_table_is_identified_by_its_path(tmp_path):
    result = adhesion_can.identify(humid_table(tmp_path / "rig.csv"))
    assert result.whole.samples == 4000


def test_a_replay_is_a_table_that_pandas_takes(drive):
    pandas = pytest.importorskip("pandas")
    table = adhesion_can.replay(drive, to_s=5.0)
    frame = pandas.DataFrame(table)
    assert list(frame.columns[:3]) == ["time_s", "status", "mu_max"]
    assert len(frame) == 251
    assert set(frame["status"]) <= {"INIT", "TRACKING", "LOW_EXCITATION", "SURFACE_CHANGE"}
    assert frame["mu_max"].iloc[-1] == pytest.approx(WET.mu_max, rel=0.03)
    assert frame["mu_max"].iloc[0] != frame["mu_max"].iloc[0]  # INIT: not available
    assert "TRACKING" in table._repr_html_()
    assert table.to_dict()["mu_max"][0] is None


def test_a_replay_equals_the_table_of_the_command(drive, tmp_path):
    from adhesion_can.cli.main import main

    table = adhesion_can.replay(drive, estimator="ekf", to_s=2.0)
    out = tmp_path / "t.csv"
    words = ["replay", str(drive), "--to", "2", "--estimator", "ekf", "--table", str(out)]
    assert main(words) == 0
    rows = [line.split(",") for line in out.read_text().splitlines()]
    assert rows[0] == list(table)
    for place, name in enumerate(rows[0]):
        column = [row[place] for row in rows[1:]]
        if name in ("status", "doubt", "family", "objection"):
            assert column == table[name].tolist()
        else:
            values = np.array([float(text) if text else np.nan for text in column])
            np.testing.assert_allclose(values, table[name], rtol=1e-8)


def test_an_unknown_estimator_is_an_error(drive):
    with pytest.raises(ConfigError, match="no estimator 'nothing'"):
        adhesion_can.replay(drive, estimator="nothing")


def test_a_simulated_drive_is_the_one_of_the_command(tmp_path):
    from adhesion_can.cli.main import main

    found = adhesion_can.simulate("wet", 1.0, seed=3, effects={"effort_bias": 3000.0})
    words = "simulate --scenario wet --duration 1 --seed 3 --effect effort_bias=3000".split()  # noqa: SIM905
    assert main([*words, "--log", str(tmp_path / "a.log")]) == 0
    written = found.write(tmp_path / "b.log")
    assert written.read_bytes() == (tmp_path / "a.log").read_bytes()
    assert found.truth["effects"][0]["effect"] == "effort_bias"
    assert "wet" in found._repr_html_()
    json.dumps(found.to_dict())


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"scenario": "lunar"}, "^scenario.*no scenario 'lunar'"),
        ({"scenario": "dry", "duration_s": 0.0}, "^duration"),
        ({"scenario": "dry", "seed": -1}, "^seed"),
        ({"scenario": "dry", "effects": {"magic": None}}, "magic"),
    ],
)
def test_a_simulation_that_cannot_be_is_an_error(arguments, words):
    with pytest.raises(InputError, match=words):
        adhesion_can.simulate(**arguments)


def test_a_diagnosis_of_a_table_names_the_cause_and_its_model_serves(tmp_path):
    table = humid_table(tmp_path / "rig.csv")
    found = adhesion_can.diagnose(table)
    assert found.verdict == "named"
    assert [cause.effect for cause in found.causes] == ["humidity"]
    document = json.loads(json.dumps(found.to_dict()))
    assert document["inputs"][0]["path"] == str(table)
    assert "humidity" in found._repr_html_()
    configuration = adhesion_can.load_configuration(model=found.model)
    assert configuration.model is found.model


def test_a_file_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(RecordingError, match="No such file"):
        adhesion_can.replay(tmp_path / "none.log")


def test_a_configuration_may_be_a_path(drive, tmp_path):
    config = tmp_path / "c.toml"
    config.write_text('estimator = "ekf"\n')
    assert adhesion_can.load_configuration(config).estimator == "ekf"
    by_path = adhesion_can.replay(drive, config, to_s=1.0)
    by_name = adhesion_can.replay(drive, estimator="ekf", to_s=1.0)
    np.testing.assert_array_equal(by_path["mu_max"], by_name["mu_max"])
