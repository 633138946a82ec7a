"""Burckhardt curve fitted to Gram matrices of the slip basis, and its linearisation.

The cost of a curve is a quadratic form in its coefficients, so that a curve can be fitted again at
any time without the samples.
"""

from dataclasses import dataclass
from math import exp, log
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.curves.gauss_newton import NormalEquations, minimise
from adhesion_can.estimation.doubt.slip_basis import GRID, grid_values, projection
from adhesion_can.estimation.tracker.settings import C1_MAX, C2_RANGE, PriorSettings
from adhesion_can.physics.burckhardt import CurveParameters

STEPS = 12
"""Largest number of steps of the fit."""
LONGEST_STEP = 0.5
"""Largest change of a coordinate in one step."""
LEAST_SHAPE = 1.5
"""Least shape s of a start."""
_CENTRE = np.log(PriorSettings().wide_theta)
_PRECISION = np.array(PriorSettings().wide_std) ** -2.0
"""Prior of (ln c1, ln c2, ln s) with the shape s = ln(c1 c2/c3): the tracker's wide component."""
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
    """Curve that fits best.

    Args:
        gram: Weighted Gram matrix of the slip basis, shape (SIZE, SIZE).
        score: Weighted sums of basis times adhesion, shape (SIZE,).
        start: Parameters (c1, c2, c3) to start with.

    """

    def evaluate(phi: Array) -> NormalEquations:
        c1, c2, c3 = _theta(phi)
        decay = np.exp(-c2 * GRID)
        values = c1 * (1.0 - decay) - c3 * GRID
        by_steepness = c1 * c2 * GRID * decay - c3 * GRID
        by_shape = c3 * log(c1 * c2 / c3) * GRID
        coefficients = projection() @ np.stack([values, values, by_steepness, by_shape]).T
        curve, jacobian = coefficients[:, 0], coefficients[:, 1:]
        # Without the samples' own sum of squares, which is the same for all curves.
        predicted = gram @ curve
        equations = NormalEquations(
            float(curve @ (predicted - 2.0 * score)),
            jacobian.T @ (score - predicted),
            jacobian.T @ gram @ jacobian,
        )
        return equations.with_prior(phi - _CENTRE, _PRECISION)

    c1, c2, c3 = start
    phi, _ = minimise(
        evaluate,
        np.log([c1, c2, max(log(c1 * c2 / c3), LEAST_SHAPE)]),
        (_LOWER, _UPPER),
        steps=STEPS,
        converged=1e-6,
        longest=LONGEST_STEP,
    )
    return PooledCurve(_theta(phi))


def _theta(phi: Array) -> CurveParameters:
    c1, c2, s = np.exp(phi).tolist()
    return c1, c2, c1 * c2 * exp(-s)
