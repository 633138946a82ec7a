"""B-splines of the slip ratio, in which every smooth curve through the origin is linear.

Cubic B-splines in x = ln(1 + λ/h), evenly spaced (de Boor, "A Practical Guide to Splines", 1978).
Below h they are even in λ, above it even in ln λ. The first one, which alone is not 0 at λ = 0, is
left out.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import polynomial

from adhesion_can.arrays import Array

H = 0.004
"""Slip ratio h between the even and the logarithmic part of the scale."""
SLIP_MAX = 0.5
"""Largest slip ratio of the basis."""
SIZE = 23
"""Number of basis functions."""
TABLE = 1200
"""Number of steps of the table from which the functions are interpolated."""
POINTS = 240
"""Number of points of the slip grid."""

_X_MAX = float(np.log1p(SLIP_MAX / H))
_STEP = _X_MAX / (SIZE - 2)
_CUBIC = np.array([[0, 0, 0, 1], [1, 3, 3, -3], [4, 0, -6, 3], [1, -3, 3, -1]]) / 6.0
"""Coefficients of the four pieces of a cardinal cubic B-spline, in ascending powers."""


def _cardinal(u: Array) -> Array:
    """Cardinal cubic B-spline on 0..4, and 0 elsewhere; any shape."""
    piece = np.floor(u).astype(np.int64)
    inside = (piece >= 0) & (piece < len(_CUBIC))
    piece = np.where(inside, piece, 0)
    values = np.zeros_like(u)
    for k, pieces in enumerate(_CUBIC):
        values = np.where(piece == k, polynomial.polyval(u - piece, pieces), values)
    return np.where(inside, values, 0.0)


class _Tables(NamedTuple):
    """Values of the basis at the even steps of x, their slopes dB/dx, each (TABLE + 1, SIZE)."""

    values: Array
    slopes: Array


@cache
def _tables() -> _Tables:
    x = np.linspace(0.0, _X_MAX, TABLE + 1)
    # Those that are not 0 at x = 0, so combined that each is 0 there.
    u = x[:, None] / _STEP - np.arange(-3, SIZE - 2)
    raw = _cardinal(u)
    at_zero = raw[0]
    values = raw[:, 1:] - np.outer(raw[:, 0] / at_zero[0], at_zero[1:])
    return _Tables(values, np.gradient(values, x[1], axis=0))


def evaluate(slip: Array) -> tuple[Array, Array]:
    """Basis at slip ratios, and its derivative by the slip ratio.

    Args:
        slip: Slip ratios, not negative, shape (n,).

    Returns:
        Values and slopes, each of shape (n, SIZE).

    """
    tables = _tables()
    place = np.log1p(slip / H) * (TABLE / _X_MAX)
    index = np.clip(place.astype(np.int64), 0, TABLE - 1)
    share = (place - index)[:, None]
    values = tables.values[index] * (1.0 - share) + tables.values[index + 1] * share
    slopes = tables.slopes[index] * (1.0 - share) + tables.slopes[index + 1] * share
    return values, slopes / (H + slip)[:, None]


GRID: Array = H * np.expm1(np.linspace(0.0, _X_MAX, POINTS))
"""Slip ratios from 0 to `SLIP_MAX`, even in x, shape (POINTS,)."""


@cache
def grid_values() -> Array:
    """Basis on the grid, shape (POINTS, SIZE)."""
    return evaluate(GRID)[0]


@cache
def projection() -> Array:
    """Matrix from values on the grid to coefficients of the basis, shape (SIZE, POINTS).

    By least squares.
    """
    return np.asarray(np.linalg.pinv(grid_values()))
