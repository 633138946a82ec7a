"""Slip along the rising part of a curve: the rectangular hyperbola μ = m λ/(a + λ).

The slip a at which half of m is reached gives the elasticity everywhere, d ln λ/d ln μ = 1 + λ/a,
so that one number gives the way in which slips follow efforts (Kondner 1963, for soils).
On the ramps of 60 curves of Polach it predicts the slip at 75 to 90 % of the effort to 10 to 20 %
of its change; above the effort at which `a` was found it predicts nothing near the peak.
"""

from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array

STEEPEST = 10.0
"""Largest elasticity that is assumed: an axle with more slip is beyond the peak, or spins."""
NEAREST = 0.15
"""Smallest share of m that is left: at larger efforts the hyperbola has no slip."""


@dataclass(frozen=True, slots=True)
class MovedSlips:
    """Slips at another effort, all of one shape.

    Attributes:
        slip: Slip, of the sign that it had, 1.
        by_slip: Its derivative with respect to the slip before, 1.
        by_log_half: Its derivative with respect to ln a.

    """

    slip: Array
    by_slip: Array
    by_log_half: Array


def elasticity(slip: Array, log_half: Array) -> Array:
    """Elasticity d ln λ/d ln μ at a slip, for ln a; at most `STEEPEST`."""
    return np.asarray(np.minimum(1.0 + np.abs(slip) * np.exp(-log_half), STEEPEST))


def move(slip: Array, log_half: Array, ratio: Array) -> MovedSlips:
    """Slip after the effort was multiplied by `ratio`."""
    steep = elasticity(slip, log_half) - 1.0
    rest = 1.0 + steep * (1.0 - ratio)
    factor = ratio / np.maximum(rest, NEAREST)
    bends = (rest > NEAREST) & (steep < STEEPEST - 1.0)
    by_slip = np.where(bends, factor / np.maximum(rest, NEAREST), factor)
    by_log_half = np.where(bends, -factor * steep * (ratio - 1.0) / np.maximum(rest, NEAREST), 0.0)
    return MovedSlips(slip * factor, by_slip, slip * by_log_half)
