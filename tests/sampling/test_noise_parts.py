"""Parts of the estimate of noise: too little data, the begin of motion, how long errors last."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls
from scipy.signal import lfilter

from adhesion_can.sampling.noise import (
    STRIDES,
    NoiseEstimate,
    _duration,
    _fit_parts,
    _lags,
    _without_motion,
    estimate_signal,
    pool,
)
from adhesion_can.sampling.traces import Trace


def noisy(n, std=0.02, seed=1, cycle_us=20_000):
    value = 10.0 + std * np.random.default_rng(seed).standard_normal(n)
    return Trace(np.arange(n) * cycle_us, value)


def test_sixty_readings_that_are_available_are_enough_to_say_something():
    trace = noisy(80)
    known = Trace(trace.t_us, np.where(np.arange(80) < 20, np.nan, trace.value))
    assert estimate_signal(known).reason != "too few readings"
    one_less = Trace(trace.t_us, np.where(np.arange(80) < 21, np.nan, trace.value))
    assert estimate_signal(one_less).reason == "too few readings"


def test_a_signal_that_moves_for_a_while_and_stands_still_otherwise_says_nothing():
    value = np.where(np.arange(4000) < 500, noisy(4000).value, 0.0)
    found = estimate_signal(Trace(np.arange(4000) * 20_000, value))
    assert found.std is None
    assert "stands still for most" in found.reason


def test_the_standard_error_is_that_of_the_scatter_from_recording_to_recording():
    found = [estimate_signal(noisy(2000, seed=seed)) for seed in range(60)]
    stds = np.array([one.std for one in found])
    assert stds.mean() == pytest.approx(0.02, rel=0.05)
    assert np.mean([one.std_error for one in found]) == pytest.approx(stds.std(), rel=0.5)
    assert {one.lasts_s for one in found} == {0.0}


def test_the_stamps_count_from_any_time():
    trace = noisy(1000)
    later = Trace(trace.t_us + 1_790_000_000_000_000, trace.value)
    assert estimate_signal(later) == estimate_signal(trace)


@pytest.mark.parametrize(
    ("variances", "count"),
    [
        ([1.0, 1.1, 0.9, 1.0, 1.05], 5),  # white noise
        ([1.0, 2.0, 4.0, 7.9, 15.0], 5),  # errors that last for longer than is seen
        ([1.0, 1.9, 3.4, 4.2, 4.3], 5),  # errors that last for some strides
        ([1.0, 1.0, 1.1, 3.0, 70.0], 2),  # motion, some of it already in the stride before
        ([1.0, 40.0, 2000.0], 1),
        ([1.0, 1.0, 1.0, 1.6, 2.5], 3),  # growth without an end after it stood still
        ([1.0, 1.5, 1.5, 2.2, 3.3], 3),
    ],
)
def test_motion_begins_where_variances_grow_faster_than_errors_can_make_them(variances, count):
    assert _without_motion(np.array(variances)) == count


def lasting_shape(strides, cycle_s, lasts_s):
    """Variances of third differences of an AR(1) process: Σ ± C(3, j) C(3, k) ρ^|j − k| / 20."""
    rho = np.exp(-strides * cycle_s / lasts_s)
    weights = np.array([1.0, -3.0, 3.0, -1.0])
    lags = np.abs(np.arange(4)[:, None] - np.arange(4))
    return np.array([weights @ one**lags @ weights for one in rho]) / 20.0


def test_variances_of_a_process_that_lasts_are_those_of_third_differences():
    """Second ones would be larger by a tenth; the scatter of ten recordings is 1 %."""
    rho = np.exp(-0.02 / 0.3)
    noise = np.random.default_rng(11).standard_normal((10, 40_000)) * np.sqrt(1.0 - rho**2)
    value = lfilter([1.0], [1.0, -rho], noise, axis=1)
    t_s = np.tile(np.arange(40_000) * 0.02, (10, 1))
    strides, found = _lags(t_s, value, 0.02)
    wanted = lasting_shape(strides[:2], 0.02, 0.3)
    assert strides[:2].tolist() == [1.0, 2.0]
    assert found[:2] == pytest.approx(wanted, rel=0.05)


@pytest.mark.parametrize(("white", "lasting"), [(4.0, 9.0), (0.0, 2.0), (3.0, 0.0)])
def test_both_parts_of_a_variance_are_found_where_they_are_exact(white, lasting):
    shape = lasting_shape(np.array(STRIDES, dtype=float), 0.02, 0.3)
    cost, total = _fit_parts(shape, white + lasting * shape)
    assert total == pytest.approx(white + lasting)
    assert cost == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("white", "lasting"), [(5.0, -2.0), (-0.05, 3.0)])
def test_no_part_is_below_0(white, lasting):
    """Then the other one alone fits best: relative least squares by hand."""
    shape = lasting_shape(np.array(STRIDES, dtype=float), 0.02, 0.3)
    var = white + lasting * shape
    assert var.min() > 0.0
    cost, total = _fit_parts(shape, var)
    column = (np.ones_like(var) if lasting < 0.0 else shape) / var
    size = column.sum() / (column @ column)
    assert total == pytest.approx(size)
    assert cost == pytest.approx(np.sum((1.0 - size * column) ** 2))


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_the_parts_are_those_of_nonnegative_least_squares_in_any_unit(unit):
    shape, rng = lasting_shape(np.array(STRIDES, dtype=float), 0.02, 0.3), np.random.default_rng(3)
    for _ in range(60):
        white, lasting = rng.uniform(-0.3, 1.0, 2)
        var = unit * np.maximum(white + lasting * shape, 0.05) * rng.uniform(0.7, 1.4, len(shape))
        cost, total = _fit_parts(shape, var)
        columns = np.column_stack([1.0 / var, shape / var])
        parts, left = nnls(columns * unit, np.ones(len(var)))
        assert total == pytest.approx(unit * parts.sum())
        assert cost == pytest.approx(left**2)


@pytest.mark.parametrize("lasts_s", [0.1, 0.3])
def test_the_duration_of_exact_variances_is_their_own(lasts_s):
    strides = np.array(STRIDES, dtype=float)
    var = 1.0 + 4.0 * lasting_shape(strides, 0.02, lasts_s)
    total, found_s, seen_s = _duration(strides, var, 0.02)
    assert found_s == pytest.approx(lasts_s, rel=0.3)
    assert total == pytest.approx(5.0, rel=0.15)
    assert seen_s == pytest.approx(64 * 0.02)


def test_white_noise_does_not_last_and_what_outlasts_the_recording_is_a_bound():
    strides = np.array(STRIDES, dtype=float)
    assert _duration(strides, np.full(7, 2.0), 0.02) == (2.0, 0.0, pytest.approx(1.28))
    var = 4.0 * lasting_shape(strides, 0.02, 60.0)
    total, found_s, seen_s = _duration(strides, var, 0.02)
    assert (total, found_s) == (pytest.approx(var[-1]), seen_s)
    few = _duration(strides[:2], np.array([1.0, 1.1]), 0.02)
    assert few == (1.0, None, pytest.approx(0.04))


def test_sensors_of_a_kind_have_the_median_of_their_variances():
    parts = [
        NoiseEstimate(0.03, 0.003, 0.2, 1.0),
        NoiseEstimate(0.04, 0.004, 0.0, 2.0),
        NoiseEstimate(reason="the signal is constant"),
        NoiseEstimate(0.07, 0.012, None, 0.5, "the resolution of the signal hides it"),
        NoiseEstimate(0.05, 0.0, 0.4, 3.0),
    ]
    found = pool(parts)
    assert found.std == pytest.approx(((0.04**2 + 0.05**2) / 2) ** 0.5)
    assert found.std_error == pytest.approx(0.013 / 4)
    assert (found.lasts_s, found.seen_s) == (0.2, 0.5)
    assert found.reason == "the resolution of the signal hides it"
    # Where half of them do not know how long errors last, nobody does.
    unsure = [replace(parts[0], lasts_s=None), *parts[1:4]]
    assert pool(unsure).lasts_s is None
    assert pool(unsure[:2]).lasts_s is None
    assert pool([parts[2]]) == parts[2]
    assert pool([]).reason == "no readings"
    assert pool([parts[2]]).to_dict()["std_error"] is None
    assert pool(parts[:1]).to_dict() == {
        "std": 0.03, "std_error": 0.003, "lasts_s": 0.2, "seen_s": 1.0, "reason": None,
    }  # fmt: skip
