"""Traces read at other stamps, against a loop over the readings."""

import numpy as np
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
