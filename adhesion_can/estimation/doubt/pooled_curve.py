"""Burckhardt curve fitted to Gram matrices of the slip basis, and its linearisation.

The cost of a curve is a quadratic form in its coefficients, so that a curve can be fitted again at
any time without the samples.
"""

from dataclasses import dataclass
from math import exp, log
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.doubt.slip_basis import GRID, grid_values, projection
from adhesion_can.estimation.tracker.settings import C1_MAX, C2_RANGE
from adhesion_can.physics.burckhardt import CurveParameters

STEPS = 12
"""Largest number of steps of the fit."""
_CENTRE, _STD = np.log([0.35, 45.0, 4.1]), np.array([0.6, 0.7, 0.25])
"""Prior of (ln c1, ln c2, ln s) with the shape s = ln(c1 c2/c3), as the tracker's wide one."""
_LOWER = np.array([-np.inf, log(C2_RANGE[0]), log(1.05)])
_UPPER = np.array([log(C1_MAX), log(C2_RANGE[1]), log(12.0)])
BUMPS = np.arange(-5, 6) * 0.35
"""Places of the bumps of a free shape, ln(λ/λ_m)."""
BUMP_WIDTH = 0.25
"""Standard deviation of a bump, in ln λ: neighbours overlap, and add up to a smooth curve."""


@dataclass(frozen=True, slots=True)
class PooledCurve:
    """Burckhardt curve of all samples of a surface.

    Attributes:
        theta: Parameters (c1, c2, c3).

    """

    theta: CurveParameters

    @property
    def lambda_m(self) -> float:
        """Slip ratio λ_m of the peak."""
        c1, c2, c3 = self.theta
        return log(c1 * c2 / c3) / c2

    @property
    def mu_max(self) -> float:
        """Height μ_max of the peak."""
        c1, c2, c3 = self.theta
        s = log(c1 * c2 / c3)
        return c1 * (1.0 - exp(-s) * (1.0 + s))

    def on_grid(self) -> Array:
        """Adhesion on the slip grid, shape (POINTS,)."""
        c1, c2, c3 = self.theta
        return np.asarray(-c1 * np.expm1(-c2 * GRID) - c3 * GRID)


class Linearisation(NamedTuple):
    """A curve, its tangents and the bumps of a free shape, as coefficients of the slip basis.

    Attributes:
        curve: Coefficients of the curve, shape (SIZE,).
        changes: Coefficients of the tangents along c1, c2 and c3, then of the bumps, (SIZE, k).

    """

    curve: Array
    changes: Array


def linearise(curve: PooledCurve) -> Linearisation:
    """Coefficients of a curve and of small changes of it."""
    c1, c2, _ = curve.theta
    decay = np.exp(-c2 * GRID)
    tangents = np.stack([1.0 - decay, c1 * GRID * decay, -GRID])
    place = np.log(np.maximum(GRID, 1e-9) / curve.lambda_m)
    distance = (place - BUMPS[:, None]) / BUMP_WIDTH
    bumps = curve.mu_max * np.exp(-0.5 * distance * distance)
    changes = projection() @ np.concatenate([tangents, bumps]).T
    return Linearisation(projection() @ curve.on_grid(), changes)


def on_grid(coefficients: Array) -> Array:
    """Values on the slip grid of coefficients of the basis, shape (POINTS,)."""
    return np.asarray(grid_values() @ coefficients)


def fit_curve(gram: Array, score: Array, start: CurveParameters) -> PooledCurve:
    """Curve that fits best, by damped Gauss-Newton steps (Levenberg-Marquardt).

    Args:
        gram: Weighted Gram matrix of the slip basis, shape (SIZE, SIZE).
        score: Weighted sums of basis times adhesion, shape (SIZE,).
        start: Parameters (c1, c2, c3) to start with.

    """
    c1, c2, c3 = start
    phi = np.log([c1, c2, max(log(c1 * c2 / c3), 1.5)])
    damping, precision = 1e-2, _STD**-2.0

    def linear(phi: Array) -> tuple[Array, Array, float]:
        theta = _theta(phi)
        c1, c2, c3 = theta
        decay = np.exp(-c2 * GRID)
        values = c1 * (1.0 - decay) - c3 * GRID
        by_steepness = c1 * c2 * GRID * decay - c3 * GRID
        by_shape = c3 * log(c1 * c2 / c3) * GRID
        coefficients = projection() @ np.stack([values, values, by_steepness, by_shape]).T
        w = coefficients[:, 0]
        away = phi - _CENTRE
        cost = w @ gram @ w - 2.0 * (w @ score) + precision @ (away * away)
        return w, coefficients[:, 1:], float(cost)

    w, jacobian, cost = linear(phi)
    for _ in range(STEPS):
        gradient = jacobian.T @ (score - gram @ w) - precision * (phi - _CENTRE)
        hessian = jacobian.T @ gram @ jacobian + np.diag(precision)
        step = np.linalg.solve(hessian + damping * np.diag(hessian.diagonal()), gradient)
        moved = np.clip(phi + np.clip(step, -0.5, 0.5), _LOWER, _UPPER)
        w_moved, jacobian_moved, cost_moved = linear(moved)
        if cost_moved < cost:
            done = cost - cost_moved < 1e-6 * abs(cost)
            phi, w, jacobian, cost = moved, w_moved, jacobian_moved, cost_moved
            damping *= 0.3
            if done:
                break
        else:
            damping *= 5.0
    return PooledCurve(_theta(phi))


def _theta(phi: Array) -> CurveParameters:
    c1, c2, s = np.exp(phi).tolist()
    return c1, c2, c1 * c2 * exp(-s)
