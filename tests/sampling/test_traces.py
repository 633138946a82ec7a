"""Traces read at other stamps, against a loop over the readings."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from adhesion_can.sampling.traces import Trace

GAP = 40


def read(t_us, value, at, gap_us):
    """Value at a stamp by a walk over the readings."""
    for own, number in zip(t_us, value, strict=True):
        if own == at:
            return number
    for (a, x), (b, y) in zip(
        zip(t_us[:-1], value[:-1], strict=True), zip(t_us[1:], value[1:], strict=True), strict=True
    ):
        if a < at < b and b - a <= gap_us:
            return x + (y - x) * (at - a) / (b - a)
    return np.nan


@given(
    st.lists(st.integers(0, 400), unique=True, max_size=12).map(sorted),
    st.lists(st.one_of(st.integers(-5, 410), st.floats(-5.0, 410.0)), max_size=12),
    st.integers(0, 2**31),
)
def test_a_trace_is_straight_between_readings_and_nothing_across_gaps(stamps, at, seed):
    t_us = np.array(stamps, dtype=np.int64)
    value = np.random.default_rng(seed).normal(size=len(t_us))
    asked = np.array(at)
    found = Trace(t_us, value).at(asked, GAP)
    wanted = [read(stamps, value, one, GAP) for one in asked]
    np.testing.assert_allclose(found, wanted, atol=1e-9)


TIMES = np.array([0, 10, 30, 40, 100, 120, 130])
TRACE = Trace(TIMES, np.array([1.0, 3.0, 2.0, 6.0, 0.0, np.nan, 5.0]))
"""A gap from 40 to 100, and a missing value at 120."""


@pytest.mark.parametrize(
    ("middle", "window"),
    [(5, 4), (5, 10), (20, 20), (20, 40), (35, 10), (15, 30), (20, 39), (110, 10), (108, 16)],
)
def test_a_mean_is_the_area_over_the_window(middle, window):
    at = middle + ((np.arange(20_000) + 0.5) / 20_000 - 0.5) * window
    wanted = TRACE.at(at, GAP).mean()
    (found,) = TRACE.mean(np.array([middle]), window, GAP)
    assert found == pytest.approx(wanted, rel=1e-4, nan_ok=True)


@pytest.mark.parametrize(("middle", "window"), [(70, 20), (40, 20), (35, 11), (100, 2), (125, 4)])
def test_a_mean_with_a_part_in_a_gap_is_not_known(middle, window):
    assert np.isnan(TRACE.mean(np.array([middle]), window, GAP)).all()


def test_a_mean_may_end_at_the_last_reading_and_begin_after_a_first_one_without_a_value():
    short = Trace(TIMES[:4], np.array([np.nan, 3.0, 2.0, 6.0]))
    assert short.mean(np.array([35, 25]), 10, GAP) == pytest.approx([4.0, 2.25])
    assert np.isnan(short.mean(np.array([36, 5]), 10, GAP)).all()


def test_means_are_those_of_each_stamp():
    found = TRACE.mean(np.array([[5, 20], [35, 70]]), 10, GAP)
    assert found == pytest.approx(np.array([[2.0, 2.5], [4.0, np.nan]]), nan_ok=True)


def test_a_slope_is_the_difference_over_the_window_in_seconds():
    """From 1.4 at 2 µs to 2.6 at 8 µs, and so on."""
    found = TRACE.slope(np.array([5, 20, 35, 70, 10]), 6, GAP)
    wanted = np.array([0.2, -0.05, 0.4, np.nan, (2.85 - 2.4) / 6]) * 1e6
    assert found == pytest.approx(wanted, nan_ok=True)


def test_a_trace_without_readings_has_no_value_and_one_reading_is_known_at_its_stamp():
    empty = Trace(np.empty(0, dtype=np.int64), np.empty(0))
    assert np.isnan(empty.at(np.array([1, 2]), GAP)).tolist() == [True, True]
    one = Trace(np.array([7]), np.array([4.0]))
    assert one.at(np.array([6, 7, 8]), GAP) == pytest.approx([np.nan, 4.0, np.nan], nan_ok=True)


def test_of_two_readings_with_one_stamp_the_later_counts():
    found = Trace.from_readings(np.array([1, 1, 2, 5, 5, 5]), np.arange(6.0))
    assert found.t_us.tolist() == [1, 2, 5]
    assert found.value.tolist() == [1.0, 2.0, 5.0]
    assert Trace.from_readings(np.array([3]), np.array([9.0])).value.tolist() == [9.0]
    assert not len(Trace.from_readings(np.empty(0, dtype=np.int64), np.empty(0)).t_us)
