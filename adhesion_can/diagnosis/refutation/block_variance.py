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
from adhesion_can.diagnosis.regression.gram_matrices import BlockGramMatrices
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
class BlockSumVariance:
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
) -> BlockSumVariance:
    """Variance of the sums of whitened residuals over axle, sign of the slip and block.

    Args:
        regression: Rows with weights, filter and blocks.
        model: Model whose residuals are summed.
        row_square: Mean square of a row on which the ratios are based; None: that of this model.

    """
    whitened = regression.whiten(regression.residual(model)[:, None])[:, 0]
    direction = np.sign(regression.evaluate_corrected(model).slip).astype(np.int64)
    rows = np.flatnonzero(regression.used & (whitened != 0.0) & (direction != 0))
    axle, block = regression.data.column("axle").astype(np.int64), regression.block[rows]
    cells = _Cells.find(block, axle[rows], direction[rows])
    whitened, design = whitened[rows], regression.whitened_speed_errors[rows]
    by_speed, variance = _predict_shared(cells, block, design, whitened)
    sums, expected = cells.sum(whitened) - by_speed, cells.rows - variance
    if row_square is None:
        row_square = float(np.mean(whitened**2)) if len(rows) else 1.0
    kept = (cells.rows >= LEAST_ROWS) & (expected > 1.0)
    ratio = sums[kept] ** 2 / np.maximum(expected[kept] * row_square, 1e-300)
    return BlockSumVariance(ratio, cells.block[kept], row_square)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Cells of rows: those of one axle, with one sign of the slip, in one block.

    Attributes:
        number: Number of each row's cell, shape (n,).
        block: Block number of each cell, ascending; shape (cells,).
        rows: Number of rows of each cell, shape (cells,).

    """

    number: NDArray[np.int64]
    block: NDArray[np.int64]
    rows: Array

    @classmethod
    def find(
        cls, block: NDArray[np.int64], axle: NDArray[np.int64], direction: NDArray[np.int64]
    ) -> "_Cells":
        """Cells of rows with these blocks, axles and signs of the slip, shape (n,) each."""
        names, number, rows = np.unique(
            np.stack([block, axle, direction], axis=1),
            axis=0,
            return_inverse=True,
            return_counts=True,
        )
        return cls(number.ravel(), names[:, 0], rows.astype(np.float64))

    def sum(self, column: Array) -> Array:
        """Sum of a column over the rows of each cell, shape (cells,)."""
        return np.bincount(self.number, column, minlength=len(self.rows)).astype(np.float64)


def _predict_shared(
    cells: _Cells, block: NDArray[np.int64], design: Array, whitened: Array
) -> tuple[Array, Array]:
    """What errors of the vehicle speed are predicted to add to the sum of each cell.

    Args:
        cells: Cells of the rows.
        block: Block number of each row, shape (n,).
        design: Whitened design matrix of the errors, shape (n, q).
        whitened: Whitened residual of each row, shape (n,).

    Returns:
        Predicted part of the sum of each cell, and its variance; shape (cells,) each.

    """
    columns = np.column_stack([design, whitened])
    grams = BlockGramMatrices.from_columns(columns, block).matrices
    information = grams[:, :-1, :-1] + np.eye(design.shape[1])
    errors = np.linalg.solve(information, grams[:, :-1, -1:])
    block_of_cell = np.unique(cells.block, return_inverse=True)[1]
    sums = np.zeros((len(cells.rows), design.shape[1], 1))
    for k, column in enumerate(design.T):
        sums[:, k, 0] = cells.sum(column)
    variance = np.sum(sums * np.linalg.solve(information[block_of_cell], sums), axis=(1, 2))
    return np.sum(sums * errors[block_of_cell], axis=(1, 2)), variance


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
