"""The scenarios for a vehicle of another size: noise, efforts and speeds that its signals carry."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from adhesion_can import simulate
from adhesion_can.api.simulation import build_run_settings
from adhesion_can.bus.block import Block
from adhesion_can.bus.receiver import Receiver
from adhesion_can.cli.main import main
from adhesion_can.config import load_configuration
from adhesion_can.errors import ConfigError, InputError
from adhesion_can.physics.driving_plan import PlanLimits
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.drive import DriveSettings
from adhesion_can.simulation.own_vehicle import scenario_of
from adhesion_can.simulation.scenarios import SCENARIOS
from adhesion_can.simulation.sensors import SensorNoiseSettings

AXLES = (1, 2, 3, 4)
VEHICLE = """
[vehicle]
axles = 4
wheel_radius_m = 0.31
axle_load_N = 92e3
wheelset_inertia_kgm2 = 60.0
"""


def own(folder: Path, *, kmh="[0|80]", rpm="[0|1000]", kN="[-60|60]", mass=37.5e3, more=""):
    """Configuration of a tram whose signals have these ranges."""
    messages = "".join(
        f"""BO_ {1296 + axle} Bogie{axle}: 8 TCU
 SG_ Wheel{axle} : 7|16@0+ (0.1,0) {rpm} "rpm" TCU
 SG_ Force{axle} : 23|16@0- (0.01,0) {kN} "kN" TCU
 SG_ Load{axle} : 39|16@0+ (0.01,0) [0|92.5] "kN" TCU
BA_ "GenMsgCycleTime" BO_ {1296 + axle} 10;
"""
        for axle in AXLES
    )
    (folder / "own.dbc").write_text(
        f"""VERSION ""
NS_ :
BS_:
BU_: TCU
BO_ 1280 Odo: 8 TCU
 SG_ v : 7|16@0+ (0.01,0) {kmh} "km/h" TCU
{messages}
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_DEF_ "GenMsgCycleTime" 20;
"""
    )
    roles = "".join(
        f'"wheel_speed.{axle}" = "Bogie{axle}.Wheel{axle}"\n'
        f'"tractive_effort.{axle}" = "Bogie{axle}.Force{axle}"\n'
        for axle in AXLES
    )
    path = folder / "own.toml"
    path.write_text(
        f'{VEHICLE}train_mass_kg = {mass:g}\n[bus]\ndatabase = "own.dbc"\n'
        f'[roles]\nvehicle_speed = "Odo.v"\n{roles}{more}'
    )
    return path


def readings(frames, config):
    receiver = Receiver(config.messages)
    block = Block.from_frames(frames, ())
    found = receiver.accept_block(block, block.t_us).readings
    assert receiver.rejected == 0
    return {key: values for key, (_, values, *_) in found.items()}


def test_the_default_locomotive_runs_the_scenarios_as_they_are():
    config = load_configuration()
    for scenario in SCENARIOS:
        settings = build_run_settings(scenario.name, 1.0, 1, (), config)
        assert settings.scenario == scenario
        assert settings.noise == SensorNoiseSettings()
        assert settings.drive == replace(DriveSettings(), braking_max=DriveSettings().effort_max)
        assert settings.notes == ()
        assert settings.scenario.profile.help(40.0, 3.0) == 0.0


def test_noise_is_in_proportion_to_the_static_load(tmp_path):
    config = load_configuration(own(tmp_path))
    noise = simulate("dry", 0.1, configuration=config).truth["noise"]
    assert noise["effort"] == pytest.approx(920.0)
    assert noise["load"] == pytest.approx(500 * 92 / 245)
    assert config.sensors.effort_std == pytest.approx(920.0)
    stated = load_configuration(own(tmp_path, more="[sensors]\neffort_std = 300.0\n"))
    assert stated.sensors.effort_std == 300.0


@pytest.mark.costly
@pytest.mark.parametrize("scenario", ["dry", "sweep"])
@pytest.mark.parametrize("ranges", [
    {}, {"kmh": "[0|50]"}, {"rpm": "[0|500]"}, {"kN": "[-20|20]"},
    {"kmh": "[0|300]", "rpm": "[0|3000]", "kN": "[-300|300]"},
], ids=["usual", "slow", "slow wheels", "weak", "wide"])  # fmt: skip
def test_a_tram_stays_within_the_ranges_of_its_signals(tmp_path, ranges, scenario):
    mass = 380e3 if scenario == "sweep" else 37.5e3
    config = load_configuration(own(tmp_path, mass=mass, **ranges))
    drive = simulate(scenario, 16.0, configuration=config)
    found = readings(drive.frames, config)
    speed = found[Role.VEHICLE_SPEED, 0]
    assert speed.min() > 2.0
    assert speed.max() < 25.0  # speed_max of [limits]
    notes = drive.truth["notes"]
    assert any("second vehicle" in note for note in notes) is (scenario != "sweep")
    assert not any("at an end of its range" in note for note in notes)
    is_weak = ranges.get("kN") == "[-20|20]"
    assert any("tractive_effort.1 (-20 to 20" in note for note in notes) is is_weak


def test_the_second_vehicle_is_for_light_trains_alone(tmp_path):
    heavy = simulate("dry", 0.1, configuration=own(tmp_path, mass=1e6))
    assert heavy.truth["notes"] == []


@pytest.mark.slow
def test_a_light_train_cannot_sweep_and_a_coupled_one_never_stands(tmp_path):
    says = r"train of 37\.5 t is too light for 'sweep'.*write train_mass_kg = 380000 in a copy"
    with pytest.raises(InputError, match=says):
        simulate("sweep", 1.0, configuration=own(tmp_path))
    config = load_configuration(own(tmp_path, mass=380e3))
    found = readings(simulate("sweep", 150.0, configuration=config).frames, config)
    assert found[Role.VEHICLE_SPEED, 0].min() > 2.0


def test_speeds_are_limited_by_the_configuration(tmp_path):
    path = own(tmp_path, more="[limits]\nspeed_max = 8.0\n")
    drive = simulate("dry", 10.0, configuration=path)
    speeds = readings(drive.frames, load_configuration(path))[Role.VEHICLE_SPEED, 0]
    assert 3.0 < np.mean(speeds) < speeds.max() < 8.0
    assert any("by speed_max in [limits]" in note for note in drive.truth["notes"])


def test_a_limit_that_nobody_wrote_is_called_a_default():
    fast, (note,) = scenario_of(SCENARIOS[0].at_pace(2.0), Locomotive(), PlanLimits(), (), 0.2)
    assert fast.top_speed == pytest.approx(PlanLimits().speed_max)
    assert note.endswith("up to 90 km/h, by speed_max (default of [limits])")


@pytest.mark.costly
def test_an_effort_without_a_sign_is_never_below_0(tmp_path):
    config = load_configuration(own(tmp_path, kN="[0|60]", mass=380e3))
    drive = simulate("sweep", 20.0, configuration=config)
    assert min(readings(drive.frames, config)[Role.TRACTIVE_EFFORT, 1]) >= 0.0
    assert any("tractive_effort.1" in n and "% of its frames" in n for n in drive.truth["notes"])


def test_a_reading_stops_at_the_end_of_its_range_and_that_is_said(tmp_path, capsys):
    """Noise alone leads a load of 92 kN beyond a range that ends at 92.5 kN."""
    more = '"axle_load.1" = "Bogie1.Load1"\n'
    path = own(tmp_path, more=more)
    log = tmp_path / "own.log"
    words = ["simulate", "--scenario", "dry", "--duration", "8", "--config", str(path)]
    assert main([*words, "--log", str(log)]) == 0
    said = capsys.readouterr().out
    assert "axle_load.1 (Bogie1.Load1): at an end of its range in" in said
    sentence = "a coupled second vehicle brakes or pushes the simulated train, as in adhesion tests"
    assert f"{sentence}: with 37.5 t (train_mass_kg) the train would not keep" in said


def test_a_range_without_room_for_the_vehicle_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"Force1 has no room for traction.*-3 to 3"):
        simulate("dry", 1.0, configuration=own(tmp_path, kN="[-3|3]"))
    load = '"axle_load.1" = { signal = "Bogie1.Load1", unit = "t" }\n'
    path = own(tmp_path, more=load)
    database = tmp_path / "own.dbc"
    database.write_text(database.read_text().replace("[0|92.5]", "[0|8]"))
    with pytest.raises(InputError, match=r"axle_load.1.*would be 9\.\d+, beyond its range"):
        simulate("dry", 1.0, configuration=path)


def test_axles_that_share_a_signal_need_their_factors(tmp_path, capsys):
    """The sentence is that of `replay` and `check`."""
    path = own(tmp_path)
    path.write_text(path.read_text().replace("Bogie2.Force2", "Bogie1.Force1"))
    says = "tractive_effort.1 and tractive_effort.2 are the same signal, Bogie1.Force1"
    with pytest.raises(ConfigError, match=says):
        simulate("dry", 1.0, configuration=path)
    log = tmp_path / "own.log"
    log.write_text("(1.000000) can0 500#0000000000000000\n")
    simulate_words = ["simulate", "--scenario", "dry", "--log", str(tmp_path / "new.log")]
    for words in (simulate_words, ["replay", str(log)]):
        assert main([*words, "--config", str(path)]) == 2
        assert says in capsys.readouterr().err


def test_axles_that_share_an_effort_cannot_move_by_themselves(tmp_path):
    path = own(tmp_path)
    text = path.read_text()
    for axle, source in ((1, 1), (2, 1)):
        shared = f'{{ signal = "Bogie{source}.Force{source}", factor = 0.5 }}'
        text = text.replace(f'= "Bogie{axle}.Force{axle}"', f"= {shared}")
    path.write_text(text)
    load_configuration(path).require_identification()
    with pytest.raises(ConfigError, match=r"tractive_effort\.1 and tractive_effort\.2 share"):
        simulate("dry", 1.0, configuration=path)


def test_everything_that_cannot_be_simulated_is_reported_at_once(tmp_path):
    path = own(tmp_path)
    text = path.read_text()
    for axle, source in ((1, 1), (2, 1), (3, 3), (4, 3)):
        shared = f'{{ signal = "Bogie{source}.Force{source}", factor = 0.5 }}'
        text = text.replace(f'= "Bogie{axle}.Force{axle}"', f"= {shared}")
    path.write_text(text)
    database = tmp_path / "own.dbc"
    silent = database.read_text()
    for axle in AXLES:
        silent = silent.replace(f'BA_ "GenMsgCycleTime" BO_ {1296 + axle} 10;\n', "")
    database.write_text(silent.replace('"GenMsgCycleTime" 20', '"GenMsgCycleTime" 0'))
    with pytest.raises(ConfigError) as error:
        simulate("dry", 1.0, configuration=path)
    said = str(error.value)
    assert "(1) tractive_effort.1 and tractive_effort.2 share Bogie1.Force1, " in said
    assert "tractive_effort.3 and tractive_effort.4 share Bogie3.Force3, and the" in said
    assert "(2) the cycles of Odo, Bogie1, Bogie2, Bogie3, Bogie4 are unknown; (1) map one" in said
    assert said.endswith("(2) write cycle_ms at their roles, or GenMsgCycleTime in the database")
