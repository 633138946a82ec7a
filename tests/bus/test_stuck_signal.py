"""Stuck signals: found soon, whatever the drive; never told of what may stand still."""

from inspect import signature
from itertools import groupby
from math import ceil

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


# --- the limit itself, by an oracle and at its edges ---------------------------------------------

FINE = 2.0**-9
"""A resolution whose multiples and halves are exact."""


def limit_after_a_window(values, resolution, rest):
    """Limit after the first 256 changes, from the words at the head of the module."""
    runs = [(value, len(list(same))) for value, same in groupby(values)][:257]
    bends = np.diff(np.diff([value for value, _ in runs]), prepend=0.0)
    bends[0] = runs[1][0] - runs[0][0]
    signs = np.sign(bends) * (np.abs(bends) >= 2.5 * resolution)
    lengths = [0 if abs(value - rest) <= resolution / 2 else n for value, n in runs[:256]]
    if np.sum(signs[1:] * signs[:-1] < 0) < 48 or sum(lengths) > 64 * 256:
        return 0
    std = np.median(np.abs(bends)) / (0.6745 * 6.0**0.5)
    equal = 0.5 if std == 0.0 else min(max(resolution / (2.0 * np.pi**0.5 * std), 0.02), 0.5)
    in_a_row = 1.0 + np.log(1e-10) / np.log(equal)
    return max(4 * max(lengths) + 4, ceil(in_a_row * max(sum(lengths) / 256, 1.0)))


def held(values, lengths):
    """Each value for as many readings as it is told, the lengths again and again."""
    return np.repeat(values, np.resize(lengths, len(values)))


def alternating(count, size=8.0):
    """Values that go up and down by some steps: every change of the slope is strong."""
    return 10.0 + FINE * size * (np.arange(count) % 2)


def limits(values, rest=0.0):
    """Limit after each reading, as single ones and as columns cut there have it."""
    single, columns = StuckSignalCheck(FINE, rest), StuckSignalCheck(FINE, rest)
    found = []
    for value in values.tolist():
        single.accept(value)
        columns.accept_all(np.array([value]))
        assert single.limit == columns.limit
        found.append(single.limit)
    whole = StuckSignalCheck(FINE, rest)
    whole.accept_all(values)
    assert whole.limit == found[-1]
    return found


@pytest.mark.parametrize("lengths", [(1,), (2,), (1, 2), (1, 1, 1, 3), (20, 5), (1, 9)])
@pytest.mark.parametrize("std", [1.5, 2.0, 3.3, 10.0, 100.0])
@pytest.mark.parametrize("rest", [0.0, 10.0])
def test_the_limit_is_that_of_the_longest_run_and_of_the_noise(std, lengths, rest):
    rng = np.random.default_rng(3)
    changing = [10.0]
    while len(changing) < 257:
        value = 10.0 + FINE * round(rng.normal(0.0, std))
        changing += [value] if value != changing[-1] else []
    values = held(np.array(changing), lengths)
    expected = limit_after_a_window(values, FINE, rest)
    assert expected > 0
    found = limits(values, rest)
    last = len(values) - np.resize(lengths, 257)[-1]
    assert set(found[:last]) == {0}
    assert set(found[last:]) == {expected}


def test_where_most_changes_are_even_the_noise_counts_as_little():
    """Nine in ten changes go on as before: the median of the changes of the slope is 0."""
    steps = np.tile([1.0] * 8 + [9.0, -9.0, 9.0, -9.0, 9.0, -9.0], 20)
    values = 10.0 + FINE * np.concatenate([[0.0], np.cumsum(steps)])[:257]
    assert np.median(np.abs(np.diff(np.diff(values)))) == 0.0
    assert limits(values)[-1] == limit_after_a_window(values, FINE, 0.0) == 35


@pytest.mark.parametrize(("strong", "judged"), [(49, True), (48, False)])
def test_the_fewest_reversals_from_which_a_signal_is_noisy(strong, judged):
    """So many strong changes of the slope, to and fro, have one reversal less between them."""
    bends = np.zeros(256)
    bends[1 : strong + 1] = 4.0 * FINE * (-1.0) ** np.arange(strong)
    bends[strong + 1 :] = FINE * (-1.0) ** np.arange(255 - strong)
    # A slope throughout, so that every reading is another one.
    steps = 20.0 * FINE + np.cumsum(bends)
    values = np.concatenate([[10.0], 10.0 + np.cumsum(steps)])
    assert (limits(values)[-1] > 0) is judged
    assert (limit_after_a_window(values, FINE, 0.0) > 0) is judged


@pytest.mark.parametrize(("further", "judged"), [(0, True), (1, False)])
def test_the_longest_mean_run_with_which_a_signal_is_judged(further, judged):
    values = held(alternating(257), [64])
    values = np.concatenate([np.full(further, values[0]), values[: 64 * 256 + 1]])
    check = StuckSignalCheck(FINE, 0.0)
    check.accept_all(values)
    assert (check.limit > 0) is judged
    assert check.limit == limit_after_a_window(values, FINE, 0.0)
    again = StuckSignalCheck(FINE, 0.0)
    for value in values.tolist():
        again.accept(value)
    assert again.limit == check.limit


@pytest.mark.parametrize("rest", [0.0, 10.0, -3.0])
@pytest.mark.parametrize(("away", "rests"), [(0.5, True), (-0.5, True), (0.75, False), (-1, False)])
def test_half_a_step_from_rest_is_at_rest(rest, away, rests):
    lively = 20.0 + alternating(300)
    values = np.concatenate([lively, np.full(100, rest + away * FINE)])
    check, columns = StuckSignalCheck(FINE, rest), StuckSignalCheck(FINE, rest)
    single = [check.accept(value) for value in values.tolist()]
    assert columns.accept_all(values).tolist() == single
    assert any(single) is not rests
    if not rests:
        assert single.index(True) == 300 + check.limit - 1


def test_a_window_that_ends_with_a_freeze_changes_nothing_before():
    """The limit that the window gives holds from its last change on."""
    first, second = alternating(257), alternating(256, size=6.0)
    values = np.concatenate([first, second[:-1], np.full(50, second[-1]), first[:9] + 1.0])
    for shift in range(3):
        parts = np.concatenate([values[:257], values[257 + shift :]])
        check, columns = StuckSignalCheck(FINE, 0.0), StuckSignalCheck(FINE, 0.0)
        single = [check.accept(value) for value in parts.tolist()]
        assert any(single)
        assert columns.accept_all(parts).tolist() == single


def test_a_new_check_knows_nothing_and_is_told_two_things():
    assert not StuckSignalCheck(FINE, 0.0).is_stuck
    assert list(signature(StuckSignalCheck).parameters) == ["resolution", "rest"]
