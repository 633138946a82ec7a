"""Peak of a curve by its slope, and a rough peak of points as a starting value of fits."""

from typing import TYPE_CHECKING

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, Peak

if TYPE_CHECKING:
    from adhesion_can.physics.curves.base import Conditions, CurveFamily, Values

SMALLEST = 1e-6
"""Slip ratio at which the search begins; a peak below it counts as none."""

_POINTS, _ROUNDS = 48, 7
_GRID = np.linspace(0.0, 1.0, _POINTS)


def find_peak(
    family: "CurveFamily", values: "Values", conditions: "Conditions", slip_max: float = SLIP_MAX
) -> Peak:
    """First slip ratio at which the slope of a curve turns negative, by a grid that is refined.

    The curve is taken to rise and fall once. Where it still rises at `slip_max` the values there
    are returned, where it falls from the start those at 0; `interior` is False in both cases.

    Args:
        family: Family of the curve.
        values: Values of the family's parameters.
        conditions: Speed and load; the result has their shape.
        slip_max: End of the valid range, slip ratio.

    """
    shape = np.broadcast(
        np.asarray(conditions.speed), np.asarray(conditions.load), *map(np.asarray, values)
    ).shape
    low, high = np.full(shape, np.log(SMALLEST)), np.full(shape, np.log(slip_max))
    rising = np.broadcast_to(family.slope(np.exp(low), values, conditions) > 0.0, shape)
    grid = _GRID.reshape(-1, *(1,) * len(shape))
    for _ in range(_ROUNDS):
        place = low + (high - low) * grid
        falls = family.slope(np.exp(place), values, conditions) <= 0.0
        falls[-1] = True
        first = np.maximum(np.argmax(falls, axis=0), 1)[None]
        low = np.take_along_axis(place, first - 1, axis=0)[0]
        high = np.take_along_axis(place, first, axis=0)[0]
    found = np.exp(0.5 * (low + high))
    inside = rising & (found < slip_max * (1.0 - 1e-9))
    lambda_m = np.where(rising, np.where(inside, found, slip_max), 0.0)
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
