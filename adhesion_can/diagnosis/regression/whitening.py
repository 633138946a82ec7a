"""One filter that makes residuals white: autoregressive, the same for every axle."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array

NUGGET = 1.0
"""Share of white noise that is put on every residual's variance: a slow noise would be differenced
until the equations' own small errors, of timing and of smoothing, were all that is left of it."""
ORDERS = (0, 1, 2, 4, 8, 16, 32, 64)


@dataclass(frozen=True, eq=False)
class Stretches:
    """Rows that follow each other at one axle without a gap.

    Attributes:
        starts: first row of each stretch, ascending.
        rows: number of all rows.

    """

    starts: NDArray[np.int64]
    rows: int

    @classmethod
    def of(cls, t_s: Array, axle: Array, breaks: NDArray[np.bool_]) -> "Stretches":
        """Stretches of rows sorted by axle and stamp.

        Args:
            t_s: stamps, shape (n,).
            axle: shape (n,); numbers of different courses differ.
            breaks: rows that do not follow the row in front of them, shape (n,).

        """
        step = np.diff(t_s, prepend=t_s[:1])
        cycle = float(np.median(step[step > 0])) if (step > 0).any() else 1.0
        new = (np.diff(axle, prepend=axle[:1] - 1) != 0) | (step > 3 * cycle) | (step < 0) | breaks
        return cls(np.flatnonzero(new), len(t_s))


@dataclass(frozen=True, eq=False)
class Whitener:
    """x_n − Σ a_k x_(n−k) within each stretch; its first rows, with no past, are left out.

    Attributes:
        taps: 1, −a_1, −a_2 ..
        stretches: see there.

    """

    taps: Array
    stretches: Stretches

    @property
    def order(self) -> int:
        """How far back it looks, rows."""
        return len(self.taps) - 1

    def __call__(self, columns: Array) -> Array:
        """Columns whitened, shape as theirs (n, ..); zero in the rows that have no past."""
        if self.order == 0 or columns.size == 0:
            return columns
        out = np.asarray(scipy.signal.lfilter(self.taps, [1.0], columns, axis=0))
        out[self.without_past] = 0.0
        return out

    @property
    def without_past(self) -> NDArray[np.int64]:
        """Rows that are left out."""
        starts = self.stretches.starts
        ends = np.append(starts[1:], self.stretches.rows)
        return np.concatenate(
            [np.arange(a, min(a + self.order, b)) for a, b in zip(starts, ends, strict=True)]
        ).astype(np.int64)


def fitted(residual: Array, stretches: Stretches) -> Whitener:
    """The filter that residuals ask for: Yule-Walker, the order by BIC.

    Args:
        residual: shape (n,), 0 where a row has none.
        stretches: see there.

    """
    covariance = autocovariance(residual, stretches, max(ORDERS))
    best, least = np.array([1.0]), np.inf
    effective = float(np.count_nonzero(residual))
    for order in ORDERS:
        if order * 20 > effective or covariance[0] <= 0.0:
            break
        column = covariance[: order + 1].copy()
        column[0] *= 1.0 + NUGGET
        weights = scipy.linalg.solve_toeplitz(column[:order], column[1:]) if order else np.empty(0)
        variance = max(float(column[0] - weights @ column[1:]), 1e-300)
        cost = effective * np.log(variance) + order * np.log(max(effective, 2.0))
        if cost < least:
            best, least = np.concatenate([[1.0], -weights]), cost
    return Whitener(best, stretches)


def autocovariance(residual: Array, stretches: Stretches, lags: int) -> Array:
    """Autocovariance at lags 0.. of rows within the same stretch, shape (lags + 1,)."""
    number = np.cumsum(np.bincount(stretches.starts, minlength=len(residual))[: len(residual)])
    out = np.zeros(lags + 1)
    for lag in range(min(lags + 1, len(residual))):
        head, tail = residual[lag:], residual[: len(residual) - lag]
        same = number[lag:] == number[: len(residual) - lag]
        out[lag] = float(np.sum(head * tail * same)) / max(len(residual), 1)
    return out
