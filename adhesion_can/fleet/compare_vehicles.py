"""Vehicles that differ from all others in one effect, and by how much.

A vehicle's size is the mean over its units, weighted by the variances of the sizes and by the
spread between units; it is compared with the middle of the fleet. The spread of the vehicles' own
statistics is taken from the middle of the fleet too, so what vehicles differ by anyway is no
finding. P-values count all effects (Bonferroni), and a vehicle's smallest one counts. Vehicles are
chosen with a set expected share of wrong ones among them (Benjamini and Hochberg, Journal of the
Royal Statistical Society B 57 (1995) 289-300).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.fleet.random_effects import Spread, fit_spread

LEAST_VEHICLES = 5
"""Number of vehicles from which the fleet's middle is known well enough to compare with it."""
OUTSIDE = 1e-3
"""P-value of a vehicle, all effects counted, from which it has no part in the fleet's spread."""
FREEDOMS = (8.0, 12.0, 16.0)
"""Degrees of freedom of Student's t for the tails of a vehicle's statistic: drives differ more than
a normal law has it, and a size's variance comes from some 17 blocks of a drive."""
OUTLIER_STATISTIC, UNLIKELY = 3.0, 1e-3
"""Statistic from which the tails are counted, and probability of as few there below which a law is
left for one with lighter tails; small, since effects of a vehicle are not independent."""


@dataclass(frozen=True, eq=False)
class VehicleComparison:
    """All vehicles beside the fleet; V vehicles and k effects.

    Attributes:
        vehicles: Ids of the vehicles.
        spreads: Middle and spread of each effect between units.
        size: Mean size of each vehicle, NaN where it has none; shape (V, k).
        std: Standard error of it, the spread between units included; shape (V, k).
        statistic: Deviation from the middle in units of the fleet's own spread; shape (V, k).
        p_value: P-value of each, all effects counted; shape (V, k).

    """

    vehicles: tuple[str, ...]
    spreads: tuple[Spread, ...]
    size: Array
    std: Array
    statistic: Array
    p_value: Array

    @property
    def smallest(self) -> Array:
        """Smallest p-value of each vehicle, shape (V,)."""
        return np.asarray(self.p_value.min(axis=1, initial=1.0))


def vehicle_means(vehicle: Sequence[str], size: Array, variance: Array) -> tuple[Array, Array]:
    """Mean of each vehicle's sizes and its standard error, the spread between units included.

    Args:
        vehicle: Vehicle of each unit, n of them.
        size: Size of each effect in each unit, NaN where there is none; shape (n, k).
        variance: Variance of each size, shape (n, k).

    Returns:
        Means and standard errors, vehicles in the order of their ids; shape (V, k) each.

    """
    names, number = _number(vehicle)
    spreads = [fit_spread(size[:, j], variance[:, j]) for j in range(size.shape[1])]
    return _means(number, len(names), size, variance, np.array([s.variance for s in spreads]))


def _number(vehicle: Sequence[str]) -> tuple[list[str], NDArray[np.int64]]:
    names, number = np.unique(np.array(vehicle, dtype=np.str_), return_inverse=True)
    return [str(name) for name in names], number


def _means(
    number: NDArray[np.int64], count: int, size: Array, variance: Array, between: Array
) -> tuple[Array, Array]:
    known = np.isfinite(size)
    weight = np.where(known, 1.0 / np.maximum(np.where(known, variance, 1.0) + between, 1e-300), 0)
    total = sum_by(number, weight, count)
    seen = total > 0.0
    safe = np.where(seen, total, 1.0)
    mean = sum_by(number, weight * np.where(known, size, 0.0), count) / safe
    return np.where(seen, mean, np.nan), np.where(seen, 1.0 / np.sqrt(safe), np.nan)


def compare_vehicles(vehicle: Sequence[str], size: Array, variance: Array) -> VehicleComparison:
    """Compare each vehicle with the middle of the fleet.

    Vehicles that differ widen the spread that they are judged by. So the spreads are taken again
    without those that stand out (forward search; Hadi, Journal of the Royal Statistical Society B
    56 (1994) 393-396), until no further one does.

    Args:
        vehicle: Vehicle of each unit, n of them.
        size: Size of each effect in each unit, NaN where there is none; shape (n, k).
        variance: Variance of each size, shape (n, k).

    """
    names, number = _number(vehicle)
    left = np.ones(len(names), dtype=np.bool_)
    while True:
        compared = _compare(names, number, size, variance, left)
        outside = left & (compared.smallest <= OUTSIDE)
        if not outside.any() or (left & ~outside).sum() < max(LEAST_VEHICLES, 0.5 * len(names)):
            return compared
        left &= ~outside


def _compare(
    names: list[str],
    number: NDArray[np.int64],
    size: Array,
    variance: Array,
    left: NDArray[np.bool_],
) -> VehicleComparison:
    """Compare all vehicles with the middle of some of them."""
    effects = size.shape[1]
    rows = left[number]
    spreads = tuple(fit_spread(size[rows, j], variance[rows, j]) for j in range(effects))
    mean, std = _means(
        number, len(names), size, variance, np.array([spread.variance for spread in spreads])
    )
    z = (mean - np.array([spread.center for spread in spreads])) / std
    scale = np.ones(effects)
    for j in range(effects):
        deviations = z[left & np.isfinite(z[:, j]), j]
        if len(deviations) >= LEAST_VEHICLES:
            scale[j] = np.sqrt(1.0 + fit_spread(deviations, np.ones(len(deviations))).variance)
    statistic = z / scale
    enough = np.isfinite(z[left]).sum(axis=0) >= LEAST_VEHICLES
    known = statistic[left][np.isfinite(statistic[left])]
    tail = 2.0 * scipy.stats.t.sf(np.abs(statistic), fit_freedom(known))
    p_value = np.where(np.isfinite(statistic) & enough, np.minimum(effects * tail, 1.0), 1.0)
    return VehicleComparison(
        tuple(names), spreads, mean, std * scale, np.nan_to_num(statistic), p_value
    )


def fit_freedom(statistic: Array) -> float:
    """Degrees of freedom of Student's t with the widest tails that a fleet does not contradict.

    In a small fleet these are the widest of `FREEDOMS`. With those a vehicle of a large one would
    have to differ ever more, as ever more vehicles are compared.

    Args:
        statistic: Statistics of the vehicles that do not stand out, shape (n,).

    """
    outliers = int(np.count_nonzero(np.abs(statistic) > OUTLIER_STATISTIC))
    for freedom in FREEDOMS[:-1]:
        share = 2.0 * scipy.stats.t.sf(OUTLIER_STATISTIC, freedom)
        if scipy.stats.binom.cdf(outliers, len(statistic), share) >= UNLIKELY:
            return freedom
    return FREEDOMS[-1]


def sum_by(number: NDArray[np.int64], values: Array, count: int) -> Array:
    """Sums of rows with the same number, shape (count, k)."""
    columns = [np.bincount(number, column, minlength=count) for column in values.T]
    return np.stack(columns, axis=1) if columns else np.zeros((count, 0))


def discoveries(p_value: Array, rate: float) -> NDArray[np.bool_]:
    """Which of some hypotheses are rejected at a false discovery rate, shape of `p_value`."""
    order = np.argsort(p_value, kind="stable")
    limits = rate * np.arange(1, len(p_value) + 1) / max(len(p_value), 1)
    below = np.flatnonzero(p_value[order] <= limits)
    chosen = np.zeros(len(p_value), dtype=np.bool_)
    chosen[order[: below[-1] + 1 if len(below) else 0]] = True
    return chosen
