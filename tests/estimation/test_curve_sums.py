"""Sums of a stretch against dense generalised least squares and direct sums."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from adhesion_can.estimation.tracker.common_errors import common_shift
from adhesion_can.estimation.tracker.curve_sums import (
    Points,
    coefficients,
    costs,
    interpolation,
    residual_at,
    slope_at,
)
from adhesion_can.estimation.tracker.increment import increment
from adhesion_can.estimation.tracker.layout import (
    BINS,
    C2_NODES,
    CORRECTED,
    COUNT,
    DOF,
    HISTOGRAM,
    MEASURED,
    X_NODES,
    X_RANGE,
)
from adhesion_can.estimation.tracker.points import build_points
from adhesion_can.physics.burckhardt import adhesion, adhesion_slope
from adhesion_can.physics.samples import Sample, Samples

FIXED = settings(derandomize=True, deadline=None, max_examples=40)
SEEDS = st.integers(0, 2**32 - 1)
THETAS = st.tuples(st.floats(0.0, 2.0), st.floats(2.0, 500.0), st.floats(0.0, 2.0))
DRY = (0.40, 60.0, 0.30)
SLIP_MAX = 0.5


def model(h, c1, c2, c3):
    """The curve continued below zero slip."""
    return c1 - c1 * np.exp(-c2 * h) - c3 * h


def cost_of(sums, theta):
    theta = np.atleast_2d(np.asarray(theta, dtype=float))
    return costs(sums, interpolation(np.log(theta[:, 1])), coefficients(theta))


def random_points(rng, *, private=0.0, common=0.0, transient=0.0, groups=4):
    """A few groups of 1 to 7 samples; the vehicle speed's error differs from group to group."""
    sizes = rng.integers(1, 8, groups)
    group = np.repeat(np.arange(groups), sizes)
    n = len(group)
    return Points(
        rng.uniform(0.0, 0.3, n),
        rng.uniform(-0.1, 0.6, n),
        np.full(n, float(private**2)),
        ((common * rng.uniform(0.2, 1.0, groups)) ** 2)[group],
        (transient * rng.uniform(0.0, 1.0, n)) ** 2,
        group,
        np.ones(n),
    )


def dense_weights(points, slope, noise_var):
    """Inverse of the covariance of all samples over σ², written out as one matrix."""
    same = points.group[:, None] == points.group[None, :]
    of_one = noise_var + slope**2 * points.private_var + points.transient_var
    shared = np.outer(slope, slope) * points.common_var[:, None] * same
    return np.linalg.inv((np.diag(of_one) + shared) / noise_var)


# --------------------------------------------------------------------- against direct formulas


@FIXED
@given(SEEDS, THETAS, st.integers(1, 40))
def test_exact_slips_give_the_sum_of_squares(seed, theta, n):
    rng = np.random.default_rng(seed)
    zero = np.zeros(n)
    h, z = rng.uniform(0, SLIP_MAX, n), rng.normal(0.2, 0.3, n)
    points = Points(h, z, zero, zero, zero, np.zeros(n, dtype=np.int64), np.ones(n))
    sums = increment(points, slope_at(points, DRY), 1e-4, SLIP_MAX)[CORRECTED]
    direct = np.sum((z - adhesion(h, *theta)) ** 2)
    scale = 1e-9 * np.sum(z * z + theta[0] ** 2 + (theta[2] * h) ** 2)
    assert cost_of(sums, theta)[0] == pytest.approx(direct, rel=1e-8, abs=scale)
    assert sums[COUNT] == sums[DOF] == sums[HISTOGRAM].sum() == n


@FIXED
@given(SEEDS, THETAS, st.sampled_from([1e-6, 1e-4, 1e-2]))
def test_common_errors_give_generalised_least_squares(seed, theta, noise_var):
    rng = np.random.default_rng(seed)
    points = random_points(rng, common=0.02, transient=0.05)
    slope = rng.uniform(-0.5, 25.0, len(points.slip))
    sums = increment(points, slope, noise_var, SLIP_MAX)[CORRECTED]
    w = dense_weights(points, slope, noise_var)
    r = points.adhesion - model(points.slip, *theta)
    whole = np.abs(points.adhesion) + theta[0] + theta[2] * points.slip
    rounding = 1e-9 * float(whole @ np.abs(w) @ whole)
    assert cost_of(sums, theta)[0] == pytest.approx(float(r @ w @ r), rel=1e-7, abs=rounding)
    assert sums[DOF] == pytest.approx(len(r))


@FIXED
@given(SEEDS, THETAS, st.sampled_from([1e-6, 1e-4, 1e-2]))
def test_slips_as_measured_give_generalised_least_squares_with_private_errors_too(
    seed, theta, noise_var
):
    rng = np.random.default_rng(seed)
    points = random_points(rng, private=0.004, common=0.02, transient=0.05)
    slope = rng.uniform(-0.5, 25.0, len(points.slip))
    # Own slopes and bends are for the corrected scores and the weights.
    sums = increment(points, slope, noise_var, SLIP_MAX, slope, np.full(len(slope), 900.0))
    w = dense_weights(points, slope, noise_var)
    r = points.adhesion - model(points.slip, *theta)
    whole = np.abs(points.adhesion) + theta[0] + theta[2] * points.slip
    rounding = 1e-9 * float(whole @ np.abs(w) @ whole)
    measured = cost_of(sums[MEASURED], theta)[0]
    assert measured == pytest.approx(float(r @ w @ r), rel=1e-7, abs=rounding)
    assert sums[MEASURED, DOF] == len(r) > sums[CORRECTED, DOF]
    assert not np.allclose(sums[MEASURED, :COUNT], sums[CORRECTED, :COUNT], rtol=1e-6)


@pytest.mark.parametrize(("c2", "bound"), [(15.0, 0.006), (120.0, 0.010)])
def test_corrected_scores_expect_what_the_true_slips_cost(c2, bound):
    # The same three true slips and adhesions, their slips measured 36 000 times. The correction
    # of the steep curve is 0.4 % short; the standard error of the mean is 0.05 % and 0.09 %.
    rng = np.random.default_rng(3)
    times, n = 36_000, 3
    true = np.array([0.015, 0.03, 0.08])
    z = np.array([0.25, 0.31, 0.38])
    p, q, t = np.full(n, 4e-3**2), 3e-3**2, np.array([0, 0.01, 0.02]) ** 2
    slope, noise_var, theta = np.array([9.0, 4.0, 0.4]), 0.01**2, (0.4, c2, 0.3)
    measured = true + np.sqrt(p) * rng.standard_normal((times, n))

    def sums_of(slips, private):
        k = len(slips)
        columns = np.tile(z, k), private, np.full(k * n, q), np.tile(t, k)
        points = Points(slips.ravel(), *columns, np.repeat(np.arange(k), n), np.ones(k * n))
        return increment(points, np.tile(slope, k), noise_var, SLIP_MAX)[CORRECTED]

    costs = [
        cost_of(sums_of(part, np.tile(p, len(part))), theta)[0] / len(part)
        for part in np.split(measured, 720)
    ]
    one = Points(true, z, p, np.full(n, q), t, np.zeros(n, dtype=np.int64), np.ones(n))
    w = dense_weights(one, slope, noise_var)
    r = z - model(true, *theta)
    exact = float(r @ w @ r)
    assert np.mean(costs) == pytest.approx(exact, rel=bound)
    # Left uncorrected, the mean is beyond the bound: the test can tell.
    residuals = z - model(measured, *theta)
    assert np.mean(np.einsum("ij,jk,ik->i", residuals, w, residuals)) > (1 + bound) * exact


def test_cost_over_degrees_of_freedom_is_the_noise():
    found = sum(noisy_cost(np.random.default_rng(seed)) for seed in range(30))
    assert np.sqrt(found[0] / found[1]) == pytest.approx(0.005, rel=0.05)


def noisy_cost(rng):
    """Cost of the true curve in 50 groups of samples with every kind of error, and its freedom."""
    groups, size, noise = 50, 6, 0.005
    group = np.repeat(np.arange(groups), size)
    true = rng.uniform(0.0, 0.08, group.size)
    p, q, t = 0.0015**2, 0.001**2, 0.01**2
    z = model(true, *DRY) + noise * rng.standard_normal(group.size)
    z += np.sqrt(t) * rng.standard_normal(group.size)
    h = true + np.sqrt(p) * rng.standard_normal(group.size)
    h += (np.sqrt(q) * rng.standard_normal(groups))[group]
    full = np.ones(group.size)
    points = Points(h, z, p * full, q * full, t * full, group, full)
    slope = adhesion_slope(true, *DRY)
    sums = increment(points, slope, noise**2, SLIP_MAX)[CORRECTED]
    return np.array([cost_of(sums, DRY)[0], sums[DOF]])


# --------------------------------------------------------------------------- what sums must do


@FIXED
@given(SEEDS, st.integers(1, 3), st.sampled_from([(0, 0, 0), (2e-3, 5e-3, 0.01), (0, 5e-3, 0)]))
def test_sums_add(seed, cut, errors):
    rng = np.random.default_rng(seed)
    points = random_points(rng, private=errors[0], common=errors[1], transient=errors[2])
    slope = rng.uniform(-0.5, 25.0, len(points.slip))
    first = points.group < cut
    parts = [
        increment(points.select(rows), slope[rows], 1e-4, SLIP_MAX)[CORRECTED]
        for rows in (first, ~first)
    ]
    whole = increment(points, slope, 1e-4, SLIP_MAX)[CORRECTED]
    np.testing.assert_allclose(parts[0] + parts[1], whole, rtol=1e-9, atol=1e-9)


def test_interpolation_has_nine_digits_over_the_whole_range_of_steepness():
    x = np.linspace(*X_RANGE, 501)
    at_x = interpolation(x)
    for h in (0.0, 1e-4, 0.003, 0.02, 0.1, 0.5):
        for power in (1, 2):
            told = at_x @ (-np.expm1(-C2_NODES * h)) ** power
            assert np.abs(told - (-np.expm1(-np.exp(x) * h)) ** power).max() < 1e-9


def test_interpolation_is_exact_at_the_nodes_and_ends_with_its_range():
    np.testing.assert_allclose(interpolation(X_NODES), np.eye(len(X_NODES)), atol=1e-12)
    beyond = interpolation([X_RANGE[0] - 1, X_RANGE[1] + 1])
    np.testing.assert_allclose(beyond, interpolation(list(X_RANGE)), atol=1e-12)


def test_interpolation_bears_slips_that_noise_took_below_zero():
    # 4 standard deviations of 0.5 % slip: the steepest nodes grow as e^(2 · 500 · 0.02).
    x = np.linspace(*X_RANGE, 101)
    for h in (-0.002, -0.005):
        told = interpolation(x) @ (-np.expm1(-C2_NODES * h)) ** 2
        exact = np.expm1(-np.exp(x) * h) ** 2
        assert np.abs(told - exact).max() < 1e-8 * exact.max()


def test_histogram_counts_by_slip_and_keeps_what_lies_outside_in_its_end_bins():
    h = np.array([-0.01, 0.0, 0.25, 0.4999, 0.5, 0.9])
    zero = np.zeros(len(h))
    points = Points(h, zero, zero, zero, zero, np.zeros(len(h), dtype=np.int64), np.ones(len(h)))
    counts = increment(points, zero, 1.0, SLIP_MAX)[CORRECTED][HISTOGRAM]
    assert counts[0] == 2
    assert counts[BINS // 2] == 1
    assert counts[-1] == 3


def test_histogram_counts_the_slip_that_is_sure():
    h = np.array([0.1, 0.1, 0.1, 0.1])
    zero = np.zeros(4)
    p, q = np.array([0, 0.01, 0, 0.003]) ** 2, np.array([0, 0, 0.01, 0.004]) ** 2
    points = Points(h, zero, p, q, zero, np.arange(4), np.ones(4))
    counts = increment(points, zero, 1.0, SLIP_MAX)[CORRECTED][HISTOGRAM]
    expected = np.bincount((np.array([0.1, 0.06, 0.06, 0.08]) * BINS / SLIP_MAX).astype(int))
    assert counts[: len(expected)].tolist() == expected.tolist()
    assert counts.sum() == 4


@pytest.mark.parametrize("size", [0.003, 0.01, 0.03])
@pytest.mark.parametrize("error", ["slip_var", "slip_common_var"])
def test_slips_of_noise_alone_reach_nothing(error, size):
    # Beyond 4 standard deviations lie 6 in 100 000, on both sides together.
    beyond, n = 0, 10_000
    for seed in range(20):
        rng = np.random.default_rng(seed)
        samples = Samples.curve(size * rng.standard_normal(n), 0.003 * rng.standard_normal(n))
        stated = {error: np.full(n, size**2), "speed_us": np.zeros(n, dtype=np.int64)}
        points = build_points(replace(samples, **stated))
        beyond += increment(points, np.zeros(n), 1.0, SLIP_MAX)[CORRECTED][HISTOGRAM][1:].sum()
    assert beyond <= 1e-4 * 20 * n


# ------------------------------------------------------------------ the vehicle speed's error


def test_common_shift_minimises_its_cost():
    rng = np.random.default_rng(7)
    for _ in range(20):
        points = random_points(rng, private=1e-3, common=0.01, transient=0.01, groups=1)
        points = points._replace(adhesion=model(points.slip - 0.004, *DRY))
        moved = common_shift(points, DRY, 1e-5)
        a = slope_at(moved, DRY)
        var = 1e-5 + a * a * points.private_var + points.transient_var

        def objective(e, points=points, var=var):
            r = residual_at(points._replace(slip=points.slip - e), DRY)
            return float(np.sum(r * r / var) + e * e / points.common_var[0])

        best = minimize_scalar(objective, bounds=(-0.02, 0.02), method="bounded")
        shift = points.slip - moved.slip
        assert np.ptp(shift) < 1e-15
        # Two Gauss-Newton steps: near the best, never farther from it than no shift at all.
        assert objective(shift[0]) <= best.fun + 0.05 * (objective(0.0) - best.fun) + 1e-6


def test_common_shift_leaves_exact_slips_and_is_bounded():
    rng = np.random.default_rng(1)
    points = random_points(rng)
    np.testing.assert_allclose(common_shift(points, DRY, 1e-4).slip, points.slip, atol=1e-12)
    far = random_points(rng, common=0.01)._replace(adhesion=np.full(0, 0.0))
    far = far._replace(adhesion=np.full(len(far.slip), 50.0))
    shift = np.abs(common_shift(far, DRY, 1e-8).slip - far.slip)
    assert (shift <= 3 * np.sqrt(far.common_var) * (1 + 1e-9)).all()


# ---------------------------------------------------------------------------- samples to points


def sample(slip, adhesion_, **more):
    return Sample(
        t_us=0, axle=1, slip=slip, adhesion=adhesion_, creep_speed=0, speed=3, load=1, **more
    )


def test_a_slip_larger_than_its_error_brings_its_own_sign():
    exact = Samples.from_rows([sample(-0.02, -0.3), sample(0.03, 0.3), sample(-0.01, 0.1)])
    points = build_points(exact)
    np.testing.assert_array_equal(points.slip, [0.02, 0.03, 0.01])
    np.testing.assert_array_equal(points.adhesion, [0.3, 0.3, -0.1])
    assert points.exact


def test_a_slip_within_its_error_takes_the_sign_of_the_mean_adhesion():
    noisy = {"slip_common_var": 0.005**2, "speed_us": 1}
    traction = Samples.from_rows([sample(-0.004, 0.1, **noisy), sample(0.05, 0.3, **noisy)])
    points = build_points(traction)
    np.testing.assert_array_equal(points.slip, [-0.004, 0.05])
    np.testing.assert_array_equal(points.adhesion, [0.1, 0.3])
    np.testing.assert_array_equal(
        build_points(traction, errors_in_variables=False).slip, [0.004, 0.05]
    )
    braking = Samples.from_rows([sample(0.004, -0.1, **noisy), sample(-0.05, -0.3, **noisy)])
    np.testing.assert_array_equal(build_points(braking).slip, [-0.004, 0.05])


def test_samples_between_two_vehicle_speeds_are_one_group():
    stamps = [1, 1, 2, 2, 2]
    slips = [0.05, 0.06, 0.05, -0.05, 0.05]
    rows = [
        sample(s, s, slip_common_var=1e-6, speed_us=t) for s, t in zip(slips, stamps, strict=True)
    ]
    np.testing.assert_array_equal(build_points(Samples.from_rows(rows)).group, [0, 0, 1, 1, 1])
