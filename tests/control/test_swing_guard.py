"""Creep speeds that swing: when the guard acts, what it holds, and a drive with late speeds."""

from dataclasses import replace

import numpy as np
import pytest

from adhesion_can.control.creep_controller import CreepController, Mode
from adhesion_can.control.inputs import Measurement
from adhesion_can.control.settings import SwingSettings
from adhesion_can.control.swing_guard import SwingGuard
from adhesion_can.physics.vehicle import Locomotive
from tests.control.driving import DRY, GREASY, constant, drive

AXLES, CYCLE_S, SETPOINT = 6, 0.01, np.full(6, 0.4)
SETTINGS = SwingSettings()


def measured(adhesion=0.3):
    load = np.full(AXLES, 1e5)
    return Measurement(0.0, 10.0, np.full(AXLES, 10.4), adhesion * load, load)


def run(guard, seconds, error, *, slip=0.04, adhesion=lambda _: 0.3):
    """Steps with creeps that lie `error` of the setpoint aside, now above and now below."""
    for cycle in range(round(seconds / CYCLE_S)):
        sign = 1.0 if cycle // 10 % 2 else -1.0
        creep = SETPOINT * (1.0 + sign * error)
        guard.step(measured(adhesion(guard)), SETPOINT, creep, slip)


def test_small_errors_and_a_short_large_one_are_no_swing():
    guard = SwingGuard(SETTINGS, CYCLE_S)
    run(guard, 20.0, 0.9 * SETTINGS.error_max)
    assert not guard.holds
    guard = SwingGuard(SETTINGS, CYCLE_S)
    run(guard, 5.0, 0.05)
    run(guard, 0.2, 1.0)
    assert not guard.holds
    assert guard.bandwidth_share == 1.0


def test_a_swing_is_answered_by_one_slip_and_less_bandwidth():
    guard = SwingGuard(SETTINGS, CYCLE_S)
    run(guard, 2 * SETTINGS.time_constant_s, 0.8)
    assert guard.holds
    assert 0.0 < guard.slip <= 0.04
    assert guard.bandwidth_share < 1.0


def test_what_swings_on_is_lowered_to_a_bound_of_the_bandwidth():
    guard = SwingGuard(SETTINGS, CYCLE_S)
    run(guard, 20.0, 1.0)
    assert guard.bandwidth_share == SETTINGS.bandwidth_min
    assert guard.slip < 0.02


def test_it_ends_after_its_time_which_doubles():
    guard = SwingGuard(SETTINGS, CYCLE_S)
    for turn in (1, 2):
        run(guard, 1.0, 1.0)
        assert guard.holds
        run(guard, turn * SETTINGS.hold_s - 2.0, 0.0)
        assert guard.holds
        run(guard, 2.0, 0.0)
        assert not guard.holds
        assert guard.bandwidth_share == 1.0


def length_of_hold(guard):
    """Time for which one slip is held after a swing, s."""
    run(guard, 1.0, 1.0)
    assert guard.holds
    seconds = 1.0
    while guard.holds:
        run(guard, 0.5, 0.0)
        seconds += 0.5
    return seconds


def test_time_without_swings_shortens_it_again():
    guard = SwingGuard(replace(SETTINGS, hold_s=8.0), CYCLE_S)
    first, second = length_of_hold(guard), length_of_hold(guard)
    assert second == pytest.approx(2 * first, abs=1.5)
    run(guard, 33.0, 0.0)  # as long as the next hold would last
    assert length_of_hold(guard) == pytest.approx(second, abs=1.5)
    run(guard, 49.0, 0.0)  # twice: 32 s and 16 s
    assert length_of_hold(guard) == pytest.approx(first, abs=1.5)
    run(guard, 100.0, 0.0)
    assert length_of_hold(guard) == pytest.approx(first, abs=1.5)  # and never below the first


@pytest.mark.parametrize("peak", [0.02, 0.08])
def test_the_slip_climbs_towards_the_greatest_adhesion(peak):
    """From either side; the adhesion falls with the square of the distance from the peak."""
    guard = SwingGuard(SETTINGS, CYCLE_S)
    run(guard, 1.0, 1.0)
    run(guard, 25.0, 0.0, adhesion=lambda g: 0.3 - 0.1 * np.log(g.slip / peak) ** 2)
    assert abs(np.log(guard.slip / peak)) < 3 * SETTINGS.climb


def test_unknown_creep_speeds_count_for_nothing():
    guard = SwingGuard(SETTINGS, CYCLE_S)
    creep = SETPOINT.copy()
    creep[:3] = np.nan
    for _ in range(500):
        guard.step(measured(), SETPOINT, creep, 0.04)
        guard.step(measured(), SETPOINT, np.full(AXLES, np.nan), 0.04)
    assert not guard.holds


class Unguarded(CreepController):
    """The controller without its guard."""

    def _holds_still(self, *_):
        return False


def late(cycles):
    """Wheel speeds that come so many cycles late."""
    past = []

    def spoil(_, speed, rim):
        past.append(rim)
        return speed, past[max(len(past) - 1 - cycles, 0)]

    return spoil


@pytest.mark.costly
def test_late_wheel_speeds_do_not_make_the_wheels_swing_for_long():
    rows, controller = drive(constant(DRY), 9.0, spoil=late(5))
    assert controller.mode is Mode.STEADY
    plain, _ = drive(
        constant(DRY), 9.0, spoil=late(5), controller=Unguarded(Locomotive(geometry=None))
    )
    settled, without = (x[x[:, 0] > 4.0] for x in (rows, plain))
    assert settled[:, 1].mean() > 0.9
    assert settled[:, 1].mean() > without[:, 1].mean() + 0.05
    assert settled[:, 2].max() < 3.0


@pytest.mark.costly
def test_changes_of_the_rail_are_no_swing():
    for seed in range(2):
        _, controller = drive(lambda t: DRY if int(t) % 4 < 2 else GREASY, 10.0, seed=seed)
        assert controller.mode is Mode.SEARCH
