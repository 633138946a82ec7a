"""Prewhitening of residuals by an autoregressive filter, the same for every axle.

The coefficients solve the Yule-Walker equations. The order minimises Schwarz's criterion (BIC;
Annals of Statistics 6 (1978)). Columns and residual pass the same filter (Cochrane and Orcutt, JASA
44 (1949)), which makes ordinary least squares on them generalised least squares.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array

NUGGET = 1.0
"""Variance of white noise that is added to the residuals' (the nugget of geostatistics), as a share
of it. A filter for slow noise alone would difference it until the small errors of timing and
smoothing dominated."""
ORDERS = (0, 1, 2, 4, 8, 16, 32, 64)
"""Orders of the autoregression that are compared."""
ROWS_PER_COEFFICIENT = 20
"""Least number of rows for each coefficient of the filter."""
GAP_CYCLES = 3
"""Time between two rows, in cycles of the data, from which it is a gap."""


@dataclass(frozen=True, eq=False)
class ContiguousRuns:
    """Runs of rows that follow each other at one axle without a gap.

    Attributes:
        starts: Index of the first row of each run, ascending; shape (runs,).
        rows: Number of all rows.

    """

    starts: NDArray[np.int64]
    rows: int

    @classmethod
    def find(cls, t_s: Array, axle: Array, breaks: NDArray[np.bool_]) -> "ContiguousRuns":
        """Find the runs of rows sorted by axle and stamp.

        Args:
            t_s: Stamps, s; shape (n,).
            axle: Axle numbers, different for different drives; shape (n,).
            breaks: Whether a row does not follow the row before it, shape (n,).

        """
        step = np.diff(t_s, prepend=t_s[:1])
        cycle = float(np.median(step[step > 0])) if (step > 0).any() else 1.0
        new = np.diff(axle, prepend=axle[:1] - 1) != 0
        new |= (step > GAP_CYCLES * cycle) | (step < 0) | breaks
        return cls(np.flatnonzero(new), len(t_s))


@dataclass(frozen=True, eq=False)
class Whitener:
    """Filter x_n − Σ a_k x_(n−k) within each run; the first rows of a run are left out.

    Attributes:
        taps: Filter coefficients 1, −a_1, −a_2, ...; shape (order + 1,).
        runs: Runs of rows within which the filter works.

    """

    taps: Array
    runs: ContiguousRuns

    @property
    def order(self) -> int:
        """Order of the autoregression, rows."""
        return len(self.taps) - 1

    def __call__(self, columns: Array) -> Array:
        """Whitened columns, shape (n, ..) as given; zero in the rows that have no past."""
        if self.order == 0 or columns.size == 0:
            return columns
        out = np.asarray(scipy.signal.lfilter(self.taps, [1.0], columns, axis=0))
        out[self.rows_without_past] = 0.0
        return out

    @property
    def rows_without_past(self) -> NDArray[np.int64]:
        """Indices of the rows that lack the past which the filter needs."""
        starts = self.runs.starts
        ends = np.append(starts[1:], self.runs.rows)
        return np.concatenate(
            [np.arange(a, min(a + self.order, b)) for a, b in zip(starts, ends, strict=True)]
        ).astype(np.int64)


def fit_whitener(residual: Array, runs: ContiguousRuns) -> Whitener:
    """Fit the autoregression of residuals: Yule-Walker equations, order by BIC.

    Args:
        residual: Residuals, 0 in rows that take no part; shape (n,).
        runs: Runs of rows within which the filter works.

    """
    covariance = compute_autocovariance(residual, runs, max(ORDERS))
    best, least = np.array([1.0]), np.inf
    effective = float(np.count_nonzero(residual))
    for order in ORDERS:
        if order * ROWS_PER_COEFFICIENT > effective or covariance[0] <= 0.0:
            break
        column = covariance[: order + 1].copy()
        column[0] *= 1.0 + NUGGET
        weights = scipy.linalg.solve_toeplitz(column[:order], column[1:]) if order else np.empty(0)
        variance = max(float(column[0] - weights @ column[1:]), 1e-300)
        criterion = effective * np.log(variance) + order * np.log(max(effective, 2.0))
        if criterion < least:
            best, least = np.concatenate([[1.0], -weights]), criterion
    return Whitener(best, runs)


def compute_autocovariance(residual: Array, runs: ContiguousRuns, lags: int) -> Array:
    """Autocovariance of rows within the same run at lags 0 to `lags`; shape (lags + 1,)."""
    number = np.cumsum(np.bincount(runs.starts, minlength=len(residual))[: len(residual)])
    out = np.zeros(lags + 1)
    for lag in range(min(lags + 1, len(residual))):
        head, tail = residual[lag:], residual[: len(residual) - lag]
        same = number[lag:] == number[: len(residual) - lag]
        out[lag] = float(np.sum(head * tail * same)) / max(len(residual), 1)
    return out


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
