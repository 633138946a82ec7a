"""Burckhardt's curve that falls with creep speed: the factor e^(−c4 |λ V|) of eq. 4."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, Peak, falling_factor
from adhesion_can.physics.curves.base import Conditions, Values, within_bounds
from adhesion_can.physics.curves.burckhardt_family import C1, C2, C3, Burckhardt
from adhesion_can.physics.curves.peak_search import find_peak
from adhesion_can.physics.parameter import Parameter

_PLAIN = Burckhardt()


@dataclass(frozen=True, slots=True)
class BurckhardtC4:
    """(c1(1 − e^(−c2 λ)) − c3 λ) e^(−c4 |λ V|)."""

    name: str = "burckhardt_c4"
    title: str = "Burckhardt with c4"
    literature: str = "Burckhardt 1993, eq. 4 of He et al. 2018"
    parameters: tuple[Parameter, ...] = (
        C1,
        C2,
        C3,
        Parameter("c4", "s/m", 0.1, 0.0, 20.0, "fall of the adhesion with creep speed").normal(
            0.0, 0.1
        ),
    )
    prior_weight: float = 0.1

    def adhesion(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Adhesion coefficient."""
        *curve, c4 = values
        creep = np.asarray(slip) * np.asarray(conditions.speed)
        return np.asarray(_PLAIN.adhesion(slip, curve, conditions) * falling_factor(creep, c4))

    def gradient(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Partial derivatives by c1, c2, c3, c4."""
        *curve, c4 = values
        creep = np.asarray(slip) * np.asarray(conditions.speed)
        factor = falling_factor(creep, c4)
        by_fall = -np.abs(creep) * factor * _PLAIN.adhesion(slip, curve, conditions)
        return np.concatenate([_PLAIN.gradient(slip, curve, conditions) * factor, by_fall[None]])

    def slope(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Slope over slip."""
        *curve, c4 = values
        speed = np.asarray(conditions.speed)
        size = np.abs(np.asarray(slip, dtype=np.float64))
        inner = _PLAIN.slope(size, curve, conditions)
        fall = c4 * speed * _PLAIN.adhesion(size, curve, conditions)
        return np.asarray((inner - fall) * falling_factor(size * speed, c4))

    def peak(self, values: Values, conditions: Conditions, slip_max: float = SLIP_MAX) -> Peak:
        """Peak, by search."""
        return find_peak(self, values, conditions, slip_max)

    def starts(
        self, slip: Array, adhesion: Array, conditions: Conditions
    ) -> Sequence[tuple[float, ...]]:
        """Plain curves, each with a small and a strong fall over the speeds at hand."""
        speed = max(float(np.mean(conditions.speed)), 1.0)
        plain = _PLAIN.starts(slip, adhesion, conditions)
        return [within_bounds(self, (*c, fall / speed)) for c in plain for fall in (0.3, 3.0)]
