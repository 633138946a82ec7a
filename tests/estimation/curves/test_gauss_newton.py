"""Damped Gauss-Newton steps within bounds, against SciPy's trust region."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from adhesion_can.estimation.curves.gauss_newton import minimise, normal_equations

X = np.linspace(0.0, 3.0, 40)
TRUE = np.array([1.0, 0.8, 0.3])


def curve(p):
    return p[0] * np.exp(-p[1] * X) + p[2] * X


def gradient(p):
    decay = np.exp(-p[1] * X)
    return np.stack([decay, -p[0] * X * decay, X])


def fitted(observed, weight, start, bounds, **how):
    values, best = minimise(
        lambda p: normal_equations(observed - curve(p), gradient(p), weight),
        start,
        bounds,
        **{"steps": 200, "converged": 1e-13, **how},
    )
    return values, best.cost


@settings(max_examples=60, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), bounded=st.lists(st.booleans(), min_size=3, max_size=3))
def test_the_minimum_is_that_of_a_trust_region(seed, bounded):
    rng = np.random.default_rng(seed)
    weight = rng.uniform(0.5, 4.0, len(X))
    observed = curve(TRUE) + 0.02 * rng.standard_normal(len(X))
    # Bounds that leave the truth out, for some parameters.
    lower = np.where(bounded, TRUE + 0.05, 0.05)
    upper = np.full(3, 3.0)
    # Near the truth, where there is one minimum.
    start = np.clip(TRUE * rng.uniform(0.7, 1.3, 3), lower, upper)
    values, cost = fitted(observed, weight, start, (lower, upper))
    oracle = least_squares(
        lambda p: np.sqrt(weight) * (curve(p) - observed),
        np.clip(start, lower + 1e-6, upper - 1e-6),
        bounds=(lower, upper),
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    assert cost == pytest.approx(weight @ (observed - curve(values)) ** 2)
    assert cost <= 2.0 * oracle.cost * (1.0 + 1e-6)
    assert ((values >= lower) & (values <= upper)).all()


def test_a_start_beyond_the_bounds_is_moved_to_them():
    bounds = np.array([0.5, 0.5, 0.0]), np.array([0.9, 2.0, 1.0])
    values, _ = fitted(curve(TRUE), np.ones(len(X)), np.array([7.0, -3.0, 0.5]), bounds)
    assert values[0] == 0.9  # the bound next to the truth


def test_a_parameter_without_influence_stays():
    def equations(p):
        return normal_equations(p[0] - X, np.stack([-np.ones(len(X)), np.zeros(len(X))]), X + 1.0)

    bounds = np.full(2, -9.0), np.full(2, 9.0)
    values, _ = minimise(equations, np.array([0.0, 4.0]), bounds, steps=50, converged=1e-12)
    assert values[1] == 4.0
    assert values[0] == pytest.approx(np.average(X, weights=X + 1.0))


def test_parameters_that_do_the_same_share_the_work():
    def equations(p):
        rows = np.stack([X, X])
        return normal_equations(X - (p[0] + p[1]) * X, rows, np.ones(len(X)))

    bounds = np.full(2, -9.0), np.full(2, 9.0)
    values, best = minimise(equations, np.array([5.0, 2.0]), bounds, steps=100, converged=0.0)
    assert values.sum() == pytest.approx(1.0)
    assert best.cost < 1e-12


def test_a_start_without_a_cost_is_an_error():
    def equations(p):
        return normal_equations(np.log(p[:1]), np.ones((1, 1)), np.ones(1))

    with np.errstate(invalid="ignore"), pytest.raises(ValueError, match="the cost at the start"):
        minimise(equations, np.array([-1.0]), (np.full(1, -2.0), np.ones(1)), steps=3, converged=0)


def test_data_without_noise_end_at_the_truth():
    bounds = np.zeros(3), np.full(3, 5.0)
    values, cost = fitted(curve(TRUE), np.ones(len(X)), np.array([3.0, 3.0, 3.0]), bounds)
    assert values == pytest.approx(TRUE, rel=1e-6)
    assert cost < 1e-12


def test_no_step_is_taken_at_the_minimum_and_none_beyond_the_last():
    bounds = np.zeros(3), np.full(3, 5.0)
    seen = []

    def equations(p):
        seen.append(p)
        return normal_equations(curve(TRUE) - curve(p), gradient(p), np.ones(len(X)))

    values, _ = minimise(equations, TRUE, bounds, steps=50, converged=1e-9)
    assert values.tolist() == TRUE.tolist()
    assert len(seen) <= 2
    seen.clear()
    minimise(equations, np.full(3, 2.0), bounds, steps=3, converged=0.0)
    assert len(seen) == 4


FREE = np.full(3, -np.inf), np.full(3, np.inf)


@settings(max_examples=30, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1))
def test_a_linear_problem_with_a_normal_prior_has_its_posterior(seed):
    """The mean and precision of Bayesian linear regression, in closed form, and its cost."""
    rng = np.random.default_rng(seed)
    rows, observed = rng.standard_normal((3, 12)), rng.standard_normal(12)
    weight = rng.uniform(0.5, 4.0, 12)
    centre, std = rng.standard_normal(3), rng.uniform(0.1, 3.0, 3)

    def equations(p):
        plain = normal_equations(observed - p @ rows, rows, weight)
        return plain.with_prior(p - centre, std**-2.0)

    values, best = minimise(equations, np.full(3, 5.0), FREE, steps=100, converged=0.0)
    precision = (rows * weight) @ rows.T + np.diag(std**-2.0)
    mean = np.linalg.solve(precision, (rows * weight) @ observed + centre / std**2)
    assert values == pytest.approx(mean, abs=1e-6)
    np.testing.assert_allclose(best.gram, precision)
    assert best.score == pytest.approx(np.zeros(3), abs=1e-5)
    left, away = observed - mean @ rows, (mean - centre) / std
    assert best.cost == pytest.approx(weight @ left**2 + away @ away)


def test_a_prior_alone_is_its_own_posterior():
    def equations(p):
        nothing = normal_equations(np.zeros(1), np.zeros((3, 1)), np.zeros(1))
        return nothing.with_prior(p - TRUE, np.array([1.0, 4.0, 0.25]))

    values, best = minimise(equations, np.zeros(3), FREE, steps=50, converged=0.0)
    assert values == pytest.approx(TRUE)
    assert best.cost == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("longest", [0.05, 0.3])
def test_no_parameter_moves_by_more_than_the_longest_step(longest):
    """From far away each step is as long as it may be, and the minimum is the same."""
    far, target = np.array([3.0, -2.0, 0.5]), np.array([0.0, 0.0, 0.45])
    seen = []

    def equations(p):
        seen.append(p)
        return normal_equations(target - p, np.eye(3), np.ones(3))

    values, _ = minimise(equations, far, FREE, steps=200, converged=0.0, longest=longest)
    assert values == pytest.approx(target, abs=1e-6)
    steps = np.abs(np.diff(seen, axis=0))
    assert steps.max() <= longest + 1e-12
    assert steps[0, :2] == pytest.approx(longest)
    # A short way of another parameter is not shortened with them.
    assert steps[0, 2] == pytest.approx(0.05 / 1.01 if longest > 0.05 else 0.05, rel=0.02)
    assert len(seen) >= 3.0 / longest


def test_a_cost_below_zero_converges_too():
    """A sum of squares without its constant part; the share is that of its size."""

    def equations(p):
        return normal_equations(curve(TRUE) - curve(p), gradient(p), np.ones(len(X)))

    def lowered(p):
        seen.append(p)
        return equations(p)._replace(cost=equations(p).cost - 1e3)

    seen = []
    bounds = np.zeros(3), np.full(3, 5.0)
    minimise(lowered, np.full(3, 2.0), bounds, steps=50, converged=1e-6)
    assert equations(seen[-1]).cost < 1e-3
    assert len(seen) < 15


def test_less_damping_takes_the_first_step_further():
    def equations(p):
        return normal_equations(1.0 - p, np.ones((1, 1)), np.ones(1))

    for damping in (0.1, 1e-3):
        values, _ = minimise(
            equations,
            np.zeros(1),
            (np.full(1, -9.0), np.full(1, 9.0)),
            steps=1,
            converged=0.0,
            damping=damping,
        )
        assert values[0] == pytest.approx(1.0 / (1.0 + damping))
