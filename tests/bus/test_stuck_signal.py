"""Stuck signals: found soon, whatever the drive; never told of what may stand still."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.bus.stuck_signal import WINDOW, StuckSignalCheck

STEP = 0.002
"""Resolution of the signals here."""
TRENDS = (0.0, 0.003, 0.3, 1.37, 5.0, 20.0)
"""Slopes, steps of the resolution a reading: standing, and up to a wheel that spins up."""


def rounded(values):
    return np.round(np.asarray(values) / STEP) * STEP


def noisy(rng, count, std, trend=0.0, begin=10.0):
    """Readings with white noise of `std` steps of the resolution, on a slope of `trend` steps."""
    slope = np.cumsum(np.full(count, trend * STEP))
    return rounded(begin + slope + rng.normal(0.0, std * STEP, count))


def smooth(count, begin=10.0):
    """Readings of a drive without noise: it starts, runs evenly, brakes."""
    time_s = np.arange(count) * 0.01
    return rounded(begin + 3.0 * np.sin(time_s / 7.0) ** 2 * np.clip(np.sin(time_s / 3.0), 0, 1))


def found_at(values, frozen_from):
    """Number of readings after the begin of a freeze until it is found; None: never.

    Nothing may be told before.
    """
    check = StuckSignalCheck(STEP, 0.0)
    stuck = check.accept_all(values)
    assert not stuck[:frozen_from].any()
    return int(np.argmax(stuck[frozen_from:])) if stuck[frozen_from:].any() else None


# --- one by one and in columns -------------------------------------------------------------------

PIECES = st.lists(
    st.tuples(
        st.sampled_from(["noise", "held", "frozen", "rest", "smooth", "huge"]),
        st.integers(1, 700),
        st.sampled_from([0.4, 1.0, 3.0, 50.0]),
    ),
    min_size=1,
    max_size=6,
)


def pieces(parts, seed):
    rng = np.random.default_rng(seed)
    found = [np.zeros(0)]
    for kind, count, std in parts:
        last = found[-1][-1] if len(found[-1]) else 10.0
        found.append(
            {
                "noise": lambda: noisy(rng, count, std),  # noqa: B023  called at once
                "held": lambda: np.repeat(noisy(rng, count, std), 3)[:count],  # noqa: B023
                "frozen": lambda: np.full(count, last),  # noqa: B023
                "rest": lambda: np.zeros(count),  # noqa: B023
                "smooth": lambda: smooth(count),  # noqa: B023
                "huge": lambda: rng.choice([1e308, -1e308, 5e-324], count),  # noqa: B023
            }[kind]()
        )
    return np.concatenate(found)


@given(PIECES, st.integers(0, 1 << 30), st.lists(st.floats(0, 1), max_size=5))
def test_columns_tell_what_single_readings_tell(parts, seed, cuts):
    values = pieces(parts, seed)
    single, many = StuckSignalCheck(STEP, 0.0), StuckSignalCheck(STEP, 0.0)
    one_by_one = [single.accept(value) for value in values.tolist()]
    places = sorted(round(cut * len(values)) for cut in cuts)
    in_blocks = [many.accept_all(part) for part in np.split(values, places)]
    assert np.concatenate(in_blocks).tolist() == one_by_one
    assert many == single


@pytest.mark.parametrize("resolution", [0.0, STEP])
def test_columns_tell_the_same_over_many_windows(resolution):
    rng = np.random.default_rng(5)
    values = noisy(rng, 20 * WINDOW, 2.0)
    for begin in range(1000, len(values), 1500):
        values[begin : begin + 300] = values[begin]
    single, many = StuckSignalCheck(resolution, 0.0), StuckSignalCheck(resolution, 0.0)
    one_by_one = [single.accept(value) for value in values.tolist()]
    assert many.accept_all(values).tolist() == one_by_one
    assert many == single
    assert any(one_by_one)


# --- what is found -------------------------------------------------------------------------------


@pytest.mark.parametrize("std", [1.5, 3.0, 20.0, 500.0])
@pytest.mark.parametrize("trend", TRENDS)
def test_a_freeze_is_found_within_a_few_readings(std, trend):
    """All of 50 drives: from 1.5 steps of noise on, at rest and on any slope."""
    for seed in range(50):
        rng = np.random.default_rng([seed, 1])
        begin = 3 * WINDOW + int(rng.integers(WINDOW))
        values = noisy(rng, begin + 100, std, trend)
        values[begin:] = values[begin]
        late = found_at(values, begin + 1)
        assert late is not None
        assert late <= 40


def test_a_sensor_that_holds_its_value_is_given_several_of_its_own_cycles():
    """1 Hz sent every 20 ms: 50 equal readings are its way, 350 are none."""
    rng = np.random.default_rng(2)
    values = np.repeat(noisy(rng, 400, 5000.0), 50)
    begin = len(values)
    values = np.append(values, np.full(400, values[-1]))
    late = found_at(values, begin)
    assert late is not None
    assert 150 < late < 300


def test_a_second_freeze_is_found_as_the_first_one():
    rng = np.random.default_rng(3)
    check = StuckSignalCheck(STEP, 0.0)
    for _ in range(5):
        values = noisy(rng, 3 * WINDOW, 3.0)
        assert not check.accept_all(values).any()
        stuck = check.accept_all(np.full(5000, values[-1]))
        assert np.argmax(stuck) < 60
        assert stuck[np.argmax(stuck) :].all()
        assert check.is_stuck


def test_a_sensor_that_has_become_slower_is_no_longer_told():
    """From every 10 ms to every 0.2 s: told at first, since nobody can know; then learned."""
    rng = np.random.default_rng(4)
    check = StuckSignalCheck(STEP, 0.0)
    check.accept_all(noisy(rng, 3 * WINDOW, 20.0))
    stuck = check.accept_all(np.repeat(noisy(rng, 4 * WINDOW, 20.0), 30))
    assert stuck.any()
    assert not stuck[2 * 30 * WINDOW :].any()


def test_a_stop_at_a_station_does_not_make_it_blind():
    rng = np.random.default_rng(6)
    check = StuckSignalCheck(STEP, 0.0)
    check.accept_all(noisy(rng, 3 * WINDOW, 3.0))
    assert not check.accept_all(np.zeros(60_000)).any()
    check.accept_all(noisy(rng, 2 * WINDOW, 3.0))
    assert 0 < check.limit < 40


@pytest.mark.parametrize(
    ("value", "found"),
    [(-0.5, False), (-0.5 + 0.4 * STEP, False), (-0.5 + 1.1 * STEP, True), (0.0, True)],
)
def test_the_value_at_rest_may_last_as_near_as_the_signal_can_say_it(value, found):
    """The offset of a database need not be a multiple of its factor."""
    check = StuckSignalCheck(STEP, rest=-0.5)
    check.accept_all(noisy(np.random.default_rng(7), 3 * WINDOW, 3.0))
    assert check.accept_all(np.full(1000, value)).any() == found


# --- what is not told ----------------------------------------------------------------------------


@pytest.mark.parametrize("std", [0.0, 0.2, 0.5, 0.6, 0.8, 1.0, 1.5, 3.0, 20.0])
@pytest.mark.parametrize("hold", [1, 5])
def test_no_drive_is_told_to_be_stuck(std, hold):
    """None of 200 drives of 100 s whose slope changes every few seconds, 2 million readings."""
    for seed in range(200):
        rng = np.random.default_rng([seed, 8])
        slopes = np.repeat(rng.choice([*TRENDS, *(-t for t in TRENDS)], 20), 500 // hold)
        values = 10.0 + STEP * np.cumsum(slopes) + rng.normal(0, 1, len(slopes)) * std * STEP
        values = np.repeat(rounded(np.abs(values)), hold)
        assert not StuckSignalCheck(STEP, 0.0).accept_all(values).any(), seed


def test_a_signal_without_noise_may_stand_still():
    values = np.concatenate([smooth(20_000), np.full(50_000, smooth(20_000)[-1])])
    check = StuckSignalCheck(STEP, 0.0)
    assert not check.accept_all(values).any()
    assert check.limit == 0


def test_a_commanded_effort_may_stand_still():
    """Steps of kilonewtons, held for a second in the middle and for ten now and then."""
    for seed in range(100):
        rng = np.random.default_rng([seed, 9])
        held = np.ceil(100 * rng.lognormal(0.0, 1.0, 1000)).astype(int)
        values = np.repeat(np.round(rng.normal(100e3, 50e3, 1000), -1), held)
        assert not StuckSignalCheck(10.0, 0.0).accept_all(values).any(), seed


def test_nothing_is_told_before_a_window_is_full():
    rng = np.random.default_rng(10)
    check = StuckSignalCheck(STEP, 0.0)
    values = noisy(rng, WINDOW, 500.0)
    assert not check.accept_all(np.append(values, np.full(10_000, values[-1]))).any()
