"""Peak of the curve when chosen directions are estimated with it."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.estimation.doubt.blocks import CURVE, TANGENTS, ReducedBlocks
from adhesion_can.estimation.doubt.directions import CREEP_SPEED, ResidualDirection
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve, linearise, on_grid
from adhesion_can.estimation.doubt.slip_basis import GRID
from adhesion_can.physics.estimate import PeakEstimate

BUMP_PRIOR = 0.1
"""Plausible size of a bump of a curve whose shape is in doubt, as a share of the largest adhesion.
Where no data are, a larger one would make peaks of nothing."""
PRIOR_WEIGHT = 0.1
"""Weight of the directions' priors."""
LEAST_CURVATURE = 1e-3
"""Least curvature −d²μ/dx² of a peak, as a share of the largest adhesion; x is the grid's index
over its number of steps. A flatter one may lie anywhere that was reached."""
LEAST_LEFT = 0.1
"""Least share of the information that is left along any direction without errors of the slips."""
_SPACING = 6
"""Steps of the grid over which the curvature is taken."""


class JointFit(NamedTuple):
    """Coefficients that are estimated together.

    Attributes:
        chosen: Indices of the coefficients.
        change: Estimated coefficients, shape (k,).
        covariance: Covariance of the coefficients, shape (k, k).

    """

    chosen: list[int]
    change: Array
    covariance: Array

    def spread(self, size: int) -> Array:
        """All coefficients, 0 where they are not estimated; shape (size,)."""
        whole = np.zeros(size)
        whole[self.chosen] = self.change
        return whole


def fit_jointly(
    blocks: ReducedBlocks,
    coefficients: Sequence[int],
    directions: Sequence[ResidualDirection],
    *,
    inflation: float,
    prior_std: Mapping[int, float],
) -> JointFit:
    """Estimate coefficients together, by corrected scores for the errors of the slips.

    The covariance is that of corrected scores: A⁻¹ (A + D) A⁻¹ with the corrected information A and
    the share D of the slips' errors (Carroll et al., Measurement Error in Nonlinear Models, 2nd ed.
    2006, ch. 7). Where D is most of what there is, little is known.

    Args:
        blocks: Blocks at the curve.
        coefficients: Indices of the coefficients to estimate.
        directions: Directions of the coefficients after those of the curve.
        inflation: Factor of the covariance by errors that last.
        prior_std: Prior standard deviation by coefficient, in place of a weak one.

    """
    gram, score = blocks.grams.sum(axis=0), blocks.scores.sum(axis=0)
    # What errors of the slips add counts here: without it a coefficient may have less than none.
    whole = gram + blocks.dilution
    chosen = [k for k in coefficients if whole[k, k] > 0.0]
    among_chosen = np.ix_(chosen, chosen)
    precision = [_prior_precision(k, directions, prior_std) * inflation for k in chosen]
    dilution = blocks.dilution[among_chosen]
    seen = whole[among_chosen] + np.diag(precision)
    scale = np.sqrt(np.maximum(seen.diagonal(), 1e-300))
    seen = seen / scale / scale[:, None] + 1e-9 * np.eye(len(chosen))
    inverse = np.linalg.inv(_corrected(seen, dilution / scale / scale[:, None]))
    covariance = (inverse @ seen @ inverse) / scale / scale[:, None]
    change = (inverse @ (score[chosen] / scale)) / scale
    return JointFit(chosen, change, inflation * covariance)


def _corrected(seen: Array, dilution: Array) -> Array:
    """Information without what errors of the slips add, limited so that it stays positive.

    By chance that may exceed the information along some direction (Fuller, Measurement Error
    Models, 1987, sec. 2.5).

    Args:
        seen: Information with the errors of the slips, positive definite, shape (k, k).
        dilution: Share of those errors, positive semidefinite, shape (k, k).

    """
    if not len(seen):
        return seen
    try:
        # Nearly always all of it can be taken off, and this costs little.
        np.linalg.cholesky((1.0 - LEAST_LEFT) * seen - dilution)
    except np.linalg.LinAlgError:
        largest = float(scipy.linalg.eigh(dilution, seen, eigvals_only=True)[-1])
        return np.asarray(seen - min(1.0, (1.0 - LEAST_LEFT) / largest) * dilution)
    return np.asarray(seen - dilution)


def compute_joint_peak(
    fit: JointFit,
    curve: PooledCurve,
    directions: Sequence[ResidualDirection],
    present: Mapping[str, float],
    reached: float,
) -> PeakEstimate:
    """Peak with the estimated coefficients under the present conditions.

    Args:
        fit: Estimated coefficients.
        curve: Pooled curve.
        directions: Directions of the coefficients after those of the curve.
        present: Value that multiplies the curve under the present conditions, by direction.
        reached: Slip ratio up to which the curve is known.

    """
    chosen, change, covariance = fit
    columns = _columns_on_grid(chosen, curve, directions, present)
    values = np.where(reached >= GRID, curve.on_grid() + columns @ change, -np.inf)
    top = int(np.argmax(values))
    mu_var = float(columns[top] @ covariance @ columns[top])
    place, place_std = _place(values, columns, covariance, top, reached)
    return PeakEstimate(float(values[top]), place, float(np.sqrt(max(mu_var, 0.0))), place_std)


def _place(
    values: Array, columns: Array, covariance: Array, top: int, reached: float
) -> tuple[float, float]:
    """Slip ratio of the peak and its standard deviation.

    Args:
        values: Curve on the slip grid, -inf beyond what was reached, shape (POINTS,).
        columns: Change of the curve by each coefficient, shape (POINTS, k).
        covariance: Covariance of the coefficients, shape (k, k).
        top: Index of the largest value.
        reached: Slip ratio up to which the curve is known.

    """
    step = min(_SPACING, top, int(np.isfinite(values).sum()) - 1 - top)
    if step < 1:
        return float(GRID[top]), reached
    low, high = top - step, top + step
    curvature = (2.0 * values[top] - values[low] - values[high]) / step**2
    curvature = max(float(curvature), LEAST_CURVATURE / len(GRID) * float(values[top]))
    nearby = float(values[high] - values[low]) / (2 * step) / curvature
    spacing = float(np.gradient(GRID)[top])
    # dx = −μ'/μ'' by the change of the slope at the peak (implicit function theorem).
    slope = (columns[high] - columns[low]) / (2 * step)
    std = np.sqrt(max(float(slope @ covariance @ slope), 0.0)) / curvature
    place = float(GRID[top]) + min(max(nearby, -1.0), 1.0) * spacing
    return place, min(float(std) * spacing, reached)


def _prior_precision(
    k: int, directions: Sequence[ResidualDirection], prior_std: Mapping[int, float]
) -> float:
    """Prior precision of a coefficient."""
    if k in prior_std:
        return 1.0 / prior_std[k] ** 2
    if k >= CURVE:
        return float(PRIOR_WEIGHT * directions[k - CURVE].prior_std ** -2.0)
    # The tangents are free; the bumps are in units of the largest adhesion.
    return 0.0 if k < TANGENTS else BUMP_PRIOR**-2.0


def _columns_on_grid(
    chosen: Sequence[int],
    curve: PooledCurve,
    directions: Sequence[ResidualDirection],
    present: Mapping[str, float],
) -> Array:
    """Change of the curve on the slip grid by each coefficient, shape (POINTS, k).

    Errors of the instruments do not change the curve.
    """
    shapes = on_grid(linearise(curve).changes)
    level = curve.on_grid()
    columns = []
    for k in chosen:
        if k < CURVE:
            columns.append(shapes[:, k])
            continue
        name = directions[k - CURVE].name
        factor = present.get(name, 0.0) * (GRID if name == CREEP_SPEED else np.ones(len(GRID)))
        columns.append(factor * level)
    return np.stack(columns, axis=1) if columns else np.zeros((len(GRID), 0))
