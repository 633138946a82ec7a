"""Sizes of one effect from many units: means, spread between units, and outliers.

The model is φ_u = m + δ_u + ε_u with the known variance v_u of ε_u and the variance τ² of δ_u
between units. A mean over units is DerSimonian and Laird's (Controlled Clinical Trials 7 (1986)
177-188). To find single units or vehicles that differ from all others, m and τ² are taken from the
middle of the fleet, which the few that differ do not move: the empirical null of Efron (JASA 99
(2004) 96-104).
"""

from dataclasses import dataclass

import numpy as np
import scipy

from adhesion_can.arrays import Array

CENTRAL = (0.5, 0.8)
"""Shares of the fleet whose squared deviations the spread must match; the larger spread counts."""
_CENTRAL_SQUARES = tuple(float(scipy.stats.chi2.ppf(share, 1)) for share in CENTRAL)
STEPS = 30
"""Halvings of an interval in which a spread is searched."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Centre and spread of an effect over the fleet.

    Attributes:
        center: Size in the middle of the fleet.
        variance: Variance τ² between units.
        units: Number of units with an estimate.

    """

    center: float
    variance: float
    units: int


@dataclass(frozen=True, slots=True)
class Mean:
    """Mean of an effect over units.

    Attributes:
        value: Weighted mean.
        std: Standard error, the spread between units included.
        units: Number of units with an estimate.

    """

    value: float
    std: float
    units: int


def fit_spread(size: Array, variance: Array) -> Spread:
    """Centre and spread of sizes, most of which belong to one distribution.

    Args:
        size: Size by each unit, NaN where a unit has none; shape (n,).
        variance: Variance of each size, shape (n,).

    """
    known = np.isfinite(size) & np.isfinite(variance)
    x, v = size[known], variance[known]
    if not len(x):
        return Spread(0.0, 0.0, 0)
    center, between = float(np.median(x)), 0.0
    for _ in range(3):
        between = _central_variance(x - center, v)
        center = _weighted_median(x, 1.0 / np.sqrt(np.maximum(v + between, 1e-300)))
    return Spread(center, between, len(x))


def _central_variance(deviation: Array, variance: Array) -> float:
    """Variance between units with which the central deviations are as a normal law has them."""
    between = 0.0
    for share, wanted in zip(CENTRAL, _CENTRAL_SQUARES, strict=True):
        low, high = 0.0, float(np.max(deviation**2, initial=0.0)) / wanted
        if high == 0.0 or _quantile(deviation, variance, low, share) <= wanted:
            continue
        for _ in range(STEPS):
            middle = 0.5 * (low + high)
            above = _quantile(deviation, variance, middle, share) > wanted
            low, high = (middle, high) if above else (low, middle)
        between = max(between, high)
    return between


def _quantile(deviation: Array, variance: Array, between: float, share: float) -> float:
    ratio = deviation**2 / np.maximum(variance + between, 1e-300)
    place = min(int(share * len(ratio)), len(ratio) - 1)
    return float(np.partition(ratio, place)[place])


def _weighted_median(x: Array, weight: Array) -> float:
    order = np.argsort(x, kind="stable")
    total = np.cumsum(weight[order])
    return float(x[order][np.searchsorted(total, 0.5 * total[-1])])


def pool(size: Array, variance: Array) -> Mean:
    """Mean of sizes by DerSimonian and Laird, with the interval of Hartung and Knapp.

    The standard error is never below that of the given variances alone.

    Args:
        size: Size by each unit, NaN where a unit has none; shape (n,).
        variance: Variance of each size, shape (n,).

    """
    known = np.isfinite(size) & np.isfinite(variance)
    x, v = size[known], np.maximum(variance[known], 1e-300)
    n = len(x)
    if not n:
        return Mean(0.0, np.inf, 0)
    weight = 1.0 / v
    plain = float(weight @ x / weight.sum())
    excess = float(weight @ (x - plain) ** 2) - (n - 1)
    scale = float(weight.sum() - (weight**2).sum() / weight.sum())
    between = max(excess / scale, 0.0) if scale > 0.0 else 0.0
    weight = 1.0 / (v + between)
    value = float(weight @ x / weight.sum())
    factor = float(weight @ (x - value) ** 2) / (n - 1) if n > 1 else 1.0
    return Mean(value, float(np.sqrt(max(factor, 1.0) / weight.sum())), n)
