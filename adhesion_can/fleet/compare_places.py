"""Lines and days on which an effect has another size, on whatever vehicle.

Each vehicle's deviation on a line, in standard deviations and cut off at `CUT`, counts once, so
that one odd vehicle makes no line odd. The largest mean over effects and lines is compared with the
largest after random exchanges of the lines among the units (permutation test with the maximum
statistic; Westfall and Young, Resampling-Based Multiple Testing, 1993).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.fleet.compare_vehicles import sum_by
from adhesion_can.fleet.random_effects import fit_spread

LEAST_VEHICLES = 3
"""Number of vehicles that must have been on a line, or that drove on a day."""
CUT = 2.5
"""Limit of a unit's deviation, in standard deviations."""
EXCHANGES = 999
"""Number of random exchanges."""


@dataclass(frozen=True, eq=False)
class PlaceComparison:
    """All lines, or all days, beside the fleet; L of them and k effects.

    Attributes:
        names: Names of the lines or days that several vehicles have been on.
        size: Difference of the size there from the middle of the fleet, NaN where there is none;
            shape (L, k).
        std: Standard error of it, shape (L, k).
        p_value: P-value of each, all effects, lines and days counted; shape (L, k).

    """

    names: tuple[str, ...]
    size: Array
    std: Array
    p_value: Array


def compare_places(
    place: Sequence[str],
    vehicle: Sequence[str],
    size: Array,
    variance: Array,
    rng: np.random.Generator,
) -> PlaceComparison:
    """Compare each line, or each day, with the middle of the fleet.

    Args:
        place: Line or day of each unit, '' where it is not known; n of them.
        vehicle: Vehicle of each unit.
        size: Size of each effect in each unit, NaN where there is none; shape (n, k).
        variance: Variance of each size, shape (n, k).
        rng: Random generator of the exchanges.

    """
    stated = np.array([bool(name) for name in place], dtype=np.bool_)
    names, number = np.unique(np.array(place, dtype=np.str_)[stated], return_inverse=True)
    vehicles = np.unique(np.array(vehicle, dtype=np.str_)[stated], return_inverse=True)[1]
    deviation, weight = _standardised(size[stated], variance[stated])
    # Several drives of a vehicle on one line count once.
    pairs, inverse, drives = np.unique(
        np.stack([number, vehicles]), axis=1, return_inverse=True, return_counts=True
    )
    on = pairs[0]
    count = np.bincount(on, minlength=len(names))
    enough = count >= LEAST_VEHICLES
    effects = size.shape[1]
    if enough.sum() < 2 or not effects:
        return PlaceComparison((), *(np.empty((0, effects)) for _ in range(3)))
    values = sum_by(inverse.ravel(), deviation, len(drives)) / drives[:, None]
    starts, root = np.flatnonzero(np.diff(on, prepend=-1)), np.sqrt(count)[:, None]
    observed = np.abs(np.add.reduceat(values, starts, axis=0)) / root
    reached = np.zeros_like(observed)
    for _ in range(EXCHANGES):
        exchanged = np.add.reduceat(values[rng.permutation(len(values))], starts, axis=0)
        largest = float((np.abs(exchanged) / root)[enough].max())
        reached += largest >= observed * (1.0 - 1e-9)
    p_value = (1.0 + reached) / (EXCHANGES + 1.0)
    mean, std = _means(number, size[stated], weight, len(names))
    keep = np.flatnonzero(enough)
    return PlaceComparison(tuple(str(names[i]) for i in keep), mean[keep], std[keep], p_value[keep])


def _standardised(size: Array, variance: Array) -> tuple[Array, Array]:
    """Deviations in standard deviations, cut off, 0 where there is none; and weights; (n, k)."""
    out, weight = np.zeros_like(size), np.zeros_like(size)
    for j in range(size.shape[1]):
        spread = fit_spread(size[:, j], variance[:, j])
        known = np.isfinite(size[:, j])
        whole = variance[known, j] + spread.variance
        deviation = (size[known, j] - spread.center) / np.sqrt(np.maximum(whole, 1e-300))
        out[known, j] = np.clip(deviation, -CUT, CUT)
        weight[known, j] = 1.0 / np.maximum(whole, 1e-300)
    return out, weight


def _means(
    number: NDArray[np.int64], size: Array, weight: Array, count: int
) -> tuple[Array, Array]:
    """Difference of the mean at each place from the others' middle, and its standard error."""
    center = np.array([fit_spread(column, 1.0 / np.where(w > 0, w, np.nan)).center
                       for column, w in zip(size.T, weight.T, strict=True)])  # fmt: skip
    total = sum_by(number, weight, count)
    deviation = np.where(weight > 0.0, size - center, 0.0)
    safe = np.where(total > 0.0, total, np.nan)
    return sum_by(number, weight * deviation, count) / safe, 1.0 / np.sqrt(safe)
