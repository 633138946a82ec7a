"""Weights of whitened rows, whose variance depends on how much of it comes from the slip."""

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array

WEIGHT_GROUPS, WEIGHT_ROWS = 20, 200
"""Groups of rows for the variance function, and the rows without which all weights are 1."""


def compute_weights(square: Array, share: Array, used: NDArray[np.bool_]) -> Array:
    """Reciprocal standard deviation of whitened residuals, as a function of the slip's share.

    A filter that removes most of a slow noise leaves the slip's own error as it was. The variance
    function is linear in the share, with coefficients that are not negative (non-negative
    least squares; Lawson and Hanson, Solving Least Squares Problems, 1974).

    Args:
        square: Squares of the whitened residuals, shape (n,).
        share: Share of the wheel speed's noise in a residual's variance, shape (n,).
        used: Whether a row takes part, shape (n,).

    """
    rows = np.flatnonzero(used & (square > 0.0))
    if len(rows) < WEIGHT_ROWS:
        return np.ones_like(square)
    order = rows[np.argsort(share[rows], kind="stable")]
    groups = np.array_split(order, WEIGHT_GROUPS)
    level = np.array([float(np.mean(square[group])) for group in groups])
    mean_share = np.array([float(np.mean(share[group])) for group in groups])
    matrix = np.column_stack([np.ones_like(mean_share), mean_share]) / level[:, None]
    (base, growth), _ = scipy.optimize.nnls(matrix, np.ones_like(level))
    variance = np.maximum(base + growth * share, 1e-3 * level.min())
    return np.asarray(1.0 / np.sqrt(variance))
