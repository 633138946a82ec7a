"""Polach's curve: reduced stiffness at small slip, friction that falls with creep speed.

μ(λ) = (2 f/π)(kA ε/(1 + (kA ε)²) + arctan(kS ε)),  ε = (π/4) s0 λ/f,
f = mu0 ((1 − A) e^(−B w) + A),  w = |λ| v,
with s0 = G a b c11/Q the slope of a clean contact at zero slip (`physics.contact_stiffness`); with
kA = kS = 1 the curve starts at it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, Peak
from adhesion_can.physics.contact_stiffness import AXIS_RATIO, initial_stiffness
from adhesion_can.physics.curves.base import Conditions, Values, within_bounds
from adhesion_can.physics.curves.peak_search import find_peak, rough_peak
from adhesion_can.physics.parameter import Parameter

WHEEL_RADIUS = 0.625
"""Wheel radius where none is given, m."""
LEAST_FRICTION = 1e-9
"""Friction coefficient below which friction counts as this: ε would overflow."""


@dataclass(frozen=True, slots=True)
class Polach:
    """Polach's form with falling friction and reduced initial slope.

    Where the load is unknown, the stiffness is that at a reference load, and kA and kS are factors
    of it without a meaning of their own.

    Attributes:
        wheel_radius: Rolling radius of the wheels, m.
        axis_ratio: Ratio a/b of the semi-axes of the contact ellipse, along over across.

    """

    wheel_radius: float = WHEEL_RADIUS
    axis_ratio: float = AXIS_RATIO
    name: str = "polach"
    title: str = "Polach"
    literature: str = "Polach, Wear 258 (2005) 992-1000"
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "kA", "1", 0.6, 0.005, 5.0, "reduction of the stiffness where the contact adheres"
        ).lognormal(0.5, 1.0),
        Parameter(
            "kS", "1", 0.25, 0.005, 5.0, "reduction of the stiffness where it slips, <= kA"
        ).lognormal(0.2, 1.0),
        Parameter(
            "mu0", "1", 0.4, 0.005, 3.0, "friction coefficient at zero creep speed"
        ).lognormal(0.4, 0.6),
        Parameter("A", "1", 0.4, 0.0, 1.0, "share of the friction left at high creep speed").normal(
            0.4, 0.25
        ),
        Parameter(
            "B", "s/m", 0.4, 0.0, 60.0, "rate at which friction falls with creep speed"
        ).lognormal(0.4, 1.0),
    )
    prior_weight: float = 0.1

    def adhesion(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Adhesion coefficient."""
        k_a, k_s, *friction = values
        lam = np.asarray(slip, dtype=np.float64)
        f, _ = _friction(np.abs(lam), friction, conditions)
        x = self._strain(np.abs(lam), conditions) / f
        return np.asarray(np.copysign(2.0 / pi, lam) * f * _saturation(x, k_a, k_s))

    def gradient(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Partial derivatives by kA, kS, mu0, A, B."""
        k_a, k_s, *friction = values
        mu0, left, rate = friction
        lam = np.asarray(slip, dtype=np.float64)
        size = np.abs(lam)
        f, _ = _friction(size, friction, conditions)
        x = self._strain(size, conditions) / f
        a, s = k_a * x, k_s * x
        by_k_a = f * x * (1.0 - a * a) / (1.0 + a * a) ** 2
        by_k_s = f * x / (1.0 + s * s)
        # ε falls as f grows, so only a part of the change of f arrives.
        by_f = _saturation(x, k_a, k_s) - x * _saturation_slope(x, k_a, k_s)
        creep = size * np.asarray(conditions.speed)
        decay = np.exp(-rate * creep)
        rows = np.broadcast_arrays(
            by_k_a,
            by_k_s,
            by_f * f / mu0,
            by_f * mu0 * (1.0 - decay),
            -by_f * mu0 * (1.0 - left) * creep * decay,
        )
        return np.asarray(np.copysign(2.0 / pi, lam) * np.stack(rows))

    def slope(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Slope over slip."""
        k_a, k_s, *friction = values
        size = np.abs(np.asarray(slip, dtype=np.float64))
        f, f_slope = _friction(size, friction, conditions)
        x = self._strain(size, conditions) / f
        rise = _saturation_slope(x, k_a, k_s)
        fall = f_slope * (_saturation(x, k_a, k_s) - x * rise)
        return np.asarray(2.0 / pi * (self._strain(1.0, conditions) * rise + fall))

    def peak(self, values: Values, conditions: Conditions, slip_max: float = SLIP_MAX) -> Peak:
        """Peak, by search."""
        return find_peak(self, values, conditions, slip_max)

    def starts(
        self, slip: Array, adhesion: Array, conditions: Conditions
    ) -> Sequence[tuple[float, ...]]:
        """Curves of the height and initial slope of the points, with slow and fast fall."""
        height, place, slope = rough_peak(slip, adhesion)
        full = float(np.mean(self._initial_stiffness(conditions)))
        speed = max(float(np.mean(conditions.speed)), 1.0)
        reduction = slope / full
        return [
            within_bounds(self, (k_a * reduction, k_s * reduction, 1.2 * height, left, rate))
            for k_a, k_s in ((1.2, 0.5), (0.9, 0.9), (2.0, 1.0))
            for left, rate in ((0.4, 0.1 / (place * speed)), (0.5, 0.02 / (place * speed)))
        ]

    def _initial_stiffness(self, conditions: Conditions) -> Array:
        return initial_stiffness(conditions.load, self.wheel_radius, self.axis_ratio)

    def _strain(self, size: float | Array, conditions: Conditions) -> Array:
        """ε·f: gradient of the tangential stress over that of the pressure, times friction."""
        return np.asarray(pi / 4.0 * self._initial_stiffness(conditions) * size)


def _friction(size: Array, friction: Values, conditions: Conditions) -> tuple[Array, Array]:
    """Friction coefficient at slips |λ|, and its slope over the slip."""
    mu0, left, rate = friction
    speed = np.asarray(conditions.speed)
    falling = mu0 * (1.0 - left) * np.exp(-rate * size * speed)
    f = np.maximum(falling + mu0 * left, LEAST_FRICTION)
    return f, np.asarray(-rate * speed * falling)


def _saturation(x: Array, k_a: float | Array, k_s: float | Array) -> Array:
    a = k_a * x
    return np.asarray(a / (1.0 + a * a) + np.arctan(k_s * x))


def _saturation_slope(x: Array, k_a: float | Array, k_s: float | Array) -> Array:
    a, s = k_a * x, k_s * x
    return np.asarray(k_a * (1.0 - a * a) / (1.0 + a * a) ** 2 + k_s / (1.0 + s * s))
