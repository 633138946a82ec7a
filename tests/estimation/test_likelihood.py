"""Likelihood, Fisher information and standard errors against SciPy and Monte Carlo."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import approx_fprime, curve_fit
from scipy.stats import norm

from adhesion_can.estimation.likelihood import (
    fisher_information,
    innovation,
    log_likelihood,
    sensitivity,
    standard_errors,
    sum_of_squares,
)

FIXED = settings(derandomize=True, deadline=None, max_examples=60)
THETA = st.tuples(st.floats(0.05, 1.2), st.floats(5.0, 150.0), st.floats(1e-3, 0.8))
PAPER = (0.5, 30.0, 0.08)


def model(h, c1, c2, c3):
    return c1 - c1 * np.exp(-c2 * h) - c3 * h


def data(theta, seed, n=40, noise=0.02, top=0.3):
    rng = np.random.default_rng(seed)
    h = rng.uniform(0.0, top, n)
    return h, model(h, *theta) + noise * rng.standard_normal(n)


@FIXED
@given(THETA, THETA, st.integers(0, 10**6))
def test_innovation_and_j_are_eq_8_and_13(true, theta, seed):
    h, z = data(true, seed)
    c1, c2, c3 = theta
    residual = [zk - c1 + c1 * np.exp(-c2 * hk) + c3 * hk for zk, hk in zip(z, h, strict=True)]
    assert innovation(theta, h, z) == pytest.approx(residual, abs=1e-13)
    assert sum_of_squares(theta, h, z) == pytest.approx(sum(e * e for e in residual), rel=1e-10)


@FIXED
@given(THETA, st.integers(0, 10**6), st.floats(1e-3, 0.5))
def test_log_likelihood_is_that_of_the_normal_distribution(theta, seed, sd):
    h, z = data(PAPER, seed)
    wanted = norm.logpdf(z, loc=model(h, *theta), scale=sd).sum()
    assert log_likelihood(theta, h, z, sd) == pytest.approx(wanted, rel=1e-10, abs=1e-8)


def test_likelihood_is_highest_where_j_is_least():
    # The paper prints arg max J in (14).
    h, z = data(PAPER, 4, n=300)
    thetas = np.array(PAPER) * np.random.default_rng(5).uniform(0.5, 1.5, (50, 3))
    j = [sum_of_squares(theta, h, z) for theta in thetas]
    likelihood = [log_likelihood(theta, h, z, 0.02) for theta in thetas]
    assert np.array_equal(np.argsort(j), np.argsort(likelihood)[::-1])


@FIXED
@given(THETA)
def test_sensitivity_is_the_numerical_gradient_of_the_curve(theta):
    h = np.linspace(0.0, 0.3, 9)
    step = 1e-6 * np.array(theta)
    numeric = approx_fprime(np.array(theta), lambda t: model(h, *t), step)
    assert sensitivity(theta, h) == pytest.approx(numeric, rel=2e-4, abs=2e-5)


@FIXED
@given(THETA, st.floats(1e-3, 0.1))
def test_fisher_information_is_the_hessian_of_minus_ln_l_without_noise(theta, sd):
    # E[−∂² ln L/∂θ²]: with z on the curve the second-derivative terms of the model vanish.
    h = np.linspace(0.0, 0.3, 60)
    z = model(h, *theta)
    theta = np.array(theta)
    steps = 1e-4 * theta

    def cost(t):
        return float(np.sum((z - model(h, *t)) ** 2)) / (2 * sd**2)

    hessian = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            corners = [
                s * t * cost(theta + s * steps[i] * np.eye(3)[i] + t * steps[j] * np.eye(3)[j])
                for s in (1, -1)
                for t in (1, -1)
            ]
            hessian[i, j] = sum(corners) / (4 * steps[i] * steps[j])
    information = fisher_information(theta, h, sd)
    scale = np.sqrt(np.outer(np.diag(information), np.diag(information)))
    assert information / scale == pytest.approx(hessian / scale, abs=2e-3)
    assert np.array_equal(information, information.T)


@FIXED
@given(THETA, st.floats(1e-3, 0.1))
def test_covariance_is_the_inverse_of_the_information(theta, sd):
    h = np.linspace(0.0, 0.4, 200)
    errors = standard_errors(theta, h, sd)
    identity = errors.covariance @ fisher_information(theta, h, sd)
    scale = np.array(theta)
    assert identity * np.outer(1 / scale, scale) == pytest.approx(np.eye(3), abs=1e-4)


def test_covariance_goes_with_noise_squared_and_with_one_over_n():
    h = np.linspace(0.0, 0.3, 100)
    one = standard_errors(PAPER, h, 0.01)
    assert standard_errors(PAPER, h, 0.02).covariance == pytest.approx(4 * one.covariance)
    many = standard_errors(PAPER, np.tile(h, 9), 0.01)
    assert many.mu_max == pytest.approx(one.mu_max / 3)
    assert many.lambda_m == pytest.approx(one.lambda_m / 3)


def ramp_bound(reached, sd):
    """Relative Cramér-Rao bounds when a ramp of 500 samples to 0.5 has come to `reached`."""
    slips = np.linspace(0.0, 0.5, 500)
    errors = standard_errors(PAPER, slips[slips <= reached], sd)
    return np.sqrt(np.diag(errors.covariance)) / np.array(PAPER)


def test_bound_of_the_ramp_agrees_with_our_reading_of_the_paper():
    # Experiment 1: λ rises to 0.5 over the run. Sd 0.01 fits its reported convergence, 0.1 not.
    assert ramp_bound(0.1, 0.01)[:2] == pytest.approx(0.07, abs=0.007)
    assert ramp_bound(0.4, 0.01)[2] == pytest.approx(0.094, abs=0.001)
    assert ramp_bound(0.4, 0.1)[2] == pytest.approx(0.94, abs=0.01)
    assert ramp_bound(0.1, 0.01)[2] > 1.0  # c3 needs more slip than c1 and c2


def test_bound_of_500_samples_up_to_the_given_slip():
    errors = [standard_errors(PAPER, np.linspace(0, top, 500), 0.01) for top in (0.1, 0.4)]
    near, far = (np.sqrt(np.diag(e.covariance)) / np.array(PAPER) for e in errors)
    assert (near[:2] <= 0.07).all()
    assert far[2] <= 0.09


@pytest.mark.parametrize(
    "slips",
    [[], [0.1], [0.1, 0.2], [0.05] * 500, [0.0] * 500, [0.02, 0.07] * 250],
    ids=["none", "one", "two", "one slip", "zero slip", "two slips"],
)
def test_slips_that_do_not_determine_three_parameters_have_infinite_errors(slips):
    errors = standard_errors(PAPER, np.array(slips), 0.01)
    assert np.isinf(np.diag(errors.covariance)).all()
    assert errors.mu_max == errors.lambda_m == np.inf


def test_curve_without_an_interior_peak_has_no_error_of_its_place():
    # Ice: no fall at all, which a fit finds at its bound. The height is as known as elsewhere.
    slips = np.linspace(0, 0.4, 200)
    errors = standard_errors((0.05, 306.39, 0.0), slips, 0.01)
    assert errors.lambda_m == np.inf
    nearby = standard_errors((0.05, 306.39, 1e-3), slips, 0.01).covariance
    assert errors.covariance == pytest.approx(nearby, rel=0.01)
    assert np.isfinite(errors.mu_max)


@settings(FIXED, max_examples=300)
@given(THETA, st.floats(1e-6, 0.5), st.floats(0.0, 1.0), st.integers(3, 60), st.floats(0, 0.1))
def test_errors_are_never_nan_for_uninformative_slips(theta, top, low, n, sd):
    errors = standard_errors(theta, np.linspace(low * top, top, n), sd)
    assert errors.mu_max >= 0
    assert errors.lambda_m >= 0


def test_slips_far_below_the_peak_leave_it_all_but_unknown():
    near = standard_errors(PAPER, np.linspace(0, 0.02, 500), 0.01)
    full = standard_errors(PAPER, np.linspace(0, 0.4, 500), 0.01)
    assert near.mu_max > 50 * full.mu_max
    assert near.lambda_m > 50 * full.lambda_m


def spread_of_fits(runs):
    """Sample standard deviations of c1..c3, μ_m, λ_m over least squares fits to new noise."""
    rng = np.random.default_rng(11)
    h = np.linspace(0.0, 0.4, 500)
    clean = model(h, *PAPER)
    fits = []
    for _ in range(runs):
        z = clean + 0.01 * rng.standard_normal(500)
        fits.append(curve_fit(model, h, z, p0=PAPER)[0])
    c1, c2, c3 = np.array(fits).T
    log = np.log(c1 * c2 / c3)
    return np.std([c1, c2, c3, c1 - c3 / c2 * (1 + log), log / c2], axis=1)


@pytest.mark.parametrize(
    ("runs", "share"),  # five standard errors 1/√(2 runs), and the curve's bend
    [(300, 0.21), pytest.param(4000, 0.065, marks=pytest.mark.slow)],
)
def test_standard_errors_are_the_spread_of_least_squares_fits(runs, share):
    errors = standard_errors(PAPER, np.linspace(0.0, 0.4, 500), 0.01)
    stated = [*np.sqrt(np.diag(errors.covariance)), errors.mu_max, errors.lambda_m]
    assert stated == pytest.approx(spread_of_fits(runs), rel=share)
