"""Delays between force and slip, and speeds of another unit, from columns as they stand."""

import numpy as np
import pytest

from adhesion_can.offline.consistency import acceleration_ratio, inspect_acceleration, inspect_delay

STEP_S = 0.1
ROWS = 1200


def drive(seed, late_s=0.0, driven_share=1.0):
    """Stamps, slip, adhesion and speed of an axle: a random walk of the creep, Newton's law."""
    rng = np.random.default_rng(seed)
    t = np.arange(ROWS) * STEP_S
    knots = np.arange(0.0, t[-1] + 5.0, 2.0)
    slip = np.interp(t, knots, 0.02 * rng.standard_normal(len(knots)))
    size = np.abs(slip)
    adhesion = np.sign(slip) * (0.3 * (1 - np.exp(-60 * size)) - 0.3 * size)
    speed = 15.0 + driven_share * 9.81 * STEP_S * np.cumsum(adhesion)
    adhesion = np.interp(t - late_s, t, adhesion) + 0.01 * rng.standard_normal(ROWS)
    t_us = np.round(1e6 * t).astype(np.int64)
    return t_us, slip + 0.001 * rng.standard_normal(ROWS), adhesion, speed


@pytest.mark.parametrize("seed", range(10))
def test_rows_in_step_have_no_finding(seed):
    t_us, slip, adhesion, speed = drive(seed)
    assert list(inspect_delay(t_us, slip, adhesion)) == []
    assert list(inspect_acceleration(t_us, speed, adhesion)) == []


@pytest.mark.parametrize("late_s", [-2.0, -0.4, 0.4, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_late_column_is_told_with_its_delay(seed, late_s):
    t_us, slip, adhesion, _ = drive(seed, late_s)
    (finding,) = inspect_delay(t_us, slip, adhesion)
    late, early = ("force", "slip") if late_s > 0 else ("slip", "force")
    assert f"the {late} lags the {early} by {abs(late_s):.3g} s" in finding.what
    # What `diagnose` can test is told; beyond it no answer is honest.
    assert finding.fatal is (abs(late_s) > 0.5)


def test_gaps_between_rows_are_no_delay():
    """Rows on both sides of a gap are no neighbours."""
    t_us, slip, adhesion, _ = drive(1, 0.4)
    whole = np.ones(ROWS, dtype=bool)
    whole[::7] = False
    t_us = t_us + 10_000_000 * (np.arange(ROWS) // 100)
    assert len(list(inspect_delay(t_us, slip, adhesion))) == 1
    assert list(inspect_delay(t_us[whole][:80], slip[whole][:80], 0 * adhesion[whole][:80])) == []


@pytest.mark.parametrize("share", [0.3, 0.5, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_the_ratio_is_the_share_of_the_axles_that_drive(seed, share):
    t_us, _, adhesion, speed = drive(seed, driven_share=share)
    assert acceleration_ratio(t_us, speed, adhesion) == pytest.approx(share, rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_a_speed_in_another_unit_changes_too_fast(seed):
    t_us, _, adhesion, speed = drive(seed, driven_share=0.5)
    (finding,) = inspect_acceleration(t_us, 3.6 * speed, adhesion)
    assert "1.8 times faster than this adhesion" in finding.what
    assert "unit=km/h" in finding.fix


def test_a_constant_speed_says_nothing():
    t_us, _, adhesion, speed = drive(1)
    assert acceleration_ratio(t_us, 0 * speed + 11.0, adhesion) is None


def test_slips_that_come_and_go_beyond_the_peak_are_no_delay():
    """The curve falls there: the adhesion is least where the slip is greatest."""
    t_us = np.arange(3000, dtype=np.int64) * 50_000
    for period_s in (2.0, 3.5, 7.0):
        slip = 0.02 + 0.2 * (1.0 - np.cos(2.0 * np.pi * t_us / 1e6 / period_s))
        adhesion = 0.35 * (1.0 - np.exp(-60.0 * slip)) - 0.6 * slip
        noise = 0.005 * np.random.default_rng(1).standard_normal(len(slip))
        assert list(inspect_delay(t_us, slip, adhesion + noise)) == []
