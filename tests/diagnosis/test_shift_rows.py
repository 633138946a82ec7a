"""Rows at another time, with the noise that they have."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adhesion_can.diagnosis.drive.shift_rows import shift_rows

STEP_S = 0.02


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), by_rows=st.floats(-6.0, 6.0))
def test_noise_keeps_its_power_at_any_shift(seed, by_rows):
    noise = np.random.default_rng(seed).standard_normal(4000)
    t_s = np.arange(4000) * STEP_S
    shifted = shift_rows(t_s, noise, by_rows * STEP_S)
    assert shifted[10:-10].var() == pytest.approx(noise.var(), rel=0.02)


@pytest.mark.parametrize("by_s", [-0.05, 0.003, 0.01, 0.04])
def test_a_smooth_signal_is_that_at_the_other_time(by_s):
    t_s = 5.0 + np.arange(2000) * STEP_S
    shifted = shift_rows(t_s, np.sin(4.0 * t_s) + 0.3 * t_s, by_s)
    expected = np.sin(4.0 * (t_s + by_s)) + 0.3 * (t_s + by_s)
    assert np.abs(shifted - expected)[20:-20].max() < 2e-3


def test_whole_rows_are_the_rows_and_beyond_the_ends_is_the_end():
    t_s, values = np.arange(100) * STEP_S, np.random.default_rng(1).standard_normal(100)
    later = shift_rows(t_s, values, 3 * STEP_S)
    np.testing.assert_allclose(later[:-3], values[3:], atol=1e-9)
    np.testing.assert_allclose(later[-3:], values[-1], atol=1e-9)


def test_runs_with_a_gap_between_them_are_shifted_each_by_itself():
    t_s = np.concatenate([np.arange(200), np.arange(200) + 700]) * STEP_S
    values = np.where(np.arange(400) < 200, 1.0, 5.0)
    shifted = shift_rows(t_s, values, 0.5 * STEP_S)
    np.testing.assert_allclose(shifted[:199], 1.0)
    np.testing.assert_allclose(shifted[200:], 5.0)
    assert 1.0 < shifted[199] < 1.01  # on the line between the runs


def test_uneven_rows_are_on_straight_lines():
    rng = np.random.default_rng(2)
    t_s = np.cumsum(rng.uniform(0.01, 0.03, 100))
    values = rng.standard_normal(100)
    shifted = shift_rows(t_s, values, 0.005)
    np.testing.assert_allclose(shifted, np.interp(t_s + 0.005, t_s, values))
