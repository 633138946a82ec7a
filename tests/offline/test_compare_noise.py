"""Noise of a recording beside the configured one, and the warning of `check`."""

import re
from dataclasses import replace
from functools import cache

import pytest

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import load_database
from adhesion_can.config import load_configuration
from adhesion_can.offline.check import check
from adhesion_can.sampling.equations import Sensors
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name
from adhesion_can.simulation.sensors import SensorNoiseSettings

CONFIG = load_configuration()


@cache
def drive(seed, **noise):
    settings = RunSettings(
        scenario_by_name("dry-wet-dry"), 12.0, seed=seed, noise=SensorNoiseSettings(**noise)
    )
    frames = [f for step in Simulation(settings, load_database()).run() for f in step]
    return Block.from_frames(frames)


@pytest.mark.costly
@pytest.mark.parametrize("seed", range(3))
def test_noise_as_configured_is_reported_without_a_warning(seed):
    result = check([drive(seed)], CONFIG)
    assert result.warnings == []
    assert not result.failures
    found = {one.key: one.estimate.std for one in result.noise}
    assert found["wheel_speed_std"] == pytest.approx(0.003, rel=0.2)
    assert found["vehicle_speed_std"] == pytest.approx(0.01, rel=0.2)
    assert found["effort_std"] == pytest.approx(2450.0, rel=0.2)


@pytest.mark.parametrize("seed", range(3))
def test_noise_beyond_a_factor_of_two_is_a_warning_with_the_key_to_write(seed):
    result = check([drive(seed, wheel_speed=0.02, vehicle_speed=0.04)], CONFIG)
    assert not result.failures
    assert len(result.warnings) == 2
    wheel, speed = result.warnings
    assert "write wheel_speed_std = 0.0" in wheel
    assert "under [sensors]" in wheel
    assert "write vehicle_speed_std = 0.0" in speed


@pytest.mark.parametrize("seed", range(3))
def test_noise_far_below_the_configured_one_is_a_warning_too(seed):
    loud = replace(CONFIG, sensors=Sensors(effort_std=12e3))
    (warning,) = check([drive(seed)], loud).warnings
    said = re.match(r"effort: noise of (\S+) N, configured 1.2e\+04 N", warning)
    assert said is not None
    assert float(said[1]) == pytest.approx(2450.0, rel=0.2)


def test_json_has_both_noises_and_those_of_the_axles():
    document = check([drive(1)], CONFIG).to_dict()
    noise = document["noise"]["wheel_speed_std"]
    assert noise["configured"] == 0.005
    assert noise["unit"] == "rad/s"
    assert noise["by_axle"].keys() == set("123456")
    assert noise["seen_s"] > 0
    assert document["warnings"] == []
