"""The limit from which a run of equal readings is a fault: by an oracle, and at its edges."""

from inspect import signature
from itertools import groupby
from math import ceil

import numpy as np
import pytest

from adhesion_can.bus.stuck_signal import StuckSignalCheck

FINE = 2.0**-9
"""A resolution whose multiples and halves are exact."""


def limit_after_a_window(values, resolution, rest):
    """Limit after the first 256 changes, from the words at the head of the module."""
    runs = [(value, len(list(same))) for value, same in groupby(values)][:257]
    bends = np.diff(np.diff([value for value, _ in runs]), prepend=0.0)
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


@pytest.mark.costly
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
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("windows", [1, 2])
def test_the_fewest_reversals_from_which_a_signal_is_noisy(windows, sign, strong, judged):
    """So many strong changes of the slope, to and fro, have one reversal less between them."""
    bends = np.zeros(256)
    bends[1 : strong + 1] = 4.0 * FINE * (-1.0) ** np.arange(strong)
    bends[strong + 1 :] = FINE * (-1.0) ** np.arange(255 - strong)
    # A slope throughout, so that every reading is another one.
    steps = 20.0 * FINE + np.cumsum(np.tile(bends, windows))
    values = 10.0 + sign * np.cumsum(np.append(0.0, steps))
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
