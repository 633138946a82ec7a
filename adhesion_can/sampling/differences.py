"""Variance of the noise of a signal from its differences, without a model of its motion.

A difference of order m removes a motion that is a polynomial of degree m − 1 within m + 1 readings;
with weights of unit norm white noise of variance σ² leaves it with variance σ² (Hall, Kay &
Titterington, Biometrika 77 (1990) 521). Differences over several readings (a stride) show errors
that last, as the Allan variance does. Motion that is no polynomial, such as the jump of a slipping
wheel, is in few blocks of time: the variance is a low quantile of those of the blocks.
"""

from math import comb
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array

QUANTILE = 0.3
"""Share of the blocks that lie below the variance, corrected for the scatter of the blocks."""
_NORMAL_QUANTILE = -0.5244005127080409
"""Quantile of the standard normal distribution at `QUANTILE`."""
REGULAR = 1.5
"""Span of a difference over that of regular readings from which a reading is missing in it."""


class BlockVariance(NamedTuple):
    """Variance from blocks of differences.

    Attributes:
        var: Variance of the noise; NaN without a block.
        std_error: Relative standard error of the variance, of its scatter alone.
        blocks: Number of blocks.

    """

    var: float
    std_error: float
    blocks: int


def differences(t_s: Array, value: Array, order: int, stride: int, cycle_s: float) -> Array:
    """Divided differences with weights of unit norm, along the last axis.

    Args:
        t_s: Stamps, s, ascending, shape (.., n).
        value: Values, NaN where not available, shape (.., n).
        order: Order m of the differences.
        stride: Number of readings from one point of a difference to the next.
        cycle_s: Time from one reading to the next, s.

    Returns:
        Differences, NaN where a reading is missing, shape (.., n − m stride).

    """
    count = t_s.shape[-1] - order * stride
    if count <= 0:
        return np.empty((*t_s.shape[:-1], 0))
    ends = [slice(j * stride, j * stride + count) for j in range(order + 1)]
    times = [t_s[..., end] for end in ends]
    total, square = np.zeros_like(times[0]), np.zeros_like(times[0])
    unit = cycle_s * stride
    for j, end in enumerate(ends):
        weight = np.ones_like(total)
        for i, other in enumerate(times):
            if i != j:
                apart = (times[j] - other) / unit
                weight /= np.where(apart == 0.0, np.nan, apart)
        total += weight * value[..., end]
        square += weight * weight
    whole = times[-1] - times[0] <= REGULAR * order * unit
    return np.where(whole, total / np.sqrt(square), np.nan)


def freedom_share(order: int) -> float:
    """Degrees of freedom of a mean square of differences of white noise, per difference.

    1/Σ ρ² with the autocorrelations ρ(k) = C(2m, m + k)/C(2m, m) of differences that are k strides
    apart; others are independent.
    """
    rho = [comb(2 * order, order + k) / comb(2 * order, order) for k in range(order + 1)]
    return 1.0 / (2.0 * sum(r * r for r in rho) - 1.0)


def block_means(squares: Array, size: int) -> Array:
    """Means of blocks of squares or products along the last axis, shape (blocks,).

    Blocks with less than half of their values are left out.

    Args:
        squares: Squares of differences, NaN where a reading is missing, shape (.., n).
        size: Number of differences in a block.

    """
    count = squares.shape[-1] // size
    if not count:
        return np.empty(0)
    blocks = squares[..., : count * size].reshape(-1, size)
    known = np.isfinite(blocks)
    number = known.sum(axis=1)
    kept = number >= size / 2
    return np.asarray(np.where(known, blocks, 0.0).sum(axis=1)[kept] / number[kept])


def low_quantile(means: Array, freedom: float) -> BlockVariance:
    """Variance from means of squares of blocks, some of which hold more than noise.

    The quantile of χ² with the blocks' degrees of freedom is Wilson and Hilferty's.

    Args:
        means: Mean squares of blocks, shape (n,).
        freedom: Degrees of freedom of each of them.

    """
    if not len(means):
        return BlockVariance(np.nan, np.inf, 0)
    spread = 2.0 / (9.0 * freedom)
    expected = max(1.0 - spread + _NORMAL_QUANTILE * spread**0.5, 0.1) ** 3
    # A quantile of n values of a normal scatter has 1.3 times the standard error of their mean.
    error = float(1.3 * (2.0 / (freedom * len(means))) ** 0.5)
    return BlockVariance(float(np.quantile(means, QUANTILE)) / expected, error, len(means))
