"""Whitened columns summed up block by block: all that the tests need of the data.

A block is a span of time with all axles in it, since what is wrong with the vehicle speed is wrong
with all of them at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array


@dataclass(frozen=True, eq=False)
class Ledger:
    """Products of columns in each block.

    Attributes:
        grams: XᵀX, shape (blocks, p, p); the last column is the residual.
        rows: number of rows in each block, shape (blocks,).

    """

    grams: Array
    rows: Array

    @classmethod
    def of(cls, columns: Array, block: NDArray[np.int64], shared: Array | None = None) -> "Ledger":
        """Sums over the rows of each block.

        Args:
            columns: whitened, shape (n, p), the residual last.
            block: number of each row's block, negative: left out; shape (n,).
            shared: columns of errors that many rows of a block share, each error of variance 1
                and independent from block to block, shape (n, q). They are integrated out: the
                products become those of generalised least squares.

        """
        kept = np.flatnonzero(block >= 0)
        order = kept[np.argsort(block[kept], kind="stable")]
        numbers, starts = np.unique(block[order], return_index=True)
        size = columns.shape[1]
        if not len(numbers):
            return cls(np.empty((0, size, size)), np.empty(0))
        grams = []
        ends = np.append(starts[1:], len(order))
        for first, last in zip(starts, ends, strict=True):
            rows = order[first:last]
            part = columns[rows]
            gram = part.T @ part
            if shared is not None and shared.shape[1]:
                errors = shared[rows]
                cross = errors.T @ part
                own = errors.T @ errors + np.eye(errors.shape[1])
                gram = gram - cross.T @ np.linalg.solve(own, cross)
            grams.append(gram)
        return cls(np.array(grams), (ends - starts).astype(np.float64))

    @property
    def total(self) -> Array:
        """Over all blocks, shape (p, p)."""
        return np.asarray(self.grams.sum(axis=0))

    def weights(self, nuisance: Sequence[int], of: Sequence[int]) -> Array:
        """Columns less what the nuisance columns explain of them, as weights of all columns.

        Args:
            nuisance: columns that are projected out.
            of: columns that are left.

        Returns:
            Shape (p, len(of)).

        """
        total = self.total
        v = np.zeros((total.shape[0], len(of)))
        v[list(of), np.arange(len(of))] = 1.0
        if len(nuisance):
            v[list(nuisance)] -= solve(
                total[np.ix_(nuisance, nuisance)], total[np.ix_(nuisance, of)]
            )
        return v


def solve(gram: Array, right: Array) -> Array:
    """Least squares from products, where columns may not be told from each other."""
    diagonal = gram.diagonal()
    # A column that is nothing keeps a size: its answer must be 0, not round-off over nothing.
    scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    correlation = gram / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(correlation)
    inverse = np.where(
        values > 1e-9 * max(values[-1], 1e-300), 1.0 / np.maximum(values, 1e-300), 0.0
    )
    shape = (-1,) + (1,) * (right.ndim - 1)
    scaled = right / scale.reshape(shape)
    return np.asarray((vectors * inverse) @ (vectors.T @ scaled) / scale.reshape(shape))


def blocks_of(t_s: Array, length_s: float) -> NDArray[np.int64]:
    """Number of each row's block of time."""
    return np.floor(t_s / length_s).astype(np.int64)
