"""The numbers of the setpoints: current, held or none, by hand from a known curve."""

from dataclasses import replace
from math import exp, inf

import pytest

from adhesion_can.config import load_configuration
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.readings import Role
from adhesion_can.physics.status import Status
from adhesion_can.service.outputs import (
    OutputBuilder,
    Outputs,
    Setpoint,
    compute_target_slip,
)
from tests.service.test_core import CONFIG, KNOWN

CURRENT = [Status.TRACKING, Status.LOW_EXCITATION, Status.SURFACE_CHANGE]
NONE = Outputs(speed=10.0)
"""What is sent with no number in it, at 10 m/s."""


def build(builder, status=Status.TRACKING, estimate=KNOWN, t_us=0, speed=10.0, **flags):
    chosen = {"speed_derived": False, "may_hold": False} | flags
    return builder.build(status, t_us, estimate, speed, **chosen)


@pytest.fixture
def builder():
    return OutputBuilder(CONFIG)


@pytest.mark.parametrize("status", CURRENT)
def test_current_values_are_those_of_the_estimate(builder, status):
    estimate = replace(KNOWN, doubt=Doubt.SPEED, family="polach", surface_since_us=250_000)
    found = build(builder, status, estimate, t_us=2_750_000)
    assert (found.setpoint.mu_max, found.setpoint.lambda_m) == (0.373, 0.073)
    assert (found.mu_max_std, found.lambda_m_std) == (0.001, 0.002)
    assert found.theta == (0.4, 60.0, 0.3)
    assert found.surface_age_s == 2.5
    assert (found.status, found.doubt, found.family) == (status, Doubt.SPEED, "polach")
    assert found.speed == 10.0
    assert dict(found.axles) == dict.fromkeys(range(1, 7), found.setpoint)


@pytest.mark.parametrize("status", [Status.INIT, Status.FAULT, Status.STALE_INPUT])
@pytest.mark.parametrize("estimate", [KNOWN, None])
def test_no_other_status_sends_an_estimate(builder, status, estimate):
    assert build(builder, status, estimate) == replace(NONE, status=status)


@pytest.mark.parametrize("status", CURRENT)
def test_without_an_estimate_nothing_is_sent_whatever_the_status(builder, status):
    build(builder)
    assert build(builder, status, None, may_hold=True) == replace(NONE, status=status)


def test_an_observed_speed_is_sent_for_a_measured_one_and_scales_the_creep_speed(builder):
    observed = build(builder, estimate=replace(KNOWN, observed_speed=12.0), speed=None)
    assert observed.speed == 12.0
    assert observed.speed_observed
    measured = build(builder, speed=12.0)
    assert not measured.speed_observed
    assert observed.setpoint == measured.setpoint


def test_a_surface_that_changes_at_the_due_time_or_after_it_is_of_age_0(builder):
    found = [
        build(builder, t_us=t_us, estimate=replace(KNOWN, surface_since_us=10)) for t_us in (9, 10)
    ]
    assert [one.surface_age_s for one in found] == [0.0, 0.0]
    assert build(builder, t_us=1).surface_age_s == 1e-6


# --- the creep speed


def curve(slip):
    return 0.4 * (1 - exp(-60 * slip)) - 0.3 * slip


def test_the_creep_speed_is_the_slip_that_uses_the_share_of_the_peak_times_the_speed(builder):
    share = CONFIG.service.target_share
    creep = build(builder, speed=20.0).setpoint.creep_speed
    assert curve(creep / 20.0) == pytest.approx(share * max(curve(k / 1e4) for k in range(2000)))
    assert build(builder, speed=5.0).setpoint.creep_speed == pytest.approx(creep / 4)


@pytest.mark.parametrize("speed", [None, 0.0, -3.0, 0.25])
def test_below_the_smallest_speed_the_creep_speed_is_that_of_the_smallest_speed(tmp_path, speed):
    path = tmp_path / "c.toml"
    path.write_text("[sampling]\nv_min = 0.25\n")
    builder = OutputBuilder(load_configuration(path))
    slow = build(builder, speed=speed)
    assert slow.speed == speed
    ten = build(builder, speed=2.5).setpoint.creep_speed
    assert slow.setpoint.creep_speed == pytest.approx(ten / 10)


def test_an_axle_of_its_own_aims_at_the_same_share_of_its_own_peak(builder):
    estimate = replace(KNOWN, per_axle={2: (0.3, 1.5 * KNOWN.lambda_m), 3: (0.2, 0.0)})
    found = build(builder, estimate=estimate)
    creep = found.setpoint.creep_speed
    assert found.axles[1] == found.setpoint
    assert found.axles[2] == Setpoint(0.3, 1.5 * KNOWN.lambda_m, pytest.approx(1.5 * creep))
    assert found.axles[3] == Setpoint()


@pytest.mark.parametrize("status", CURRENT)
@pytest.mark.parametrize(
    "no_peak", [{"mu_max": 0.0}, {"mu_max": 0.0049}, {"mu_max": 0.7501}, {"lambda_m": 0.0}], ids=str
)
def test_a_peak_that_no_rail_has_is_not_available(builder, status, no_peak):
    estimate = replace(KNOWN, objection=Objection.BEYOND_CEILING, **no_peak)
    expected = Outputs(status, speed=10.0, objection=Objection.BEYOND_CEILING)
    assert build(builder, status, estimate) == expected


@pytest.mark.parametrize("mu_max", [0.005, 0.75])
def test_the_least_and_the_largest_peak_of_a_rail_are_sent(builder, mu_max):
    assert build(builder, estimate=replace(KNOWN, mu_max=mu_max)).setpoint.mu_max == mu_max


def test_an_axle_whose_peak_no_rail_has_has_no_setpoint(builder):
    found = build(builder, estimate=replace(KNOWN, per_axle={2: (1.31, 0.1)}))
    assert found.axles[1] == found.setpoint
    assert found.axles[2] == Setpoint()


def test_a_raised_ceiling_and_a_watch_that_is_off_send_higher_peaks(tmp_path):
    for number, line in enumerate(("mu_ceiling = 1.4", "enabled = false")):
        path = tmp_path / f"{number}.toml"
        path.write_text(f"[plausibility]\n{line}\n")
        high = OutputBuilder(load_configuration(path))
        assert build(high, estimate=replace(KNOWN, mu_max=1.3)).setpoint.mu_max == 1.3


def test_an_axle_needs_wheel_speed_and_effort_of_its_own_for_a_setpoint():
    missing = {(Role.WHEEL_SPEED, 2), (Role.TRACTIVE_EFFORT, 5)}
    choices = tuple(c for c in CONFIG.choices if (c.role, c.axle) not in missing)
    found = build(OutputBuilder(replace(CONFIG, choices=choices)))
    assert list(found.axles) == [1, 3, 4, 6]


def test_the_peak_is_looked_for_up_to_the_configured_slip(tmp_path):
    """A curve without a peak: its largest adhesion is at the end of the range."""
    path = tmp_path / "c.toml"
    path.write_text("[identifiability]\nslip_max = 0.1\n")
    endless = replace(KNOWN, c2=5.0, c3=0.0)
    near = build(OutputBuilder(load_configuration(path)), estimate=endless).setpoint.creep_speed
    far = build(OutputBuilder(CONFIG), estimate=endless).setpoint.creep_speed
    assert 0 < near < 0.1 * 10 < far


# --- confidence


def test_a_speed_from_driven_axles_takes_the_confidence_and_leaves_the_numbers(builder):
    plain, derived = build(builder), build(builder, speed_derived=True)
    assert (derived.mu_max_std, derived.lambda_m_std) == (inf, inf)
    assert replace(derived, mu_max_std=0.001, lambda_m_std=0.002) == plain


def test_what_was_sent_cannot_be_changed_afterwards(builder):
    """The builder holds it, and listeners have it."""
    found = build(builder)
    with pytest.raises(AttributeError):
        found.status = Status.FAULT
    with pytest.raises(AttributeError):
        found.setpoint.mu_max = 1.0


# --- held values


def test_a_stale_input_sends_the_last_values_as_long_as_they_may_be_held(builder):
    build(builder, estimate=replace(KNOWN, mu_max=0.1))
    last = build(builder, t_us=20_000)
    for _ in range(2):
        held = build(builder, Status.STALE_INPUT, t_us=900_000, speed=None, may_hold=True)
        assert held == replace(last, status=Status.STALE_INPUT, speed=None)
    none = build(builder, Status.STALE_INPUT, t_us=2_000_000)
    assert none == replace(NONE, status=Status.STALE_INPUT)


@pytest.mark.parametrize("status", [Status.INIT, Status.FAULT])
def test_no_other_status_holds_values(builder, status):
    build(builder)
    assert build(builder, status, may_hold=True) == replace(NONE, status=status)


def test_before_the_first_values_there_are_none_to_hold(builder):
    stale = replace(NONE, status=Status.STALE_INPUT)
    assert build(builder, Status.STALE_INPUT, may_hold=True) == stale
    build(builder)
    builder.restart()
    assert build(builder, Status.STALE_INPUT, may_hold=True) == stale


EXPECTED = {"status": Status.TRACKING, "t_us": 40_000, "estimate": KNOWN, "speed": 10.0}


def test_what_is_prepared_is_not_computed_again(builder):
    builder.prepare(**EXPECTED, speed_derived=False)
    compute_target_slip.cache_clear()
    prepared = build(builder, **EXPECTED)
    assert not compute_target_slip.cache_info().misses
    assert prepared == build(OutputBuilder(CONFIG), **EXPECTED)


@pytest.mark.parametrize(
    "other",
    [
        {"status": Status.LOW_EXCITATION},
        {"status": Status.STALE_INPUT},
        {"t_us": 60_000},
        {"estimate": replace(KNOWN, mu_max=0.2)},
        {"estimate": None},
        {"speed": 11.0},
        {"speed": None},
        {"speed_derived": True},
    ],
)
def test_what_came_otherwise_than_expected_is_computed_anew(builder, other):
    builder.prepare(**EXPECTED, speed_derived=False)
    assert build(builder, **EXPECTED | other) == build(OutputBuilder(CONFIG), **EXPECTED | other)


def test_for_a_status_without_numbers_nothing_is_prepared(builder):
    compute_target_slip.cache_clear()
    builder.prepare(**EXPECTED | {"status": Status.STALE_INPUT}, speed_derived=False)
    assert not compute_target_slip.cache_info().misses
    assert build(builder, **EXPECTED) == build(OutputBuilder(CONFIG), **EXPECTED)


def test_what_was_prepared_serves_once(builder):
    builder.prepare(**EXPECTED, speed_derived=False)
    build(builder, Status.INIT)
    compute_target_slip.cache_clear()
    build(builder, **EXPECTED)
    assert compute_target_slip.cache_info().misses == 1
