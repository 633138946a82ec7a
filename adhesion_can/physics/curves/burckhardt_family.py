"""Burckhardt's curve as a family: μ = c1(1 − e^(−c2 λ)) − c3 λ."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, Peak, adhesion, adhesion_slope, peak
from adhesion_can.physics.curves.base import Conditions, Values, within_bounds
from adhesion_can.physics.curves.peak_search import rough_peak
from adhesion_can.physics.parameter import Parameter

C1 = Parameter("c1", "1", 0.4, 1e-6, 10.0, "level of the curve", linear=True).lognormal(0.35, 0.6)
C2 = Parameter("c2", "1", 60.0, 1.0, 1000.0, "steepness, per unit of slip").lognormal(45.0, 0.7)
C3 = Parameter("c3", "1", 0.3, 0.0, 10.0, "fall beyond the peak, per unit of slip").lognormal(
    0.3, 1.2
)


@dataclass(frozen=True, slots=True)
class Burckhardt:
    """c1(1 − e^(−c2 λ)) − c3 λ: the same at every speed and load."""

    name: str = "burckhardt"
    title: str = "Burckhardt"
    literature: str = "Burckhardt 1993, eq. 5 of He et al. 2018"
    parameters: tuple[Parameter, ...] = (C1, C2, C3)
    prior_weight: float = 0.7

    def adhesion(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Adhesion coefficient."""
        return np.asarray(adhesion(slip, *values) + 0.0 * np.asarray(conditions.speed))

    def gradient(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Partial derivatives by c1, c2, c3."""
        c1, c2, _ = values
        lam = np.asarray(slip, dtype=np.float64) + 0.0 * np.asarray(conditions.speed)
        h = np.abs(lam)
        decay = np.exp(-np.asarray(c2) * h)
        sign = np.copysign(1.0, lam)
        return np.stack([sign * (1.0 - decay), lam * c1 * decay, -lam + 0.0 * decay])

    def slope(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Slope over slip."""
        return np.asarray(adhesion_slope(slip, *values) + 0.0 * np.asarray(conditions.speed))

    def peak(self, values: Values, conditions: Conditions, slip_max: float = SLIP_MAX) -> Peak:
        """Peak in closed form (eq. 6)."""
        c1, c2, c3 = values
        return peak(np.asarray(c1) + 0.0 * np.asarray(conditions.speed), c2, c3, slip_max)

    def starts(
        self, slip: Array, adhesion: Array, conditions: Conditions
    ) -> Sequence[tuple[float, ...]]:
        """Curves through the rough peak of the points, three of different steepness."""
        del conditions
        height, place, _ = rough_peak(slip, adhesion)
        return [within_bounds(self, curve_with_peak(height, place, x)) for x in (1.5, 3.0, 5.0)]


def curve_with_peak(mu_max: float, lambda_m: float, exponent: float) -> tuple[float, float, float]:
    """(c1, c2, c3) of the curve with a given peak and c2·λ_m.

    At the peak c3 = c1 c2 e^(−x) with x = c2 λ_m, so μ_max = c1 (1 − (1 + x) e^(−x)).

    Args:
        mu_max: Adhesion at the peak.
        lambda_m: Slip ratio of the peak, > 0.
        exponent: Product c2·λ_m, > 0; the larger, the flatter the curve beyond its peak.

    """
    decay = float(np.exp(-exponent))
    c1 = mu_max / (1.0 - (1.0 + exponent) * decay)
    c2 = exponent / lambda_m
    return c1, c2, c1 * c2 * decay
