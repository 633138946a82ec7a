"""`export`: what it writes, and what it refuses."""

from zipfile import ZipFile

import pytest

from adhesion_can.api.simulation import build_run_settings, make_simulation
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.config.model_file import write_model
from adhesion_can.control.frames import ControllerOnBus
from adhesion_can.errors import InputError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.fmu import library
from adhesion_can.fmu.contents import KINDS, SLAVES, read_contents
from adhesion_can.physics.effects import ActiveEffect, known_effects
from adhesion_can.service.core import ServiceCore
from tests.fmu.drives import coupled, starts, stepped

CONFIG = """[vehicle]
axles = 4
wheel_radius_m = [0.6, 0.6, 0.6, 0.6]
"""
pytestmark = pytest.mark.usefixtures("quick_compiler")


def export(*words):
    return main(["export", *map(str, words), "--platform", library.own_platform()])


def unzipped(path, folder):
    with ZipFile(path) as archive:
        archive.extractall(folder)
    return read_contents(folder / "resources")


def model_file(folder):
    """A model in which adhesion falls with creep speed."""
    effect = next(one for one in known_effects() if one.id == "falling_friction")
    values = tuple(parameter.typical for parameter in effect.parameters)
    model = ExtendedModel((0.4, 60.0, 0.3), effects=(ActiveEffect(effect, values),))
    path = folder / "model.toml"
    write_model(model, path)
    return path


def test_configuration_and_model_travel_in_it(tmp_path, capsys):
    config, model = tmp_path / "c.toml", model_file(tmp_path)
    config.write_text(CONFIG)
    out = tmp_path / "l.fmu"
    assert export("--fmu", "locomotive", out, "--config", config, "--model", model) == 0
    assert capsys.readouterr().out == f"{out}: locomotive for {library.own_platform()}\n"
    contents, guid = unzipped(out, tmp_path / "there")
    assert guid in (tmp_path / "there" / "modelDescription.xml").read_text()
    assert contents.kind == "locomotive"
    assert contents.configuration.vehicle.wheel_radius == (0.6,) * 4
    assert contents.configuration.model.effects[0].effect.id == "falling_friction"
    slave, plain = contents.make_slave(), read_plain(tmp_path, config)
    assert "effort_demand_4" in starts(slave)
    assert "effort_demand_5" not in starts(slave)
    with_effect = stepped(slave, {}, 1_000_000, 100_000)[1_000_000]
    without = stepped(plain, {}, 1_000_000, 100_000)[1_000_000]
    assert with_effect["true_adhesion_used"] < without["true_adhesion_used"]


def read_plain(folder, config):
    out = folder / "plain.fmu"
    assert export("--fmu", "locomotive", out, "--config", config) == 0
    return unzipped(out, folder / "plain")[0].make_slave()


def test_a_database_of_the_users_travels_in_it(tmp_path):
    own = tmp_path / "mine.dbc"
    packaged = load_configuration().database.path
    own.write_text(packaged.read_text().replace("WheelSpeeds1", "Axles123"))
    config = tmp_path / "c.toml"
    roles = [f'wheel_speed.{n} = "Axles123.WheelSpeed_Ax{n}"' for n in (1, 2, 3)]
    roles += [f'tractive_effort.{n} = "TractiveEffort1.TractiveEffort_Ax{n}"' for n in (1, 2, 3)]
    roles.append('vehicle_speed = "VehicleSpeed.VehicleSpeed"')
    config.write_text('[bus]\ndatabase = "mine.dbc"\n[roles]\n' + "\n".join(roles) + "\n")
    out = tmp_path / "s.fmu"
    assert export("--fmu", "service", out, "--config", config) == 0
    own.unlink()
    contents, _ = unzipped(out, tmp_path / "elsewhere")
    names = starts(contents.make_slave())
    assert "cycle_Axles123" in names
    assert "axle_load_1" not in names


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--fmu", "service", "s.zip"], "no suffix .fmu"),
        (["--fmu", "service", "nowhere/s.fmu"], "its folder does not exist"),
        (["--fmu", "controller", "c.fmu", "--model", "model.toml"], "uses no model"),
        (["--fmu", "wagon", "w.fmu"], "no 'wagon'; known: service"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    model_file(tmp_path)
    try:
        status = export(*words)
    except SystemExit as end:
        status = end.code
    assert status == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.glob("*.fmu"))


def test_it_is_for_every_platform_that_can_be(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(library, "_has_zig", lambda: True)
    monkeypatch.setattr("adhesion_can.fmu.export.build_library", str.encode)
    out = tmp_path / "s.fmu"
    assert main(["export", "--fmu", "controller", str(out)]) == 0
    assert "for linux64, win64, darwin64" in capsys.readouterr().out
    with ZipFile(out) as archive:
        assert archive.read("binaries/win64/adhesion_can_controller.dll") == b"win64"
        assert archive.read("binaries/darwin64/adhesion_can_controller.dylib") == b"darwin64"


def test_resources_of_something_else_are_refused(tmp_path):
    (tmp_path / "fmu.toml").write_text('kind = "service"\n')
    with pytest.raises(InputError, match="version: missing"):
        read_contents(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_the_coupled_parts_pull_as_the_loop_of_frames_does(seed):
    config, seconds, used = load_configuration(), 40.0, []
    settings = build_run_settings("dry-wet-greasy-dry", seconds, seed, (), config, obey=True)
    simulation = make_simulation(settings, config)
    core, controller = ServiceCore(config), ControllerOnBus(config)
    simulation.await_demands()
    for frames in simulation.run():
        for frame in frames:
            for each in (*core.feed(frame), frame):
                for demand in controller.feed(each):
                    simulation.receive(demand)
        used.append(simulation.adhesion_used())
    slaves = [SLAVES[kind](config) for kind in KINDS]
    _, ours = coupled(slaves, seconds, duration=seconds, seed=float(seed))
    assert ours == pytest.approx(sum(used) / len(used), rel=0.01)
