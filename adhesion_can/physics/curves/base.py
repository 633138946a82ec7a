"""The definition of a curve family: adhesion over slip at given conditions, with its numbers.

A family is written for |λ| and carries the sign of λ. Values are in the order of `parameters`; a
value may be an array that broadcasts against the slip.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, Peak
from adhesion_can.physics.parameter import Parameter
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Value

Values = Sequence[float] | Sequence[Array] | Array
"""Values of a family's parameters, in their order, each a number or an array beside the slip."""


@dataclass(frozen=True, slots=True)
class Conditions(Value):
    """Conditions of a contact on which a curve may depend; they broadcast against the slip.

    Attributes:
        speed: Vehicle speed, m/s; with the slip ratio it gives the creep speed |λ|·v.
        load: Wheelset load, N; NaN where unknown.

    """

    speed: Array | float
    load: Array | float = np.nan

    @classmethod
    def from_samples(cls, samples: Samples) -> "Conditions":
        """Conditions of samples, shape (n,); loads of at most 1 N stand for unknown ones."""
        return cls(samples.speed, np.where(samples.load > 1.0, samples.load, np.nan))

    def select(self, rows: object) -> "Conditions":
        """Conditions of some rows of arrays; a number stays."""

        def part(column: Array | float) -> Array | float:
            return column[rows] if np.ndim(column) else column  # type: ignore[call-overload,index]

        return Conditions(part(self.speed), part(self.load))


class CurveFamily(Protocol):
    """Curves of one form."""

    @property
    def name(self) -> str:
        """Fixed name in options, reports and model files."""

    @property
    def title(self) -> str:
        """Name in sentences and figures."""

    @property
    def literature(self) -> str:
        """Reference."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The numbers of the family; their bounds are those of a fit."""

    @property
    def prior_weight(self) -> float:
        """Probability relative to other families before any sample; 0: not weighed online.

        A family that is weighed online has a prior for each parameter.
        """

    def adhesion(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Adhesion coefficient μ(λ), odd in the slip.

        Args:
            slip: Slip ratio λ, any shape.
            values: Values of `parameters`.
            conditions: Speed and load; they broadcast against the slip.

        """

    def gradient(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Partial derivatives of the adhesion by the values, shape (k, ...).

        Args:
            slip: Slip ratio λ, any shape.
            values: Values of `parameters`, k in number.
            conditions: Speed and load; they broadcast against the slip.

        """

    def slope(self, slip: ArrayLike, values: Values, conditions: Conditions) -> Array:
        """Slope dμ/dλ at constant speed and load, even in the slip.

        Args:
            slip: Slip ratio λ, any shape.
            values: Values of `parameters`.
            conditions: Speed and load; they broadcast against the slip.

        """

    def peak(self, values: Values, conditions: Conditions, slip_max: float = SLIP_MAX) -> Peak:
        """Peak of the curve within a range of slip, of the shape of the conditions.

        Args:
            values: Values of `parameters`.
            conditions: Speed and load.
            slip_max: End of the valid range, slip ratio.

        """

    def starts(
        self, slip: Array, adhesion: Array, conditions: Conditions
    ) -> Sequence[tuple[float, ...]]:
        """Starting values for a fit, within the bounds of the parameters.

        Args:
            slip: Slip ratios λ, shape (n,).
            adhesion: Adhesion coefficients μ with the sign of the slip, shape (n,).
            conditions: Speed and load of the points.

        """


def bounds(family: CurveFamily) -> tuple[Array, Array]:
    """Lower and upper bounds of a family's values, shape (k,) each."""
    return (
        np.array([p.lower for p in family.parameters]),
        np.array([p.upper for p in family.parameters]),
    )


def within_bounds(family: CurveFamily, values: Sequence[float]) -> tuple[float, ...]:
    """Values moved to the nearest ones within the bounds of a family."""
    lower, upper = bounds(family)
    return tuple(float(x) for x in np.clip(values, lower, upper))
