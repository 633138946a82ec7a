"""Points of a curve for fits of any family: folded, and compressed.

Many points are compressed to means over narrow cells of slip, speed and load. A cell also keeps its
mean square, so that sums of squares stay exact but for the width of the cells. Few points stay as
they are.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.samples import Samples

COMPRESSED_FROM = 4000
"""Number of points from which they are compressed."""
SLIP_CELL, CONDITION_CELL = 0.03, 0.1
"""Relative widths of the cells of slip, and of speed and load."""
SMALLEST_SLIP = 1e-5
"""Slip ratio below which one cell holds all."""

TICK_S = 0.02
"""Time within which residuals are taken together for their autocorrelation, s."""


@dataclass(frozen=True, slots=True)
class CurvePoints:
    """Points on one branch of the curve, as measured or as means of cells; shape (n,) each.

    Attributes:
        slip: Slip ratio, ≥ 0.
        adhesion: Adhesion coefficient, with the sign that it has beside the slip.
        square: Mean square of the adhesion.
        count: Number of samples in each point.
        slip_var: Variance of the error of a sample's slip.
        conditions: Speed and load.

    """

    slip: Array
    adhesion: Array
    square: Array
    count: Array
    slip_var: Array
    conditions: Conditions

    def __len__(self) -> int:
        return len(self.slip)

    @classmethod
    def from_samples(cls, samples: Samples) -> "CurvePoints":
        """Every sample as a point."""
        h, z = samples.folded()
        return cls(
            h, z, z * z, np.ones(len(h)), samples.slip_total_var, Conditions.from_samples(samples)
        )

    @classmethod
    def exact(cls, slip: Array, adhesion: Array, conditions: Conditions) -> "CurvePoints":
        """Points at slips without errors, of either sign; shape (n,) each."""
        h, z = np.abs(slip), np.copysign(1.0, slip) * adhesion
        return cls(h, z, z * z, np.ones(len(h)), np.zeros(len(h)), conditions)

    def select(self, rows: NDArray[np.bool_] | NDArray[np.int64]) -> "CurvePoints":
        """Points that a mask or an index array names."""
        return CurvePoints(
            self.slip[rows],
            self.adhesion[rows],
            self.square[rows],
            self.count[rows],
            self.slip_var[rows],
            self.conditions.select(rows),
        )

    def compressed(self) -> "CurvePoints":
        """Means of narrow cells of slip, speed and load where the points are many."""
        if len(self) < COMPRESSED_FROM:
            return self
        speed, load = np.asarray(self.conditions.speed), np.asarray(self.conditions.load)
        known = np.where(np.isfinite(load), load, 1.0)
        cells = np.stack(
            [
                np.log(np.maximum(self.slip, SMALLEST_SLIP)) // SLIP_CELL,
                np.log(np.maximum(speed, 0.1)) // CONDITION_CELL,
                np.log(known) // CONDITION_CELL,
            ]
        ).astype(np.int64)
        cells -= cells.min(axis=1, keepdims=True)
        widths = cells.max(axis=1) + 1
        keys = (cells[0] * widths[1] + cells[1]) * widths[2] + cells[2]
        _, cell = np.unique(keys, return_inverse=True)
        count = np.bincount(cell, self.count).astype(np.float64)

        def mean(column: Array) -> Array:
            return np.asarray(np.bincount(cell, self.count * column) / count)

        return CurvePoints(
            mean(self.slip),
            mean(self.adhesion),
            mean(self.square),
            count,
            mean(self.slip_var),
            Conditions(mean(speed), mean(load)),
        )

    @classmethod
    def concatenate(cls, parts: "list[CurvePoints]") -> "CurvePoints":
        """Points of all parts."""

        def joined(columns: "list[Array | float]") -> Array:
            return np.concatenate([np.asarray(column) for column in columns])

        return cls(
            slip=joined([part.slip for part in parts]),
            adhesion=joined([part.adhesion for part in parts]),
            square=joined([part.square for part in parts]),
            count=joined([part.count for part in parts]),
            slip_var=joined([part.slip_var for part in parts]),
            conditions=Conditions(
                joined([part.conditions.speed for part in parts]),
                joined([part.conditions.load for part in parts]),
            ),
        )


def correlation_factor(residual: Array, samples: Samples) -> float:
    """Long-run variance of residuals over their variance, at least 1.

    The variance of a mean of n correlated residuals is that of n over this factor. Residuals of one
    tick of time (all axles) are summed first; the autocovariances are summed up to the first pair
    whose sum is not positive (initial positive sequence, Geyer, Statist. Sci. 7 (1992) 473).

    Args:
        residual: Residuals with a common variance, shape (n,).
        samples: Samples that they belong to, in the order of their stamps.

    """
    tick = ((samples.t_us - samples.t_us.min()) // round(TICK_S * 1e6)).astype(np.int64)
    _, tick = np.unique(tick, return_inverse=True)
    sums = np.bincount(tick, residual) / np.sqrt(np.bincount(tick))
    n = len(sums)
    power = float(residual @ residual) / len(residual)
    if n < 8 or not power > 0.0:
        return 1.0
    spectrum = np.fft.rfft(sums, 2 * n)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2)[: max(n // 4, 2)] / n
    pairs = covariance[: len(covariance) // 2 * 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    kept = pairs[: ends[0]] if len(ends) else pairs
    long_run = 2.0 * float(kept.sum()) - float(covariance[0])
    return max(long_run / power, 1.0)
