"""Adequacy: how much of the structure in blocks of time a cause leaves.

Whitened residuals are independent where a model is adequate. Summed over the rows of one axle with
one sign of the slip in one block, their variance is then the number of rows. A mechanism that is
missing, or described wrongly, shifts all rows of such a cell the same way, and the variance of the
sums exceeds that of independent rows. The excess that is left with a cause, as a share of the
excess without it, says what part of the structure the cause does not describe. Unlike the ratio of
RMSE and noise floor it is not diluted by the noise of single rows.

Errors of the vehicle speed last and are common to all rows of a block. They are predicted from the
block and taken off; the variance that this leaves of a sum is known and counts as expected.

It is the lack-of-fit test against pure error (Draper and Smith, Applied Regression Analysis, 3rd
ed. 1998, ch. 2) with the cells as replicates, in the form of variance components.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression

MOST_LEFT = 0.15
"""Largest share of the excess variance of the blocks that a cause may leave. In drives with one
known cause it left at most 0.07; where the cause was another mechanism's, at least 0.31."""
LEAST_ROWS = 8
"""Least number of rows of a cell: axle, sign of the slip, block."""
CONFIDENCE = 0.95
"""One-sided confidence with which too much must be left."""


class VarianceLeft(NamedTuple):
    """What a cause leaves of the excess variance of the blocks.

    Attributes:
        share: Excess variance with the cause over that without it; 0 where none is left.
        is_certain: Whether more than `MOST_LEFT` is left with one-sided confidence of 95 %.

    """

    share: float
    is_certain: bool

    @property
    def refutes(self) -> bool:
        """Whether so much is left that the cause is refuted."""
        return self.is_certain and self.share > MOST_LEFT


@dataclass(frozen=True, eq=False)
class BlockVariance:
    """Variance of the block sums of whitened residuals.

    Attributes:
        ratio: Squared sum of each cell over that expected of independent rows and of errors of the
            vehicle speed, shape (cells,).
        block: Block number of each cell, shape (cells,).
        row_square: Mean square of the whitened residual of a row.

    """

    ratio: Array
    block: NDArray[np.int64]
    row_square: float

    @property
    def excess(self) -> float:
        """Mean ratio less 1, its expectation for independent rows; not below 0."""
        return max(float(self.ratio.mean()) - 1.0, 0.0) if len(self.ratio) else 0.0


def compute_block_variance(
    regression: WhitenedRegression, model: Model, row_square: float | None = None
) -> BlockVariance:
    """Variance of the sums of whitened residuals over axle, sign of the slip and block.

    Args:
        regression: Rows with weights, filter and blocks.
        model: Model whose residuals are summed.
        row_square: Mean square of a row on which the ratios are based; None: that of this model.

    """
    data = regression.data
    whitened = regression.whiten(regression.residual(model)[:, None])[:, 0]
    direction = np.sign(regression.evaluate_corrected(model).slip).astype(np.int64)
    rows = np.flatnonzero(regression.used & (whitened != 0.0) & (direction != 0))
    cells = np.stack([regression.block_number, data.column("axle"), direction], axis=1)[rows]
    names, cell, count = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    cell = cell.ravel()
    design = regression.whitened_speed_errors[rows]
    sums = _sum_cells(whitened[rows], cell, len(names))
    by_speed = np.zeros((len(names), design.shape[1]))
    for k, column in enumerate(design.T):
        by_speed[:, k] = _sum_cells(column, cell, len(names))
    expected = count.astype(np.float64)
    for block in np.unique(names[:, 0]):
        own, members = names[:, 0] == block, cells[:, 0] == block
        part = design[members]
        gram = part.T @ part + np.eye(part.shape[1])
        errors = np.linalg.solve(gram, part.T @ whitened[rows][members])
        sums[own] -= by_speed[own] @ errors
        expected[own] -= np.sum(by_speed[own] * np.linalg.solve(gram, by_speed[own].T).T, axis=1)
    if row_square is None:
        row_square = float(np.mean(whitened[rows] ** 2)) if len(rows) else 1.0
    kept = (count >= LEAST_ROWS) & (expected > 1.0)
    ratio = sums[kept] ** 2 / np.maximum(expected[kept] * row_square, 1e-300)
    return BlockVariance(ratio, names[kept, 0], row_square)


def _sum_cells(column: Array, cell: NDArray[np.int64], cells: int) -> Array:
    """Sum of a column over the rows of each cell, shape (cells,)."""
    return np.bincount(cell, column, minlength=cells).astype(np.float64)


def compute_variance_left(
    regression: WhitenedRegression, with_cause: Model, without: Model
) -> VarianceLeft:
    """Excess variance of the blocks that a cause leaves.

    Args:
        regression: Rows with weights, filter and blocks.
        with_cause: Fitted model with the cause.
        without: Model without it, fitted to the same rows.

    """
    after = compute_block_variance(regression, with_cause)
    before = compute_block_variance(regression, without, after.row_square)
    if before.excess == 0.0:
        return VarianceLeft(1.0 if after.excess else 0.0, is_certain=False)
    blocks = np.union1d(after.block, before.block)
    # Blocks are independent of each other, the cells of a block are not.
    by_block = [
        np.bincount(np.searchsorted(blocks, part.block), part.ratio - 1.0, minlength=len(blocks))
        for part in (after, before)
    ]
    beyond = by_block[0] - MOST_LEFT * by_block[1]
    std_error = float(beyond.std(ddof=1)) / np.sqrt(len(beyond)) if len(beyond) > 1 else np.inf
    bound = float(scipy.stats.t.ppf(CONFIDENCE, max(len(beyond) - 1, 1))) * std_error
    return VarianceLeft(after.excess / before.excess, bool(beyond.mean() > bound))
