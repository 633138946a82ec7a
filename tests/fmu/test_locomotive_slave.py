"""The locomotive as a slave: what it reads, what it obeys, and the truth."""

from math import isnan, nan

import numpy as np
import pytest

from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.fmu.locomotive import SCENARIO, LocomotiveSlave
from adhesion_can.physics.burckhardt import RAIL
from tests.fmu.drives import in_phase, readings_by_name, starts, stepped

NUMBERS = {name: float(number) for name, number, _ in SCENARIO.items}


@pytest.fixture(scope="module")
def config():
    return load_configuration()


def test_its_readings_are_those_of_the_frames_of_the_same_drive(config):
    drive = in_phase(config, 0.5, seed=3, scenario="wet")
    slave = LocomotiveSlave(config)
    found = stepped(slave, {}, 400_000, 10_000, scenario=NUMBERS["wet"], duration=0.5, seed=3.0)
    latest, compared = {}, 0
    for t_us, frames in drive.items():
        latest |= readings_by_name(config, frames)
        if t_us in found:
            assert {name: found[t_us][name] for name in latest} == latest, t_us
            compared += 1
    assert compared == 41
    assert found[400_000]["wheel_speed_1"] > 0.0


def test_the_truth_is_that_of_the_rail(config):
    wet = next(surface for surface in RAIL if surface.name == "wet")
    found = stepped(LocomotiveSlave(config), {}, 100_000, 2000, scenario=NUMBERS["wet"])
    for axle in range(1, 7):
        assert found[100_000][f"true_mu_max_{axle}"] == pytest.approx(wet.mu_max, rel=1e-9)
        assert found[100_000][f"true_lambda_m_{axle}"] == pytest.approx(wet.lambda_m, rel=1e-9)
    forces = [found[100_000][f"true_force_{axle}"] for axle in range(1, 7)]
    loads = sum(config.vehicle.axle_load)
    assert found[100_000]["true_adhesion_used"] == pytest.approx(sum(forces) / loads, rel=1e-12)


def test_demanded_efforts_are_given_and_others_are_not(config):
    demand = {f"effort_demand_{axle}": 20e3 for axle in range(1, 7)}
    demand["effort_demand_4"] = nan
    found = stepped(LocomotiveSlave(config), {0: demand}, 300_000, 10_000, scenario=1.0)
    efforts = np.array([found[300_000][f"tractive_effort_{axle}"] for axle in range(1, 7)])
    noise = 5 * 2450.0
    assert np.abs(np.delete(efforts, 3) - 20e3).max() < noise
    assert abs(efforts[3]) < noise


def test_a_demand_that_holds_over_a_long_step_does_not_expire(config):
    demand = {f"effort_demand_{axle}": 50e3 for axle in range(1, 7)}
    found = stepped(LocomotiveSlave(config), {0: demand}, 1_000_000, 200_000, scenario=1.0)
    efforts = [found[1_000_000][f"tractive_effort_{axle}"] for axle in range(1, 7)]
    assert min(efforts) > 30e3


def test_without_demands_the_drive_holds_the_creep_speed_once_the_service_is_tracking(config):
    setpoint = {0: {"status": 1.0, "creep_speed_setpoint": 0.15}}
    found = stepped(LocomotiveSlave(config), setpoint, 5_000_000, 20_000, scenario=1.0)
    creeps = []
    for t_us in range(4_000_000, 5_000_000, 20_000):
        values = found[t_us]
        creeps.append(0.625 * values["wheel_speed_2"] - values["vehicle_speed"])
    assert np.mean(creeps) == pytest.approx(0.15, abs=0.02)  # it probes for 3 s at first
    assert np.std(creeps) < 0.03


def test_a_time_between_two_steps_has_the_state_of_the_earlier(config):
    slave = LocomotiveSlave(config)
    values = starts(slave)
    slave.setup(values, 5_000_000)  # the master's clock need not start at 0
    early = slave.step(5_000_000, 5_003_000, values)
    again = slave.step(5_003_000, 5_003_999, values)
    later = slave.step(5_003_999, 5_004_000, values)
    assert early == again
    assert later["true_force_1"] != early["true_force_1"]


def test_at_the_start_everything_is_there(config):
    values = LocomotiveSlave(config).setup(starts(LocomotiveSlave(config)), 0)
    assert not [name for name, value in values.items() if isnan(value)]


def test_set_up_again_it_repeats_itself_and_another_seed_does_not(config):
    slave = LocomotiveSlave(config)
    first = stepped(slave, {}, 50_000, 2000)
    assert stepped(slave, {}, 50_000, 2000) == first
    assert stepped(slave, {}, 50_000, 2000, seed=2.0) != first


@pytest.mark.parametrize(
    ("name", "value"),
    [("scenario", 0.0), ("scenario", 99.0), ("seed", -1.0), ("duration", 0.0), ("duration", nan)],
)
def test_a_parameter_that_cannot_be_is_named(config, name, value):
    slave = LocomotiveSlave(config)
    with pytest.raises(InputError, match=name):
        slave.setup({**starts(slave), name: value}, 0)


def test_a_creep_speed_that_is_infinite_is_none(config):
    found = [
        stepped(
            LocomotiveSlave(config),
            {0: {"status": 1.0, "creep_speed_setpoint": value}},
            500_000,
            10_000,
            scenario=1.0,
        )
        for value in (nan, np.inf)
    ]
    assert found[0][500_000] == found[1][500_000]
