"""Points of a curve from binned samples, with the errors of the slips removed.

Where slips have errors, the samples of a bin have other true slips on average than measured ones:
more of them come from where more samples are. By Tweedie's formula the mean true slip at a measured
one is s + p (ln q)'(s), with the variance p of the error and the density q of the measured slips
(Efron, Journal of the American Statistical Association 106 (2011)); to put it in place of the
measured slip is regression calibration (Carroll et al., Measurement Error in Nonlinear Models,
2006). What is left scatters about it with the variance p, and the slips of a bin about their mean:
over both the curve is averaged.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.curves.binned_samples import (
    ADHESION,
    ADHESION_VAR,
    COUNT,
    LOAD,
    SLIP,
    SLIP_EDGES,
    SLIP_SQUARE,
    SLIP_VAR,
    SLIPS,
    SPEED,
    SPEEDS,
    BinnedSamples,
)
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.curves import Conditions, CurveFamily

LEAST_SLIPS = 2.0
"""Mean slip over its standard error below which a bin is left out: its sign is not sure."""
FEWEST = 3.0
"""Number of samples below which a bin is left out."""

CurveFunction = Callable[[Array, Array, Conditions], Array]
"""Adhesion, slope or gradient of a family: of slips, values and conditions."""


class BinnedPoints(NamedTuple):
    """Points of a curve, each from the samples of one bin; shape (n,) each.

    Attributes:
        rows: Indices of the bins that give a point.
        slip: Mean true slip.
        slip_std: Standard deviation of the true slips about it.
        adhesion: Mean adhesion.
        weight: Inverse variance of the mean adhesion, of independent errors.
        conditions: Mean speed and load.

    """

    rows: NDArray[np.int64]
    slip: Array
    slip_std: Array
    adhesion: Array
    weight: Array
    conditions: Conditions

    def average(self, function: CurveFunction, values: Array) -> Array:
        """A function of the slip averaged over the scatter of the slips, shape (..., n)."""
        above = function(self.slip + self.slip_std, values, self.conditions)
        below = function(self.slip - self.slip_std, values, self.conditions)
        return 0.5 * (above + below)

    def predict(self, family: CurveFamily, values: Array) -> Array:
        """Mean adhesion of the points on a curve, shape (n,)."""
        return self.average(family.adhesion, values)


def build_points(binned: BinnedSamples, theta: CurveParameters) -> BinnedPoints:
    """Points of the curve from binned samples.

    Args:
        binned: Sums of the samples by bins.
        theta: Parameters (c1, c2, c3) of a curve nearby, whose slopes weight the slips' errors.

    """
    count = binned.sums[COUNT]
    rows_of_means = (SLIP, ADHESION, SPEED, LOAD, SLIP_VAR, ADHESION_VAR, SLIP_SQUARE)
    slip, adhesion, speed, load, var, adhesion_var, square = (
        binned.sums[row] / count for row in rows_of_means
    )
    true_slip = slip + var * _density_slope(binned, slip)
    # About their mean the true slips scatter by the bin's width, and by the errors of the measured.
    scatter = np.sqrt(np.maximum(square - slip * slip, 0.0) + var)
    c1, c2, c3 = theta
    slope = c1 * c2 * np.exp(-c2 * slip) - c3
    good = (slip > LEAST_SLIPS * np.sqrt(var)) & (count >= FEWEST) & (true_slip > 0.3 * slip)
    rows = np.flatnonzero(good).astype(np.int64)
    return BinnedPoints(
        rows,
        true_slip[rows],
        np.minimum(scatter, 0.9 * true_slip)[rows],
        adhesion[rows],
        (count / (adhesion_var + slope * slope * var))[rows],
        Conditions(speed[rows], load[rows]),
    )


def _density_slope(binned: BinnedSamples, slip: Array) -> Array:
    """Derivative of the logarithm of the density of the measured slips, all speeds together."""
    counts = np.bincount(binned.place // SPEEDS, binned.sums[COUNT], SLIPS)[1:-1]
    width = np.diff(SLIP_EDGES)
    middle = np.sqrt(SLIP_EDGES[1:] * SLIP_EDGES[:-1])
    # Over the logarithm of the slip, where the bins are even; a few samples keep it finite.
    log_density = np.log(np.convolve(counts + 0.5, [0.25, 0.5, 0.25], "same") / width)
    by_log = np.gradient(log_density, np.log(middle))
    size = np.maximum(slip, middle[0])
    return np.asarray(np.interp(np.log(size), np.log(middle), by_log) / size)
