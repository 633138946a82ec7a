"""A free unimodal curve: its logarithmic slope is a piecewise linear function of ln slip.

q(u) = d ln μ/d ln λ with u = ln(λ/λ_m) is 1 at small slip (a linear start), 0 at the peak, between
0 and 1 before it and at most 0 beyond it. ln μ is the integral of q, a quadratic spline in ln slip.
So the curve rises, turns once and falls whatever its values, and the peak is two of them: its
standard deviation comes straight from the fit. Six numbers are the fewest that bend the rise and
the fall twice each.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, Peak
from adhesion_can.physics.curves.base import Conditions, Values, within_bounds
from adhesion_can.physics.curves.peak_search import rough_peak
from adhesion_can.physics.parameter import Parameter

_RATIO = 4.0
_NODES = np.log(_RATIO) * np.array([-3.0, -2.0, -1.0, 0.0, 1.0, 2.0])
"""Places of the nodes of q, ln(λ/λ_m): slips of 1/64, 1/16, 1/4, 1, 4 and 16 times λ_m."""
_TINY = 1e-9
"""Slip ratio below which the curve is a straight line."""


@dataclass(frozen=True, slots=True)
class Free:
    """Spline in ln slip that rises, turns once and falls: the same at every speed and load."""

    name: str = "free"
    title: str = "free curve with one peak"
    literature: str = "quadratic spline of ln adhesion in ln slip with a sign constraint"
    parameters: tuple[Parameter, ...] = (
        Parameter("mu_max", "1", 0.4, 1e-6, 10.0, "adhesion at the peak"),
        Parameter("lambda_m", "1", 0.03, 1e-4, 1.0, "slip ratio of the peak"),
        Parameter("q16", "1", 0.9, 0.0, 1.0, "logarithmic slope at a sixteenth of lambda_m"),
        Parameter("q4", "1", 0.6, 0.0, 1.0, "logarithmic slope at a quarter of lambda_m"),
        Parameter("p4", "1", 0.1, 0.0, 3.0, "logarithmic fall at 4 lambda_m"),
        Parameter("p16", "1", 0.3, 0.0, 3.0, "logarithmic fall at 16 lambda_m"),
    )

    def adhesion(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Adhesion coefficient."""
        mu_max, lambda_m, *_ = values
        lam, held, line = _split(slip, conditions)
        q = _log_slopes(values)
        log_height = sum(w * node for w, node in zip(_weights(held, lambda_m), q, strict=True))
        return np.asarray(np.copysign(1.0, lam) * line * mu_max * np.exp(log_height))

    def gradient(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Partial derivatives by the values."""
        mu_max, lambda_m, *_ = values
        mu = self.adhesion(slip, values, conditions)
        _, held, _ = _split(slip, conditions)
        _, w16, w4, _, f4, f16 = _weights(held, lambda_m)
        by_place = -_log_slope(held, values) / lambda_m
        rows = (1.0 / np.asarray(mu_max), by_place, w16, w4, -f4, -f16)
        return np.stack(np.broadcast_arrays(*(mu * row for row in rows)))

    def slope(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Slope over slip."""
        _, held, _ = _split(slip, conditions)
        mu = self.adhesion(held, values, conditions)
        return np.asarray(mu / held * _log_slope(held, values))

    def peak(self, values: Values, conditions: Conditions, slip_max: float = SLIP_MAX) -> Peak:
        """Peak: two of the values, unless it lies beyond the range."""
        lambda_m = np.asarray(values[1]) + 0.0 * np.asarray(conditions.speed)
        inside = lambda_m <= slip_max
        place = np.minimum(lambda_m, slip_max)
        return Peak(self.adhesion(place, values, conditions), place, np.asarray(inside))

    def starts(
        self, slip: Array, adhesion: Array, conditions: Conditions
    ) -> Sequence[tuple[float, ...]]:
        """Curves with the rough peak of the points, three of different place."""
        del conditions
        height, place, _ = rough_peak(slip, adhesion)
        return [
            within_bounds(self, (height, place * factor, 0.9, 0.6, 0.1, 0.3))
            for factor in (0.6, 1.0, 1.7)
        ]


def _split(slip: ArrayLike, conditions: Conditions) -> tuple[Array, Array, Array]:
    """Signed slips, their sizes of at least `_TINY`, and the factor of the line below it."""
    lam = np.asarray(slip, dtype=np.float64) + 0.0 * np.asarray(conditions.speed)
    held = np.maximum(np.abs(lam), _TINY)
    return lam, held, np.abs(lam) / held


def _log_slopes(values: Values) -> tuple[float | Array, ...]:
    """Logarithmic slope at each of `_NODES`."""
    _, _, q16, q4, p4, p16 = values
    return 1.0, q16, q4, 0.0, -p4, -p16


def _log_slope(held: Array, values: Values) -> Array:
    """Logarithmic slope q at slips: linear between the nodes, constant beyond them."""
    u = np.log(held / values[1])
    q = _log_slopes(values)
    result: Array = np.asarray(q[0] + 0.0 * u)
    for left, (low, high) in enumerate(pairwise(_NODES)):
        share = np.clip((u - low) / (high - low), 0.0, 1.0)
        result = result + share * (q[left + 1] - q[left])
    return result


def _weights(held: Array, lambda_m: float | Array) -> list[Array]:
    """Integral from the peak to each slip of the hat function of each node."""
    u = np.log(held / lambda_m)
    zero = 0.0 * u
    weights = [zero] * len(_NODES)
    for left, (low, high) in enumerate(pairwise(_NODES)):
        width, right = high - low, left + 1
        if low >= 0.0:  # beyond the peak: from the left end of the piece to u
            x = np.clip(u - low, 0.0, width)
            to_right, to_left = x * x / (2.0 * width), x - x * x / (2.0 * width)
        else:  # before it: from u to the right end, backwards
            x = np.clip(high - u, 0.0, width)
            to_left, to_right = -x * x / (2.0 * width), -x + x * x / (2.0 * width)
        weights[left] = weights[left] + to_left
        weights[right] = weights[right] + to_right
    weights[0] = weights[0] + np.minimum(u - _NODES[0], 0.0)
    weights[-1] = weights[-1] + np.maximum(u - _NODES[-1], 0.0)
    return weights
