"""The magic formula: μ = D sin(C arctan(B λ − E (B λ − arctan(B λ))))."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, Peak
from adhesion_can.physics.curves.base import Conditions, Values, within_bounds
from adhesion_can.physics.curves.peak_search import find_peak, rough_peak
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class MagicFormula:
    """D sin(C arctan(B λ − E (B λ − arctan(B λ)))): the same at every speed and load."""

    name: str = "magic_formula"
    title: str = "magic formula"
    literature: str = "Bakker, Nyborg & Pacejka, SAE 870421 (1987)"
    parameters: tuple[Parameter, ...] = (
        Parameter("B", "1", 60.0, 0.5, 5000.0, "stiffness, per unit of slip").lognormal(60.0, 1.0),
        Parameter("C", "1", 1.3, 0.5, 2.0, "shape: how far the curve falls beyond its peak").normal(
            1.3, 0.3
        ),
        Parameter("D", "1", 0.4, 1e-6, 10.0, "adhesion at the peak").lognormal(0.4, 0.6),
        Parameter("E", "1", 0.0, -30.0, 1.0, "curvature near the peak").normal(0.0, 1.5),
    )
    prior_weight: float = 0.1

    def adhesion(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Adhesion coefficient."""
        b, c, d, e = values
        x = b * (np.asarray(slip, dtype=np.float64) + 0.0 * np.asarray(conditions.speed))
        return np.asarray(d * np.sin(c * np.arctan(x - e * (x - np.arctan(x)))))

    def gradient(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Partial derivatives by B, C, D, E."""
        b, c, d, e = values
        lam = np.asarray(slip, dtype=np.float64) + 0.0 * np.asarray(conditions.speed)
        x = b * lam
        bent = x - np.arctan(x)
        y = x - e * bent
        angle = c * np.arctan(y)
        by_y = d * np.cos(angle) * c / (1.0 + y * y)
        y_by_x = 1.0 - e * x * x / (1.0 + x * x)
        rows = (
            by_y * y_by_x * lam,
            d * np.cos(angle) * np.arctan(y),
            np.sin(angle),
            -by_y * bent,
        )
        return np.stack(np.broadcast_arrays(*rows))

    def slope(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Slope over slip."""
        b, c, d, e = values
        x = b * (np.abs(np.asarray(slip, dtype=np.float64)) + 0.0 * np.asarray(conditions.speed))
        y = x - e * (x - np.arctan(x))
        inner = 1.0 - e * x * x / (1.0 + x * x)
        return np.asarray(d * np.cos(c * np.arctan(y)) * c / (1.0 + y * y) * inner * b)

    def peak(self, values: Values, conditions: Conditions, slip_max: float = SLIP_MAX) -> Peak:
        """Peak, by search."""
        return find_peak(self, values, conditions, slip_max)

    def starts(
        self, slip: Array, adhesion: Array, conditions: Conditions
    ) -> Sequence[tuple[float, ...]]:
        """Curves through the rough peak of the points, of different fall and curvature.

        The peak lies where C arctan(y) = π/2 with y = B λ − E(B λ − arctan(B λ)).
        """
        del conditions
        height, place, _ = rough_peak(slip, adhesion)
        starts = []
        for c in (1.2, 1.5, 1.8):
            for e in (0.5, 0.0, -2.0):
                x = np.geomspace(1e-2, 1e3, 400)
                y = x - e * (x - np.arctan(x))
                b = float(np.interp(np.tan(pi / (2.0 * c)), y, x)) / place
                starts.append(within_bounds(self, (b, c, height, e)))
        return starts
