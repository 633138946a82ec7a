"""Nonlinear least squares within bounds, by damped Gauss-Newton steps (Levenberg and Marquardt).

K. Levenberg, Quarterly of Applied Mathematics 2 (1944) 164; D. W. Marquardt, Journal of the Society
for Industrial and Applied Mathematics 11 (1963) 431. A parameter at a bound that the cost presses
it against does not take part in a step; the others move within their bounds.
"""

from collections.abc import Callable
from math import inf
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array

FIRST_DAMPING, LEAST_DAMPING, LARGEST_DAMPING = 1e-2, 1e-12, 1e10
"""Damping of the first step, the least one, with which collinear parameters can be solved for, and
that beyond which no step lowers the cost; in units of the Gram matrix's diagonal."""
AFTER_SUCCESS, AFTER_FAILURE = 0.3, 6.0
"""Factors of the damping after a step that lowers the cost, and after one that does not."""


class NormalEquations(NamedTuple):
    """Cost of parameters and its local quadratic model.

    Attributes:
        cost: Weighted sum of squares.
        score: Half the negative gradient of the cost, shape (p,).
        gram: Half the Hessian of the cost without second derivatives, shape (p, p).

    """

    cost: float
    score: Array
    gram: Array

    def with_prior(self, distance: Array, precision: Array) -> "NormalEquations":
        """The equations with the square of an independent normal prior in the cost.

        Args:
            distance: Parameters less the prior's means, shape (p,).
            precision: Inverse variances of the prior, shape (p,).

        """
        return NormalEquations(
            self.cost + float(precision @ distance**2),
            self.score - precision * distance,
            self.gram + np.diag(precision),
        )


def normal_equations(residual: Array, gradient: Array, weight: Array) -> NormalEquations:
    """Normal equations of weighted residuals.

    Args:
        residual: Observed less predicted values, shape (n,).
        gradient: Derivatives of the prediction by the parameters, shape (p, n).
        weight: Inverse variances, shape (n,).

    """
    weighted = gradient * weight
    return NormalEquations(
        float(weight @ residual**2), weighted @ residual, np.asarray(weighted @ gradient.T)
    )


def minimise(
    evaluate: Callable[[Array], NormalEquations],
    start: Array,
    bounds: tuple[Array, Array],
    *,
    steps: int,
    converged: float,
    longest: float = inf,
    damping: float = FIRST_DAMPING,
) -> tuple[Array, NormalEquations]:
    """Parameters of least cost within bounds, shape (p,), and the normal equations there.

    Args:
        evaluate: Normal equations at parameters of shape (p,) within the bounds.
        start: Parameters to start with, shape (p,); they are moved to within the bounds.
        bounds: Lower and upper bounds, shape (p,) each.
        steps: Largest number of steps tried.
        converged: Decrease of the cost, as a share of its size, below which a step is the last one.
        longest: Largest change of a parameter in one step.
        damping: That of the first step, as a share of the Gram matrix's diagonal; less is faster
            from a start near the minimum.

    Raises:
        ValueError: The cost at the start is no number.

    """
    lower, upper = bounds
    y = _within(start, lower, upper)
    here = evaluate(y)
    if not np.isfinite(here.cost):
        raise ValueError(f"the cost at the start {y} is {here.cost}")
    for _ in range(steps):
        pressed = ((y <= lower) & (here.score < 0.0)) | ((y >= upper) & (here.score > 0.0))
        free = np.flatnonzero(~pressed & (here.gram.diagonal() > 0.0))
        if not len(free):
            break
        inner = here.gram[free[:, None], free]
        scale = np.sqrt(inner.diagonal())
        scaled = inner / (scale[:, None] * scale)
        scaled.flat[:: len(free) + 1] += damping
        step = np.zeros(len(y))
        step[free] = np.linalg.solve(scaled, here.score[free] / scale) / scale
        moved = _within(y + _within(step, -longest, longest), lower, upper)
        there = evaluate(moved)
        if there.cost < here.cost:
            decrease = here.cost - there.cost
            y, here = moved, there
            damping = max(damping * AFTER_SUCCESS, LEAST_DAMPING)
            if decrease < converged * abs(here.cost):
                break
        else:
            damping *= AFTER_FAILURE
            if damping > LARGEST_DAMPING or np.array_equal(moved, y):
                break
    return y, here


def _within(values: Array, lower: Array | float, upper: Array | float) -> Array:
    """Values moved to the nearest ones within bounds; on a few numbers half the time of np.clip."""
    return np.minimum(np.maximum(values, lower), upper)
