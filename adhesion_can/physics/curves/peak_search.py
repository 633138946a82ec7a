"""Peak of a curve by scan and slope, and a rough peak of points as a starting value of fits."""

from typing import TYPE_CHECKING

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, Peak

if TYPE_CHECKING:
    from adhesion_can.physics.curves.base import Conditions, CurveFamily, Values

SMALLEST = 1e-6
"""Slip ratio at which the search starts; a peak below it counts as none."""

_SCAN = 160
"""Points of the scan for the highest part of the curve, 9 % apart."""
_POINTS, _ROUNDS = 32, 5
"""Points of each refinement and their number: the place is exact to 1e-8."""


def find_peak(
    family: "CurveFamily", values: "Values", conditions: "Conditions", slip_max: float = SLIP_MAX
) -> Peak:
    """Highest point of a curve: a scan, and then the slope's change of sign on finer grids.

    Where the curve is highest at `slip_max` the values there are returned, where it falls from the
    start those at 0; `interior` is False in both cases.

    Args:
        family: Family of the curve.
        values: Values of the family's parameters.
        conditions: Speed and load; the result has their shape.
        slip_max: End of the valid range, slip ratio.

    """
    shape = np.broadcast(
        np.asarray(conditions.speed), np.asarray(conditions.load), *map(np.asarray, values)
    ).shape
    column = (-1, *(1,) * len(shape))
    place = np.geomspace(SMALLEST, slip_max, _SCAN).reshape(column)
    heights = np.broadcast_to(family.adhesion(place, values, conditions), (_SCAN, *shape))
    rising = np.broadcast_to(family.slope(SMALLEST, values, conditions) > 0.0, shape)
    best = np.argmax(heights, axis=0)
    logs = np.log(place.ravel())
    low, high = logs[np.maximum(best - 1, 0)], logs[np.minimum(best + 1, _SCAN - 1)]
    grid = np.linspace(0.0, 1.0, _POINTS).reshape(column)
    for _ in range(_ROUNDS):
        place = low + (high - low) * grid
        falls = np.broadcast_to(
            family.slope(np.exp(place), values, conditions) <= 0.0, place.shape
        ).copy()
        falls[-1] = True
        first = np.maximum(np.argmax(falls, axis=0), 1)[None]
        low = np.take_along_axis(place, first - 1, axis=0)[0]
        high = np.take_along_axis(place, first, axis=0)[0]
    peak_slip = np.exp(0.5 * (low + high))
    inside = rising & (peak_slip < slip_max * (1.0 - 1e-8))
    lambda_m = np.where(rising, np.where(inside, peak_slip, slip_max), 0.0)
    mu_max = np.broadcast_to(family.adhesion(lambda_m, values, conditions), shape)
    return Peak(np.asarray(mu_max), np.asarray(lambda_m), np.asarray(inside))


def rough_peak(slip: Array, adhesion: Array) -> tuple[float, float, float]:
    """Height and place of the peak of noisy points, and their slope near zero slip.

    Means over some 20 groups of neighbouring slips, each of the same number of points.

    Args:
        slip: Slip ratios λ, shape (n,).
        adhesion: Adhesion coefficients μ with the sign of the slip, shape (n,).

    Returns:
        μ_max, λ_m and dμ/dλ near zero slip, each above 0.

    """
    order = np.argsort(np.abs(slip))
    h, z = np.abs(slip)[order], (np.copysign(1.0, slip) * adhesion)[order]
    groups = max(min(20, len(h) // 3), 1)
    places = np.array([part.mean() for part in np.array_split(h, groups)])
    levels = np.array([part.mean() for part in np.array_split(z, groups)])
    best = int(np.argmax(levels))
    height, place = max(float(levels[best]), 1e-3), max(float(places[best]), 1e-4)
    rise = h <= max(0.5 * place, float(h[min(2, len(h) - 1)]))
    squares = float(h[rise] @ h[rise])
    slope = float(h[rise] @ z[rise]) / squares if squares > 0.0 else 0.0
    return height, place, max(slope, height / place)
