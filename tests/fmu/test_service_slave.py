"""The service fed with readings is the service fed with frames, to the last bit."""

from dataclasses import replace
from math import inf, isnan, nan

import pytest

from adhesion_can.bus.roles import packaged_choices
from adhesion_can.config import load_configuration
from adhesion_can.errors import InputError
from adhesion_can.fmu.service import ServiceSlave, output_values, setpoint_values
from adhesion_can.physics.readings import Role
from adhesion_can.physics.status import Status
from tests.fmu.drives import in_phase, readings_by_name, replayed, starts, stepped

SECONDS = 9.0


@pytest.fixture(scope="module")
def config():
    return load_configuration()


@pytest.fixture(scope="module")
def drive(config):
    return in_phase(config, SECONDS)


def same(ours, theirs):
    """Equal to the last bit; NaN is itself."""
    return ours.keys() == theirs.keys() and all(
        x == theirs[name] or (isnan(x) and isnan(theirs[name])) for name, x in ours.items()
    )


@pytest.mark.costly
def test_setpoints_are_those_of_the_replay_to_the_bit(config, drive):
    theirs = replayed(config, drive)
    changes = {t_us: readings_by_name(config, frames) for t_us, frames in drive.items()}
    until_us = round(SECONDS * 1e6)
    ours = stepped(ServiceSlave(config), changes, until_us, 2000)
    compared = 0
    for t_us, outputs in theirs.items():
        expected = output_values(outputs)
        for axle, setpoint in outputs.axles.items():
            expected |= setpoint_values(setpoint, f"_{axle}")
        if t_us in ours and t_us > 0 and outputs.axles:
            assert same(ours[t_us], expected), t_us
            compared += outputs.status is Status.TRACKING
    assert compared > 100


@pytest.mark.costly
def test_the_step_of_the_master_changes_nothing(config, drive):
    changes = {t_us: readings_by_name(config, frames) for t_us, frames in drive.items()}
    slave = ServiceSlave(config)
    fine = stepped(slave, changes, 3_000_000, 5000)
    coarse = stepped(slave, changes, 3_000_000, 10_000)  # the same slave: it starts again
    assert all(same(values, fine[t_us]) for t_us, values in coarse.items())
    assert any(values["mu_max"] > 0.0 for values in coarse.values())


def test_before_readings_come_nothing_is_known_and_then_they_are_stale(config):
    found = stepped(ServiceSlave(config), {}, 200_000, 10_000)
    assert found[0]["status"] == Status.INIT
    assert found[200_000]["status"] == Status.STALE_INPUT
    numbers = [x for name, x in found[200_000].items() if "_" in name and "surface" not in name]
    assert numbers
    assert all(map(isnan, numbers))


def test_inputs_that_stop_are_stale_after_three_cycles(config, drive):
    changes = {t_us: readings_by_name(config, frames) for t_us, frames in drive.items()}
    last_us = 4_000_000
    kept = {t_us: values for t_us, values in changes.items() if t_us < last_us}
    gone = {name: nan for values in kept.values() for name in values if name[0] in "wt"}
    found = stepped(ServiceSlave(config), {**kept, last_us: gone}, last_us + 100_000, 10_000)
    assert found[last_us]["status"] == Status.TRACKING
    assert found[last_us + 20_000]["status"] == Status.TRACKING
    assert found[last_us + 60_000]["status"] == Status.STALE_INPUT
    assert found[last_us + 60_000]["mu_max"] > 0.0  # held for a second


def test_a_step_that_would_miss_readings_is_refused(config):
    slave = ServiceSlave(config)
    values = starts(slave)
    slave.setup(values, 0)
    with pytest.raises(InputError, match=r"cycle_WheelSpeeds1.* misses readings"):
        slave.step(0, 20_000, values)
    values |= {name: 0.02 for name in values if name.startswith("cycle") and values[name] < 0.02}
    slave.setup(values, 0)
    slave.step(0, 20_000, values)


@pytest.mark.parametrize("cycle", [0.0, -1.0, nan, inf, 1e6])
def test_a_cycle_that_is_none_is_refused(config, cycle):
    slave = ServiceSlave(config)
    with pytest.raises(InputError, match="cycle_VehicleSpeed"):
        slave.setup({**starts(slave), "cycle_VehicleSpeed": cycle}, 0)


def test_a_slower_cycle_is_that_of_the_samples(config, drive):
    changes = {t_us: readings_by_name(config, frames) for t_us, frames in drive.items()}
    slave = ServiceSlave(config)
    slow = {one.name: 0.02 for one in slave.variables if one.name.startswith("cycle_WheelSpeeds")}
    stepped(slave, changes, 2_000_000, 10_000)
    usual = slave._core.counts.samples
    stepped(slave, changes, 2_000_000, 10_000, **slow)
    assert slave._core.counts.samples == pytest.approx(usual / 2, rel=0.05)


def test_a_speed_of_driven_axles_is_never_tracking(config, drive):
    changes = {t_us: readings_by_name(config, frames) for t_us, frames in drive.items()}
    for values in changes.values():
        if "vehicle_speed_source" in values:
            values["vehicle_speed_source"] = 4.0
    found = stepped(ServiceSlave(config), changes, 6_000_000, 10_000)
    assert found[6_000_000]["status"] == Status.LOW_EXCITATION
    assert found[6_000_000]["lambda_m_std"] == inf


def test_inputs_are_those_that_have_a_role(config):
    few = [
        one
        for one in packaged_choices()
        if one.role in (Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT, Role.VEHICLE_SPEED) and one.axle < 3
    ]
    slave = ServiceSlave(replace(config, choices=tuple(few)))
    names = [one.name for one in slave.variables]
    wheels = [name for name in names if name.startswith("wheel")]
    assert wheels == ["wheel_speed_1", "wheel_speed_2"]
    assert not {"axle_load_1", "rain", "direction"} & set(names)
    assert [name for name in names if name.startswith("mu_max_")] == [
        "mu_max_std", "mu_max_1", "mu_max_2",
    ]  # fmt: skip


def test_without_efforts_there_is_no_service(config):
    few = tuple(one for one in config.choices if one.role is not Role.TRACTIVE_EFFORT)
    with pytest.raises(InputError, match="tractive effort"):
        ServiceSlave(replace(config, choices=few))


@pytest.mark.costly
@pytest.mark.parametrize("name", ["tractive_effort_1", "vehicle_speed", "wheel_speed_3"])
@pytest.mark.parametrize("bad", [inf, -inf])
def test_a_reading_that_is_infinite_once_is_one_that_is_not_available(config, drive, name, bad):
    """As the quotient of another model's first step may be."""
    changes = {t_us: readings_by_name(config, frames) for t_us, frames in drive.items()}
    found = []
    for value in (bad, nan):
        spoiled = {t_us: dict(values) for t_us, values in changes.items()}
        spoiled[1_000_000][name] = value
        found.append(stepped(ServiceSlave(config), spoiled, 3_000_000, 10_000))
    assert all(same(values, found[1][t_us]) for t_us, values in found[0].items())
    assert all(abs(values["creep_speed_setpoint"]) != inf for values in found[0].values())
