"""How large the errors of the vehicle speed are, by what all axles have in common.

The readings of the vehicle speed alone do not distinguish lasting errors from motion. The
adhesion does: such an error shifts the slips of all axles at once, and most where the curve is
steep. The standard deviation that is most likely for the residuals of a block is that of a random
effect (Harville, Journal of the American Statistical Association 72 (1977)).
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array

LARGEST_FACTOR = 30.0
"""Largest factor by which the standard deviation is corrected, up or down."""
USUAL_FACTOR = 3.0
"""Factor that the readings are usually wrong by: it decides where few blocks say anything."""
LEAST_SQUARE = 1e-9
"""Square of a design column, in variances of a row, from which a block knows of the error."""


def estimate_speed_error_scale(residual: Array, design: Array, block: NDArray[np.int64]) -> float:
    """Factor of the vehicle speed's standard deviation that makes the residuals most likely.

    Args:
        residual: Residuals in standard deviations of a row's own noise, shape (n,).
        design: Change of each residual by errors of one standard deviation, independent of each
            other and from block to block; shape (n, q).
        block: Block number of each row, negative in rows that take no part; shape (n,).

    Returns:
        Factor; 1 where the residuals say nothing about it.

    """
    rows = np.flatnonzero(block >= 0)
    if not len(rows) or not design.shape[1]:
        return 1.0
    rows = rows[np.argsort(block[rows], kind="stable")]
    starts = np.unique(block[rows], return_index=True)[1]
    squares, parts = [], []
    for block_rows in np.split(rows, starts[1:]):
        values, vectors = np.linalg.eigh(design[block_rows].T @ design[block_rows])
        kept = values > LEAST_SQUARE
        squares.append(values[kept])
        parts.append(vectors.T[kept] @ (design[block_rows].T @ residual[block_rows]))
    square, part = np.concatenate(squares), np.concatenate(parts)
    # What is orthogonal to every error of the speed is the rows' own noise.
    freedom = len(rows) - len(square)
    if freedom <= 0 or not len(square):
        return 1.0
    own_noise = (float(residual[rows] @ residual[rows]) - float(np.sum(part**2 / square))) / freedom
    if own_noise <= 0.0:
        return 1.0

    def unlikeliness(log_factor: float) -> float:
        by_error = float(np.exp(2.0 * log_factor))
        variance = 1.0 + by_error * square
        explained = by_error * part**2 / (own_noise * variance)
        usual = float((log_factor / np.log(USUAL_FACTOR)) ** 2)
        return float(np.sum(np.log(variance) - explained)) + usual

    limit = float(np.log(LARGEST_FACTOR))
    optimum = scipy.optimize.minimize_scalar(unlikeliness, bounds=(-limit, limit), method="bounded")
    return float(np.exp(optimum.x))
