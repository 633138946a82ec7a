"""The pooled curve against a direct fit to the samples."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from adhesion_can.estimation.doubt import slip_basis
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve, fit_curve, linearise
from adhesion_can.physics.burckhardt import peak

CURVES = [(0.41, 33.0, 0.38), (0.23, 156.0, 0.2), (0.5, 22.4, 0.52), (0.22, 49.0, 0.04)]


def curve(theta: tuple[float, ...], slip: np.ndarray) -> np.ndarray:
    c1, c2, c3 = theta
    return np.asarray(-c1 * np.expm1(-c2 * slip) - c3 * slip)


@pytest.mark.parametrize("theta", CURVES)
@pytest.mark.parametrize("seed", range(5))
def test_the_fit_is_that_of_least_squares_on_the_samples(
    theta: tuple[float, float, float], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    slip = rng.uniform(0.0, 0.25, 4000)
    adhesion = curve(theta, slip) + 0.01 * rng.standard_normal(len(slip))
    values, _ = slip_basis.evaluate(slip)
    weight = 1.0 / 0.01**2
    found = fit_curve(weight * values.T @ values, weight * values.T @ adhesion, (0.3, 60.0, 0.3))
    oracle = least_squares(
        lambda x: curve(x, slip) - adhesion, theta, x_scale=theta, bounds=(0.0, np.inf)
    )
    fitted = curve(found.theta, slip)
    # The weak prior of the fit may move it within its standard error.
    assert np.sqrt(np.mean((fitted - curve(oracle.x, slip)) ** 2)) < 2.5 * 0.01 * np.sqrt(3 / 4000)


@pytest.mark.parametrize("theta", CURVES)
def test_its_peak_is_that_of_the_curve(theta: tuple[float, float, float]) -> None:
    top = peak(*theta, 0.5)
    pooled = PooledCurve(theta)
    assert (pooled.mu_max, pooled.lambda_m) == pytest.approx(
        (float(top.mu_max), float(top.lambda_m))
    )


def test_tangents_are_derivatives_of_the_curve() -> None:
    theta = CURVES[0]
    linear = linearise(PooledCurve(theta))
    values = slip_basis.grid_values()
    for k in range(3):
        step = 1e-4 * theta[k]
        moved = tuple(c + step * (j == k) for j, c in enumerate(theta))
        change = (curve(moved, slip_basis.GRID) - curve(theta, slip_basis.GRID)) / step
        assert values @ linear.changes[:, k] == pytest.approx(change, abs=2e-3 * abs(change).max())


def test_bumps_stand_side_by_side_about_the_peak_and_have_its_height() -> None:
    """In ln λ, 0.35 apart and 0.25 wide; eleven of them add up to a constant in their middle."""
    pooled = PooledCurve(CURVES[0])
    shown = slip_basis.grid_values() @ linearise(pooled).changes[:, 3:]
    place = np.log(slip_basis.GRID[1:] / pooled.lambda_m)
    for k in range(11):
        distance = (place - (k - 5) * 0.35) / 0.25
        wanted = pooled.mu_max * np.exp(-0.5 * distance**2)
        assert shown[1:, k] == pytest.approx(wanted, abs=0.05 * pooled.mu_max), k
    middle = np.abs(place) < 1.0
    total = shown[1:].sum(axis=1)[middle] / pooled.mu_max
    assert total == pytest.approx(np.full(middle.sum(), 0.25 / 0.35 * np.sqrt(2 * np.pi)), rel=0.02)
