"""Whether a force was computed from the rate of change of the vehicle speed.

A force that was measured follows m dv/dt too, where all of it drives the vehicle. But its noise is
its own. Where it was computed from the speed, it has the speed's noise, differentiated: then the
parts of both that change from row to row correlate as the rest does, and no delay between speed and
force can be distinguished from them. Differences of a high order leave the noise alone: those of a
smooth signal vanish, and for white noise of standard deviation σ the square of the k-th has the
mean σ² (2k)!/(k!)² whatever k is (M. G. Kendall, The Advanced Theory of Statistics, vol. 2, on the
variate-difference method).
"""

from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

LEAST_ROWS = 100
"""Rows without which a correlation of noise says nothing."""
SPANS = (1, 2, 3)
"""Rows on either side over which the rate of change may have been taken."""
LEAST_EXPLAINED = 0.9
"""Share of the force's variance by the rate of change of the speed, at no delay."""
LEAST_SHARED, SIGNIFICANT = 0.3, 5.0
"""Correlation of the noise of both from which it is common, and over its standard error."""
ORDER = 4
"""Order of the differences that leave the noise."""
LEAST_WHITE = 0.5
"""Variance of the noise by differences two orders higher, over that by `ORDER`, below which these
are not noise but a signal that changes quickly."""
SAME_STEP = 0.1
"""Relative deviation of a step from the median one up to which rows are evenly spaced."""


class DerivedForce(NamedTuple):
    """What says that a force was computed from the speed.

    Attributes:
        explained: Share of the force's variance by the rate of change of the speed.
        shared: Correlation of the noise of both.

    """

    explained: float
    shared: float


def find_derived_force(t_us: NDArray[np.int64], speed: Array, force: Array) -> DerivedForce | None:
    """What says that a force was computed from the rate of change of the speed; None: nothing.

    Args:
        t_us: Stamps of the rows of one axle, ascending, µs, shape (n,).
        speed: Vehicle speed, m/s, shape (n,).
        force: Force, or adhesion, in any unit, shape (n,).

    """
    steps = np.diff(t_us)
    if len(t_us) < LEAST_ROWS or not (step := float(np.median(steps))) > 0:
        return None
    even = np.abs(steps / step - 1.0) <= SAME_STEP
    if not _is_noise(speed, even):
        return None
    derived_forces = [
        resemblance
        for span in SPANS
        if (resemblance := _compare(span, speed, force, even)) is not None
    ]
    return max(derived_forces, key=lambda derived: derived.shared, default=None)


def _compare(span: int, speed: Array, force: Array, even: NDArray[np.bool_]) -> DerivedForce | None:
    """Force beside the central difference of the speed over some rows on either side."""
    rate = speed[2 * span :] - speed[: -2 * span]
    beside = force[span:-span]
    whole = _whole(even, 2 * span)
    if int(whole.sum()) < LEAST_ROWS:
        return None
    explained = correlation(rate[whole], beside[whole])
    inner = _whole(even, 2 * span + ORDER)
    noises = [np.diff(column, ORDER)[inner] for column in (rate, beside)]
    # Neighbouring differences have rows in common.
    rows = len(noises[0]) / (ORDER + 1)
    if rows < LEAST_ROWS / (ORDER + 1):
        return None
    shared = correlation(*noises)
    if explained <= 0.0 or explained**2 < LEAST_EXPLAINED:
        return None
    if shared < max(LEAST_SHARED, SIGNIFICANT / np.sqrt(rows)):
        return None
    return DerivedForce(explained**2, shared)


def _is_noise(values: Array, even: NDArray[np.bool_]) -> bool:
    """Whether high differences of a column are those of noise."""
    low, high = (
        float(np.mean(np.diff(values, k)[rows] ** 2)) / comb(2 * k, k) if rows.any() else 0.0
        for k in (ORDER, ORDER + 2)
        for rows in (_whole(even, k),)
    )
    return low > 0.0 and high >= LEAST_WHITE * low


def _whole(even: NDArray[np.bool_], steps: int) -> NDArray[np.bool_]:
    """Whether so many steps from each row on are even, shape (n − steps,)."""
    odd = np.concatenate([[0], np.cumsum(~even)])
    return np.asarray(odd[steps:] == odd[:-steps])


def correlation(values: Array, other: Array) -> float:
    """Pearson's correlation coefficient; 0 where one of the two is constant."""
    if not (np.ptp(values) > 0 and np.ptp(other) > 0):
        return 0.0
    return float(np.corrcoef(values, other)[0, 1])
