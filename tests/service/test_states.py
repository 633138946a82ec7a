"""Priorities of the conditions, and the timers of the status machine."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.bus.database import load_database
from adhesion_can.config import ServiceSettings
from adhesion_can.physics.estimate import Identifiable
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import Sample, Samples
from adhesion_can.physics.status import Status
from adhesion_can.service.states import (
    FAULT_HOLD_US,
    STATUS_RULES,
    VALUES,
    StatusConditions,
    StatusMachine,
    UsableLimits,
    select_status,
)
from tests.service.test_core import KNOWN

LIMITS = UsableLimits(slip_max=0.5, mu_ceiling=0.75)
SETTINGS = ServiceSettings(hold_s=1.0, change_s=5.0, estimate_s=2.0)
VAGUE = replace(KNOWN, identifiable=Identifiable(mu_max=True, lambda_m=False))


def status(machine, t_us, estimate=KNOWN, *, stale=False, speed_derived=False):
    return machine.update(t_us, estimate, stale=stale, speed_derived=speed_derived)


def machine(sample_us=0):
    new = StatusMachine(SETTINGS, LIMITS)
    new.add_sample(sample_us)
    return new


@pytest.mark.parametrize("pattern", range(32))
def test_the_first_condition_that_holds_is_the_status(pattern):
    order = ["fault", "stale", "no_estimate", "surface_change", "low_excitation"]
    expected_of = ["FAULT", "STALE_INPUT", "INIT", "SURFACE_CHANGE", "LOW_EXCITATION"]
    held = [bool(pattern >> i & 1) for i in range(5)]
    conditions = StatusConditions(**dict(zip(order, held, strict=True)))
    expected = expected_of[held.index(True)] if any(held) else "TRACKING"
    assert select_status(conditions).name == expected
    assert [row.status.name for row in STATUS_RULES] == [*expected_of, "TRACKING"]


def test_every_status_has_a_row_and_an_origin_of_its_values():
    assert sorted(row.status for row in STATUS_RULES) == sorted(Status) == sorted(VALUES)


def test_each_status_has_the_number_that_the_database_gives_it():
    for message, signal in (("AdhesionSetpoint", "Status"), ("ServiceStatus", "State")):
        names = load_database().message(message).get_signal_by_name(signal).choices
        assert {status.value: status.name for status in Status} == {
            number: str(name) for number, name in names.items()
        }


def test_a_condition_that_nobody_states_does_not_hold():
    assert select_status(StatusConditions()) is Status.TRACKING
    assert select_status(StatusConditions(low_excitation=True)) is Status.LOW_EXCITATION


def test_conditions_stay_as_they_were_judged():
    with pytest.raises(AttributeError):
        StatusConditions().fault = True


def test_without_an_estimate_the_status_is_init_and_with_one_tracking():
    assert status(machine(), 0, None) is Status.INIT
    assert status(machine(), 0) is Status.TRACKING
    assert status(machine(), 0, VAGUE) is Status.LOW_EXCITATION
    assert status(machine(), 0, speed_derived=True) is Status.LOW_EXCITATION
    assert status(StatusMachine(SETTINGS, LIMITS), 0) is Status.LOW_EXCITATION


def test_a_fault_is_held_for_a_second():
    """As docs/architecture.md has it: fifty setpoints, of which a receiver may miss some."""
    assert FAULT_HOLD_US == 1_000_000


def test_a_machine_begins_without_a_fault_from_the_stamp_0_on():
    assert status(StatusMachine(SETTINGS, LIMITS), 0, None) is Status.INIT


def test_a_fault_is_held_for_its_time_even_over_a_restart():
    one = machine()
    one.add_fault(500)
    one.restart()
    one.add_sample(0)
    assert status(one, 500 + FAULT_HOLD_US - 1) is Status.FAULT
    assert status(one, 500 + FAULT_HOLD_US) is Status.TRACKING


def test_values_may_be_held_from_the_first_stale_due_time_on():
    one = machine()
    assert not one.may_hold(0)
    assert status(one, 20_000, stale=True) is Status.STALE_INPUT
    assert one.may_hold(1_019_999)
    assert status(one, 1_020_000, stale=True) is Status.STALE_INPUT
    assert not one.may_hold(1_020_000)
    assert not one.may_hold(1_020_001), "what went out as not available does not come back"
    assert not one.may_hold(3_600_000_000)
    status(one, 1_040_000)
    status(one, 1_060_000, stale=True)
    assert one.may_hold(1_060_000)


def test_a_change_ends_with_its_time_or_a_known_peak():
    changed = replace(VAGUE, change_probability=0.5)
    one = machine(6_000_000)
    one.add_estimate(1_000_000, changed)
    assert status(one, 1_000_000) is Status.SURFACE_CHANGE
    one.add_estimate(2_000_000, VAGUE)
    assert status(one, 6_000_000) is Status.SURFACE_CHANGE
    assert status(one, 6_000_001) is Status.TRACKING
    one.add_estimate(7_000_000, changed)
    assert status(one, 7_000_000) is Status.SURFACE_CHANGE
    one.add_estimate(7_100_000, KNOWN)
    assert status(one, 7_100_000) is Status.TRACKING
    one.add_estimate(7_200_000, changed)
    one.discard_estimate()
    assert status(one, 7_200_000) is Status.TRACKING


@pytest.mark.parametrize(("probability", "changed"), [(0.49, False), (0.5, True), (0.9, True)])
def test_a_change_counts_from_even_odds_on(probability, changed):
    one = machine()
    one.add_estimate(0, replace(VAGUE, change_probability=probability))
    assert status(one, 0) is (Status.SURFACE_CHANGE if changed else Status.TRACKING)


NO_SAMPLES = Samples.from_rows([])


def samples_at(*times_us):
    """Samples of which the stamps alone matter."""
    return Samples.from_rows(
        Sample(t_us, axle=1, slip=0.02, adhesion=0.2, creep_speed=0.2, speed=10.0, load=1e5)
        for t_us in times_us
    )


def advance(machine, t_us, samples, estimate=KNOWN, *, is_new=True, **how):
    how = {"stale": False, "speed_derived": False} | how
    return machine.advance(t_us, samples, estimate, is_new=is_new, **how)


def test_what_came_starts_the_timers_before_the_status_is_told():
    one, none = StatusMachine(SETTINGS, LIMITS), NO_SAMPLES
    some = samples_at(1_000_000, 2_000_000, 1_500_000)
    assert advance(one, 0, none) is Status.LOW_EXCITATION
    assert advance(one, 2_000_000, some) is Status.TRACKING
    assert advance(one, 3_500_000, none) is Status.TRACKING
    assert advance(one, 3_500_001, none) is Status.LOW_EXCITATION, "by the last of the samples"
    changed = replace(VAGUE, change_probability=0.5)
    assert advance(one, 3_600_000, some, changed, is_new=False) is Status.LOW_EXCITATION
    assert advance(one, 3_700_000, none, changed) is Status.SURFACE_CHANGE
    assert advance(one, 3_700_000, none, None) is Status.INIT
    assert advance(one, 3_700_000, none, changed, speed_derived=True) is Status.LOW_EXCITATION
    assert advance(one, 3_700_000, none, changed, stale=True) is Status.STALE_INPUT


SHARED = {"axle": 1, "speed": 10.0, "load": 1e5}
UNUSED = {
    "a spin": [Sample(0, slip=0.6, adhesion=0.2, creep_speed=6.0, **SHARED)],
    "coasting": [
        Sample(0, slip=1e-4, adhesion=0.0, creep_speed=1e-3, slip_var=1e-6, **SHARED),
    ],
    "efforts that no rail carries": [
        Sample(0, slip=0.02, adhesion=1.5, creep_speed=0.2, **SHARED),
        Sample(0, slip=0.02, adhesion=1.6, creep_speed=0.2, **SHARED),
        Sample(0, slip=0.02, adhesion=0.2, creep_speed=0.2, **SHARED),
    ],
}


@pytest.mark.parametrize("rows", UNUSED.values(), ids=UNUSED)
def test_samples_that_no_estimate_can_use_start_no_timer(rows):
    one = StatusMachine(SETTINGS, LIMITS)
    assert advance(one, 0, Samples.from_rows(rows)) is Status.LOW_EXCITATION


def at_adhesion(t_us, adhesion, axles=6, strays=0):
    """Samples at an adhesion, but for some axles that are at the peak."""
    return Samples.from_rows(
        Sample(
            t_us,
            axle=axle + 1,
            slip=0.02,
            adhesion=KNOWN.mu_max if axle < strays else adhesion,
            creep_speed=0.2,
            speed=10.0,
            load=1e5,
            adhesion_var=1e-4,
        )
        for axle in range(axles)
    )


def test_after_a_pause_low_efforts_do_not_bring_the_peak_back():
    """In coasting the rail may have become another one, of which low efforts tell nothing."""
    one = StatusMachine(SETTINGS, LIMITS)
    low, high = 0.6 * KNOWN.mu_max, 0.85 * KNOWN.mu_max
    assert advance(one, 0, at_adhesion(0, low)) is Status.TRACKING, "there was no pause yet"
    assert advance(one, 2_000_000, at_adhesion(2_000_000, low)) is Status.TRACKING
    assert advance(one, 4_000_001, NO_SAMPLES) is Status.LOW_EXCITATION
    for t_us in range(4_100_000, 9_000_000, 20_000):
        assert advance(one, t_us, at_adhesion(t_us, low, strays=1)) is Status.LOW_EXCITATION
    assert advance(one, 9_000_000, at_adhesion(9_000_000, high)) is Status.TRACKING
    assert advance(one, 9_020_000, at_adhesion(9_020_000, low)) is Status.TRACKING
    single = StatusMachine(SETTINGS, LIMITS)
    for t_us, adhesion in ((0, low), (5_000_000, low), (5_020_000, high)):
        found = advance(single, t_us, at_adhesion(t_us, adhesion, axles=1))
        assert found is (Status.LOW_EXCITATION if t_us == 5_000_000 else Status.TRACKING)


def test_samples_with_an_objection_are_no_fresh_ones():
    one, low = StatusMachine(SETTINGS, LIMITS), 0.6 * KNOWN.mu_max
    objected = replace(
        KNOWN,
        objection=Objection.SPEED_JUMP,
        identifiable=Identifiable(mu_max=False, lambda_m=False),
    )
    advance(one, 0, at_adhesion(0, low))
    for t_us in range(20_000, 3_000_000, 20_000):
        assert advance(one, t_us, at_adhesion(t_us, low), objected) is Status.LOW_EXCITATION
    # What stood for longer than a pause ends as one.
    assert advance(one, 3_000_000, at_adhesion(3_000_000, low)) is Status.LOW_EXCITATION
    near = at_adhesion(3_020_000, 0.9 * KNOWN.mu_max)
    assert advance(one, 3_020_000, near) is Status.TRACKING


def test_rolling_wheels_start_no_timer_whatever_their_common_slip():
    """The error of the vehicle speed is that of all axles: all slips at once are beyond theirs."""
    rng = np.random.default_rng(1)
    one = StatusMachine(SETTINGS, LIMITS)
    # That two of six are beyond four deviations by chance is a matter of days.
    for t_us in range(0, 60_000_000, 20_000):
        slip = 0.001 * rng.standard_t(3) + 0.0002 * rng.standard_normal(6)
        rows = replace(
            Samples.curve(slip, 0.01 * rng.standard_normal(6), np.full(6, t_us)),
            slip_common_var=np.full(6, 1e-6),
            adhesion_var=np.full(6, 1e-4),
        )
        assert advance(one, t_us, rows) is Status.LOW_EXCITATION


def test_old_samples_are_low_excitation():
    one = machine(1_000_000)
    assert status(one, 3_000_000) is Status.TRACKING
    assert status(one, 3_000_001) is Status.LOW_EXCITATION


def test_a_restart_stops_the_timers():
    one = machine()
    one.add_estimate(0, replace(KNOWN, change_probability=1.0))
    status(one, 0, stale=True)
    one.restart()
    assert not one.may_hold(0)
    assert status(one, 0) is Status.LOW_EXCITATION
