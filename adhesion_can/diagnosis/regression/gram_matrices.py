"""Gram matrices of whitened columns, block by block: sufficient statistics of every later step.

A block is a span of time with all axles in it, since an error of the vehicle speed meets all axles
at once. Errors that the rows of a block share are integrated out, which is generalised least
squares with a random effect for each block.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

COLLINEAR = 1e-9
"""Eigenvalue of a correlation matrix, relative to the largest, below which it counts as 0."""
ROUND_OFF = 1e-9
"""Share of a column's square that is round-off."""


@dataclass(frozen=True, eq=False)
class BlockGramMatrices:
    """Gram matrix of each block.

    Attributes:
        matrices: Gram matrices XᵀX of the p columns, the residual last; shape (blocks, p, p).
        rows: Number of rows in each block, shape (blocks,).

    """

    matrices: Array
    rows: Array

    @classmethod
    def from_columns(
        cls, columns: Array, block: NDArray[np.int64], speed_error_design: Array | None = None
    ) -> "BlockGramMatrices":
        """Sum products of columns over the rows of each block.

        Args:
            columns: Whitened columns, the residual last; shape (n, p).
            block: Block number of each row, negative in rows that are left out; shape (n,).
            speed_error_design: Design matrix of errors that many rows of a block share, each of
                variance 1 and independent from block to block, shape (n, q). They are integrated
                out by the Woodbury identity.

        """
        kept = np.flatnonzero(block >= 0)
        order = kept[np.argsort(block[kept], kind="stable")]
        numbers, starts = np.unique(block[order], return_index=True)
        size = columns.shape[1]
        if not len(numbers):
            return cls(np.empty((0, size, size)), np.empty(0))
        ends = np.append(starts[1:], len(order))
        blocks = [order[first:last] for first, last in zip(starts, ends, strict=True)]
        parts = [columns[rows] for rows in blocks]
        matrices = np.array([part.T @ part for part in parts])
        if speed_error_design is not None and speed_error_design.shape[1]:
            errors = [speed_error_design[rows] for rows in blocks]
            cross = np.array([e.T @ part for e, part in zip(errors, parts, strict=True)])
            error_grams = np.array([e.T @ e for e in errors]) + np.eye(speed_error_design.shape[1])
            matrices -= cross.transpose(0, 2, 1) @ np.linalg.solve(error_grams, cross)
        return cls(matrices, (ends - starts).astype(np.float64))

    @property
    def total(self) -> Array:
        """Gram matrix of all blocks together, shape (p, p)."""
        return np.asarray(self.matrices.sum(axis=0))

    @property
    def square(self) -> float:
        """Sum of squares of the last column."""
        return float(self.matrices[:, -1, -1].sum())

    def project_out(self, nuisance: Sequence[int], columns: Sequence[int]) -> Array:
        """Project nuisance columns out of other columns (Frisch and Waugh 1933; Lovell 1963).

        Args:
            nuisance: Indices of the columns that are projected out.
            columns: Indices of the k columns of interest.

        Returns:
            Remainders of the k columns as linear combinations of all columns, shape (p, k).

        """
        total = self.total
        v = np.zeros((total.shape[0], len(columns)))
        v[list(columns), np.arange(len(columns))] = 1.0
        if len(nuisance):
            v[list(nuisance)] -= solve_normal_equations(
                total[np.ix_(nuisance, nuisance)], total[np.ix_(nuisance, columns)]
            )
        return v


def solve_normal_equations(gram: Array, right: Array) -> Array:
    """Least-squares coefficients from a Gram matrix, by a pseudo-inverse of the correlations.

    Args:
        gram: Gram matrix of the regressors, shape (p, p); they may be collinear.
        right: Products of the regressors with the targets, shape (p,) or (p, k).

    Returns:
        Coefficients, shape as `right`.

    """
    diagonal = gram.diagonal()
    # A column of zeros gets the scale 1, so that its coefficient is 0 and not round-off over 0.
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    correlation = gram / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(correlation)
    inverse = np.where(
        values > COLLINEAR * max(values[-1], 1e-300), 1.0 / np.maximum(values, 1e-300), 0.0
    )
    shape = (-1,) + (1,) * (right.ndim - 1)
    scaled = right / scale.reshape(shape)
    return np.asarray((vectors * inverse) @ (vectors.T @ scaled) / scale.reshape(shape))


def number_blocks(t_s: Array, length_s: float) -> NDArray[np.int64]:
    """Block number of each row, for blocks of a given length, s; shape (n,)."""
    return np.floor(t_s / length_s).astype(np.int64)
