"""A free curve with one peak: its logarithmic slope is a piecewise polynomial of ln slip.

q(u) = d ln μ/d ln λ with u = ln(λ/λ_m) is 1 at small slip (a linear start), falls through 0 at the
peak with the slope −kappa, and is negative beyond it. ln μ is its integral. Before the peak q falls
all the way, as it does in every contact law: r12 places its value at λ_m/12 between q3 and 1.
Next to the peak q is quadratic, with Bernstein coefficients of one sign; further out it is linear
between values of that sign. So the curve rises, turns once and falls whatever its values; the peak
is two of them, and its standard deviation comes straight from the fit. Five numbers of the shape
are the fewest that put the peak of computed contacts within 4 % of its slip.
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

_RISE, _FALL = (12, 3), (3, 12)
"""Nodes of q before the peak, at λ_m over these, and beyond it, at λ_m times these."""
_STRAIGHT = 64
"""λ_m over the slip below which the curve is a straight line, q = 1."""
_LEFT = np.log([*sorted(_RISE), _STRAIGHT])
_RIGHT = np.log(_FALL)
"""Distances of the nodes from the peak in ln slip, the nearest first."""
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
        Parameter("kappa", "1", 0.25, 0.0, 3.0, "curvature of the peak, - d2 ln mu/d ln slip^2"),
        Parameter(
            "r12", "1", 0.8, 0.0, 1.0, "logarithmic slope at lambda_m/12, from q3 (0) to 1 (1)"
        ),
        Parameter("q3", "1", 0.5, 0.0, 1.0, "logarithmic slope at lambda_m/3"),
        *(
            Parameter(f"p{r}", "1", typical, 0.0, 3.0, f"logarithmic fall at {r} lambda_m")
            for r, typical in zip(_FALL, (0.15, 0.35), strict=True)
        ),
    )
    prior_weight: float = 0.0

    def adhesion(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Adhesion coefficient."""
        mu_max, lambda_m, *_ = values
        lam, held, line = _split(slip, conditions)
        straight, weights = _integrals(held, lambda_m)
        log_height = straight + sum(w * x for w, x in zip(weights, _shape(values), strict=True))
        return np.asarray(np.copysign(1.0, lam) * line * mu_max * np.exp(log_height))

    def gradient(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Partial derivatives by the values."""
        mu_max, lambda_m, _, r12, q3, *_ = values
        mu = self.adhesion(slip, values, conditions)
        _, held, _ = _split(slip, conditions)
        _, (by_kappa, by_q12, by_q3, *by_fall) = _integrals(held, lambda_m)
        by_place = -_log_slope(held, values) / lambda_m
        by_r12, by_q3 = (1.0 - q3) * by_q12, by_q3 + (1.0 - r12) * by_q12
        rows = (1.0 / np.asarray(mu_max), by_place, by_kappa, by_r12, by_q3, *by_fall)
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
        shape = [p.typical for p in self.parameters[2:]]
        return [within_bounds(self, (height, place * factor, *shape)) for factor in (0.6, 1.0, 1.7)]


def _split(slip: ArrayLike, conditions: Conditions) -> tuple[Array, Array, Array]:
    """Signed slips, their sizes of at least `_TINY`, and the factor of the line below it."""
    lam = np.asarray(slip, dtype=np.float64) + 0.0 * np.asarray(conditions.speed)
    held = np.maximum(np.abs(lam), _TINY)
    return lam, held, np.abs(lam) / held


def _shape(values: Values) -> tuple[float | Array, ...]:
    """Curvature of the peak, then the size of q at each node of `_RISE` and `_FALL`."""
    _, _, kappa, r12, q3, *fall = values
    return kappa, q3 + r12 * (1.0 - q3), q3, *fall


def _log_slope(held: Array, values: Values) -> Array:
    """Logarithmic slope q at slips of at least `_TINY`."""
    lambda_m = values[1]
    kappa, *nodes = _shape(values)
    u = np.log(held / lambda_m)
    rise, fall = (1.0, *nodes[: len(_RISE)]), (*nodes[len(_RISE) :],)
    q: Array = np.asarray(0.0 * u)
    for places, levels, sign in ((_LEFT, rise[::-1], 1.0), (_RIGHT, fall, -1.0)):
        t = np.maximum(-sign * u, 0.0)  # distance from the peak
        near = np.minimum(t, places[0]) / places[0]
        side = kappa * places[0] * near * (1.0 - near) + levels[0] * near**2
        for (a, b), (low, high) in zip(pairwise(places), pairwise(levels), strict=True):
            side = side + np.clip((t - a) / (b - a), 0.0, 1.0) * (high - low)
        q = q + sign * side
    return q


def _integrals(held: Array, lambda_m: float | Array) -> tuple[Array, list[Array]]:
    """Integral of q from the peak to each slip: the known part, and that of each shape value.

    The known part is that of the node at the straight start.
    """
    u = np.log(held / lambda_m)
    by_kappa: Array = np.asarray(0.0 * u)
    sides = []
    for places in (_LEFT, _RIGHT):
        t = np.maximum(-u if places is _LEFT else u, 0.0)
        near = np.minimum(t, places[0]) / places[0]
        # On both sides ln μ falls away from the peak.
        by_kappa = by_kappa - places[0] ** 2 * (near**2 / 2.0 - near**3 / 3.0)
        weights = [places[0] * near**3 / 3.0, *(0.0 * t for _ in places[1:])]
        for k, (a, b) in enumerate(pairwise(places)):
            x = np.clip(t - a, 0.0, b - a)
            weights[k] = weights[k] + x - x * x / (2.0 * (b - a))
            weights[k + 1] = weights[k + 1] + x * x / (2.0 * (b - a))
        weights[-1] = weights[-1] + np.maximum(t - places[-1], 0.0)
        sides.append([-w for w in weights])
    left, right = sides
    return left[-1], [by_kappa, *left[-2::-1], *right]
