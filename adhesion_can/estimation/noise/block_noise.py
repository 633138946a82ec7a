"""Noise of a block of samples, by differences, as ratios to the variances that the samples state.

The rim's speed r ω = (1 + λ) v of an axle has the error of its wheel speed alone; the vehicle speed
is a straight line between two of its frames, and one sample of each such group has a known share
of their two errors. So the private and the common error of the slip are separated.
"""

from dataclasses import dataclass
from math import comb
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.differences import REGULAR, freedom_share
from adhesion_can.values import Value

ORDER = 4
"""Order of the differences."""
FAR_ORDER, FAR = 3, 3
"""Order and stride of the differences of the adhesion: neighbours share readings of the effort
between which they stand, and wheel speeds from which their dω/dt comes."""
LONG = 6
"""Stride of the differences of the vehicle speed that show errors that last."""
LEAST_DIFFERENCES = 6
"""Number of differences below which a block says nothing of a sensor."""
_WEIGHTS = np.array([(-1.0) ** j * comb(ORDER, j) for j in range(ORDER + 1)])
_SQUARE = float(_WEIGHTS @ _WEIGHTS)


class Ratio(NamedTuple):
    """Variance that samples show over the one that they state.

    Attributes:
        value: Ratio; NaN where the block does not show it.
        freedom: Degrees of freedom of the variance.

    """

    value: float
    freedom: float


UNKNOWN = Ratio(np.nan, 0.0)


@dataclass(frozen=True, slots=True)
class BlockNoise(Value):
    """Ratios of one block of samples.

    Attributes:
        private: Ratio of the variance of the wheel speeds.
        common: Ratio of the variance of the vehicle speed.
        common_long: Ratio of the variance of the vehicle speed's changes over a longer time, its
            motion included; NaN where the block is too short.
        adhesion: Ratio of the variance of the adhesion.

    """

    private: Ratio
    common: Ratio
    common_long: Ratio
    adhesion: Ratio


def measure_noise(samples: Samples) -> BlockNoise:
    """Noise of a block of samples.

    Args:
        samples: Samples of about a second, in any order, at least one.

    """
    # By axle and stamp: differences go along an axle.
    order = np.lexsort((samples.t_us, samples.axle))
    axle, t_us = samples.axle[order], samples.t_us[order]
    rim = (1.0 + samples.slip[order]) * samples.speed[order]
    stated = samples.slip_var[order] * samples.speed[order] ** 2
    private = _ratio(t_us, axle, rim, stated, ORDER, 1)
    further = samples.adhesion_var[order]
    adhesion = _ratio(t_us, axle, samples.adhesion[order], further, FAR_ORDER, FAR)
    common, common_long = _vehicle_speed(samples)
    return BlockNoise(private, common, common_long, adhesion)


def _vehicle_speed(samples: Samples) -> tuple[Ratio, Ratio]:
    """Ratio of the variance of the vehicle speed, and that over a longer time."""
    order = np.argsort(samples.t_us, kind="stable")
    # The slip of a wheel at rest is -1 at any vehicle speed: it tells nothing of its variance.
    order = order[samples.slip[order] > -1.0]
    stamp = samples.speed_us[order]
    # The latest sample of each group; the last group may go on in the next block.
    rows = order[np.flatnonzero(stamp[1:] > stamp[:-1])]
    if len(rows) <= ORDER:
        return UNKNOWN, UNKNOWN
    speed, share = samples.speed[rows], float(samples.speed_share[rows].mean())
    stated = samples.slip_common_var[rows] * (speed / (1.0 + samples.slip[rows])) ** 2
    no_axle = np.zeros(len(rows), dtype=np.int64)
    # A mixture of the errors of two frames: (1 − s) e_k + s e_(k+1).
    mixed = np.convolve(_WEIGHTS, [share, 1.0 - share])
    gain = float(mixed @ mixed) / _SQUARE
    mean = share * share + (1.0 - share) ** 2
    t_us = samples.t_us[rows]
    near = _ratio(t_us, no_axle, speed, gain * stated, ORDER, 1)
    return near, _ratio(t_us, no_axle, speed, mean * stated, FAR_ORDER, LONG)


def _ratio(
    t_us: NDArray[np.int64],
    axle: NDArray[np.int64],
    value: Array,
    var: Array,
    order: int,
    step: int,
) -> Ratio:
    """Mean square of differences over the stated variance.

    Args:
        t_us: Stamps, µs, ascending within an axle, shape (n,).
        axle: Number of the axle, or any number that is constant in what belongs together, (n,).
        value: Values, shape (n,).
        var: Stated variances, shape (n,).
        order: Order of the differences.
        step: Number of values from one point of a difference to the next.

    """
    reach = order * step
    if len(value) <= reach or not var.all():
        return UNKNOWN
    d = value
    for _ in range(order):
        d = d[step:] - d[:-step]
    apart = t_us[1:] - t_us[:-1]
    inside = apart[axle[1:] == axle[:-1]]
    cycle_us = float(np.median(inside)) if len(inside) else 0.0
    span = t_us[reach:] - t_us[:-reach]
    whole = (axle[reach:] == axle[:-reach]) & (span <= REGULAR * reach * cycle_us)
    whole &= np.isfinite(d)
    count = int(whole.sum())
    if count < LEAST_DIFFERENCES:
        return UNKNOWN
    middle = var[reach // 2 : reach // 2 + len(d)][whole]
    square = float(np.mean(d[whole] ** 2 / middle)) / comb(2 * order, order)
    return Ratio(square, max(count * freedom_share(order), 1.0))
