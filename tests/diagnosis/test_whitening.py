"""Whitening against Yule-Walker by hand, and against what white means."""

import numpy as np
import pytest
from scipy.signal import lfilter

from adhesion_can.diagnosis.regression import whitening
from adhesion_can.diagnosis.regression.whitening import (
    ContiguousRuns,
    Whitener,
    compute_autocovariance,
    compute_weights,
    fit_whitener,
)


def build_runs(lengths):
    starts = np.cumsum([0, *lengths])[:-1]
    return ContiguousRuns(starts.astype(np.int64), int(sum(lengths)))


def process(rng, lengths, ar, ma=(1.0,)):
    """A fresh piece of a stationary ARMA process for each stretch."""
    parts = [lfilter(ma, ar, rng.standard_normal(length + 2000))[2000:] for length in lengths]
    return np.concatenate(parts)


def largest_correlation(x, runs, lags):
    """Largest autocorrelation of x up to some lags within its runs, without its sign."""
    ends = np.append(runs.starts[1:], runs.rows)
    found = []
    for lag in range(1, lags + 1):
        bounds = zip(runs.starts, ends, strict=True)
        every = np.concatenate([x[a : b - lag] * x[a + lag : b] for a, b in bounds])
        found.append(abs(every.mean()) / np.mean(x**2))
    return max(found)


ORDERS = {
    "white": ([1.0], [1.0]),
    "AR(1)": ([1.0, -0.9], [1.0]),
    "AR(2) that swings": ([1.0, -1.6, 0.8], [1.0]),
    "ARMA(1,1)": ([1.0, -0.95], [1.0, 0.5]),
    "MA(2)": ([1.0], [1.0, 0.8, 0.4]),
}


@pytest.mark.parametrize("kind", ORDERS)
def test_what_remains_is_white(kind, monkeypatch):
    monkeypatch.setattr(whitening, "NUGGET", 0.0)
    rng = np.random.default_rng(3)
    lengths = [2500, 1200, 4000, 2300]
    found = build_runs(lengths)
    x = process(rng, lengths, *ORDERS[kind])
    whitener = fit_whitener(x, found)
    left = whitener(x[:, None])[:, 0]
    kept = np.setdiff1d(np.arange(len(x)), whitener.rows_without_past)
    # Its standard error is 0.01; a few hundredths are left where the order is finite and the
    # process's is not (60 seeds: 0.052 at most).
    assert largest_correlation(left, found, 30) < 0.1
    if kind != "white":
        assert largest_correlation(x, found, 30) > 0.4
        # The innovations have variance 1.
        # 10 000 of them: six standard errors.
        assert left[kept].var() == pytest.approx(1.0, rel=0.085)


def test_with_the_nugget_it_whitens_the_noise_plus_the_nugget():
    """The nugget is white noise on top: x + e, with var e = NUGGET var x, must come out white."""
    rng = np.random.default_rng(4)
    lengths = [20_000]
    found = build_runs(lengths)
    x = process(rng, lengths, [1.0, -0.97])
    whitener = fit_whitener(x, found)
    assert whitener.order > 0
    x = process(rng, lengths, [1.0, -0.97])
    x = x + np.sqrt(whitening.NUGGET * x.var()) * rng.standard_normal(len(x))
    left = whitener(x[:, None])[:, 0]
    # 30 seeds: 0.036 at most, and 0.47 at least for a filter of x alone.
    assert largest_correlation(left, found, 12) < 0.1


def test_taps_solve_yule_walker():
    rng = np.random.default_rng(5)
    lengths = [900, 3000]
    found = build_runs(lengths)
    x = process(rng, lengths, [1.0, -0.8])
    taps = fit_whitener(x, found).taps
    order = len(taps) - 1
    # Written out: a biased autocovariance of pairs that lie in one stretch.
    gamma = [
        sum(x[a : b - k] @ x[a + k : b] for a, b in ((0, 900), (900, 3900))) / len(x)
        for k in range(order + 1)
    ]
    matrix = np.array([[gamma[abs(i - j)] for j in range(order)] for i in range(order)])
    matrix += whitening.NUGGET * gamma[0] * np.eye(order)
    assert taps[0] == 1.0
    assert -taps[1:] == pytest.approx(np.linalg.solve(matrix, gamma[1:]), rel=1e-8)
    assert compute_autocovariance(x, found, order) == pytest.approx(gamma, rel=1e-9, abs=1e-12)


def test_runs_are_not_mixed():
    rng = np.random.default_rng(6)
    found = build_runs([50, 3, 70])
    whitener = Whitener(np.array([1.0, -0.5, 0.2, 0.1, 0.3]), found)
    x = rng.standard_normal((123, 2))
    whole = whitener(x)
    for a, b in ((0, 50), (50, 53), (53, 123)):
        by_hand = np.zeros((b - a, 2))
        for n in range(4, b - a):
            by_hand[n] = sum(whitener.taps[k] * x[a + n - k] for k in range(5))
        assert whole[a:b] == pytest.approx(by_hand, abs=1e-12)
    # What stands in another stretch changes nothing here.
    x[:53] += 1e6
    assert whitener(x)[53:] == pytest.approx(whole[53:], abs=1e-12)


def test_a_jump_between_runs_is_no_correlation():
    """Two white runs of very different level of scatter: nothing to whiten across the cut."""
    rng, orders = np.random.default_rng(7), []
    for _ in range(20):
        x = np.concatenate([rng.standard_normal(2000), 3 * rng.standard_normal(2000)])
        orders.append(fit_whitener(x, build_runs([2000, 2000])).order)
    # BIC finds an order in white noise in one of some 200; four of twenty, never.
    assert orders.count(0) >= 17


def test_rows_without_a_residual_do_not_count():
    """Zeros mark rows that take no part: the filter is that of the others."""
    rng = np.random.default_rng(8)
    lengths = [6000]
    x = process(rng, lengths, [1.0, -0.8])
    used = x.copy()
    used[2000:4000] = 0.0
    whole, part = (fit_whitener(v, build_runs(lengths)).taps for v in (x, used))
    assert part[1] == pytest.approx(whole[1], abs=0.1)


def test_runs_begin_at_axles_gaps_breaks_and_steps_back():
    t = np.array([0.0, 0.1, 0.2, 0.9, 1.0, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1])
    axle = np.array([1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2])
    breaks = np.zeros(12, dtype=bool)
    breaks[10] = True
    found = ContiguousRuns.find(t, axle, breaks)
    # 0: begin; 3: a gap of 7 cycles; 5: time steps back; 7: the next axle; 10: a break.
    assert found.starts.tolist() == [0, 3, 5, 7, 10]
    assert found.rows == 12


@pytest.mark.parametrize("rows", [0, 1, 2, 5, 19])
def test_few_rows_are_left_as_they_are(rows):
    t = np.arange(rows) * 0.1
    found = ContiguousRuns.find(t, np.ones(rows), np.zeros(rows, dtype=bool))
    x = np.arange(rows, dtype=float)
    whitener = fit_whitener(x, found)
    assert whitener.order == 0
    assert whitener(x[:, None]).shape == (rows, 1)


@pytest.mark.parametrize(("rows", "order"), [(19, 0), (20, 1)])
def test_twenty_rows_are_enough_for_one_coefficient(rows, order):
    swing = np.where(np.arange(rows) % 2, -1.0, 1.0)
    assert fit_whitener(swing, build_runs([rows])).order == order


# ------------------------------------------------------------------------------- row weights


@pytest.mark.parametrize(("base", "growth"), [(1.0, 3.0), (2.0, 0.0), (1.0, 20.0)])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
def test_weights_are_reciprocal_standard_deviations(base, growth, unit):
    """Variances grow with the share of the slip's noise; rows that take no part count nothing."""
    rng, n = np.random.default_rng(9), 20_000
    share, used = rng.uniform(size=n), np.arange(n) % 4 > 0
    var = unit * (base + growth * share)
    square = np.where(used, var, 900.0 * unit) * rng.standard_normal(n) ** 2
    # A group of 750 rows knows its variance to 5 %.
    assert compute_weights(square, share, used) == pytest.approx(1.0 / np.sqrt(var), rel=0.15)


def test_rows_whose_variance_falls_with_the_share_have_one_weight():
    rng, n = np.random.default_rng(10), 4000
    share, used = rng.uniform(size=n), np.ones(n, dtype=bool)
    weight = compute_weights((2.0 - share) * rng.standard_normal(n) ** 2, share, used)
    assert np.ptp(weight) < 1e-9 * weight[0]
    assert weight[0] == pytest.approx(1.0 / np.sqrt(1.5), rel=0.15)


@pytest.mark.parametrize(("rows", "alike"), [(199, True), (200, False)])
def test_few_rows_have_the_weight_1(rows, alike):
    square = np.full(rows, 4.0)
    weight = compute_weights(square, np.linspace(0.0, 1.0, rows), np.ones(rows, dtype=bool))
    assert weight == pytest.approx(np.full(rows, 1.0 if alike else 0.5))
