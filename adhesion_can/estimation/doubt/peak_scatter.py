"""Standard deviation of λ_m by the scatter of the blocks' own pull on it.

An error of the vehicle speed that lasts for seconds moves the slips of all axles alike: on a steep
curve it is worth more than the noise of a thousand samples, and no sum over samples shows it. Each
block pulls λ_m by its influence, ψ = ∇λ_mᵀ A⁻¹ s, with the information A of all blocks and its own
score s; the variance of the sum of these pulls is that of λ_m, however the errors within a block
depend on each other (cluster-robust covariance; Liang & Zeger, Biometrika 73, 1986). Blocks are
merged two by two while enough are left, and what neighbours still share counts as a first-order
autoregression.
"""

from math import inf, sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.batch_means import FEWEST
from adhesion_can.estimation.doubt.blocks import TANGENTS, ReducedBlocks
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve

MOST_SHARED = 0.9
"""Largest correlation of neighbouring blocks."""
_RIDGE = 1e-9
"""Ridge relative to the diagonal of the information."""


def slip_scatter(blocks: ReducedBlocks, curve: PooledCurve) -> float:
    """Standard deviation of λ_m as a share of it; 0 where there are too few blocks.

    It is infinite where errors of the slips are worth more than what a coefficient was seen by.

    Args:
        blocks: Blocks at the pooled curve.
        curve: Pooled curve of the current surface.

    """
    current = slice(0, blocks.current)
    if blocks.current < FEWEST:
        return 0.0
    scores = blocks.scores[current, :TANGENTS]
    information = blocks.grams[current, :TANGENTS, :TANGENTS].sum(axis=0)
    if not np.all(information.diagonal() > 0.0):
        return inf
    scale = np.sqrt(information.diagonal())
    inner = information / scale / scale[:, None] + _RIDGE * np.eye(TANGENTS)
    c1, c2, c3 = curve.theta
    # λ_m = ln(c1 c2/c3)/c2
    gradient = np.array([1.0 / (c1 * c2), (1.0 / c2 - curve.lambda_m) / c2, -1.0 / (c2 * c3)])
    pull = (scores / scale) @ np.linalg.solve(inner, gradient / scale)
    return sqrt(_variance_of_sum(pull)) / curve.lambda_m


def _variance_of_sum(pull: Array) -> float:
    """Largest variance of the sum of pulls, shape (n,), by batches of 1, 2, 4, .. of them."""
    variance = 0.0
    while len(pull) >= FEWEST:
        square = float(pull @ pull)
        # The fit takes its tangents' share of the scatter, and biases the correlation likewise.
        few = len(pull) / (len(pull) - TANGENTS)
        shared = float(pull[1:] @ pull[:-1]) / max(square, 1e-300) + 1.0 / len(pull)
        rho = min(max(shared, 0.0), MOST_SHARED)
        variance = max(variance, few * square * (1.0 + rho) / (1.0 - rho))
        pairs = len(pull) // 2 * 2
        pull = pull[0:pairs:2] + pull[1:pairs:2]
    return variance
