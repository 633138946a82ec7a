"""Base curves of all segments: members of one curve family, in the coordinates of the regression.

A parameter that is a positive scale enters by its logarithm, so that a step never changes its sign.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.curves.coordinates import to_coordinates, to_values
from adhesion_can.physics.burckhardt import Peak
from adhesion_can.physics.curves import FAMILIES, Conditions, CurveFamily, bounds

BURCKHARDT = FAMILIES["burckhardt"]


@dataclass(frozen=True, slots=True)
class SegmentCurves:
    """Curve parameters of all segments.

    Attributes:
        values: Coordinates of the curve of each surface: the family's parameters, positive scales
            by their logarithm; Burckhardt's are (c1, ln c2, c3). Shape (surfaces, k).
        family: Family of all curves.

    """

    values: Array
    family: CurveFamily = BURCKHARDT

    @classmethod
    def from_parameters(cls, family: CurveFamily, parameters: Array) -> "SegmentCurves":
        """Curves from the family's parameters, shape (surfaces, k)."""
        return cls(to_coordinates(parameters, _logarithmic(family)), family)

    @property
    def size(self) -> int:
        """Number of parameters of a curve."""
        return len(self.family.parameters)

    @property
    def parameters(self) -> Array:
        """The family's parameters of each surface, shape (surfaces, k)."""
        return to_values(self.values, _logarithmic(self.family))

    @property
    def scales(self) -> Array:
        """Derivative of each parameter by its coordinate, shape (surfaces, k)."""
        return np.where(_logarithmic(self.family), self.parameters, 1.0)

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds of the coordinates of a curve, shape (k,) each."""
        logs = _logarithmic(self.family)
        lower, upper = (to_coordinates(end, logs) for end in bounds(self.family))
        return lower, upper

    def with_values(self, values: Array) -> "SegmentCurves":
        """Curves with other coordinates, clipped to the family's bounds; shape (surfaces, k)."""
        return replace(self, values=np.clip(values, *self.bounds))

    def select(self, surface: int) -> "SegmentCurves":
        """The curve of one surface alone."""
        return replace(self, values=self.values[[surface]])

    def adhesion(self, slip: Array, surface: NDArray[np.int64], conditions: Conditions) -> Array:
        """Adhesion of the curve of each row, given its surface number; shape (n,)."""
        return self.family.adhesion(slip, self._rows(surface), conditions)

    def slope(self, slip: Array, surface: NDArray[np.int64], conditions: Conditions) -> Array:
        """Slope dμ/dλ of the curve of each row, given its surface number; shape (n,)."""
        return self.family.slope(slip, self._rows(surface), conditions)

    def gradient(self, slip: Array, surface: NDArray[np.int64], conditions: Conditions) -> Array:
        """Derivatives of each row's adhesion by its surface's coordinates, shape (k, n)."""
        by_parameter = self.family.gradient(slip, self._rows(surface), conditions)
        rows = self.scales.T[:, np.maximum(surface, 0)] if len(self.values) > 1 else self.scales.T
        return by_parameter * rows

    def peak(self, surface: int, conditions: Conditions, slip_max: float) -> Peak:
        """Peak of one surface's curve in given conditions."""
        return self.family.peak(self.parameters[surface], conditions, slip_max)

    def _rows(self, surface: NDArray[np.int64]) -> Sequence[Array]:
        """Parameters beside the rows: numbers where there is one surface, else shape (n,) each."""
        if len(self.values) == 1:
            return tuple(self.parameters[0])
        return tuple(self.parameters.T[:, np.maximum(surface, 0)])


def _logarithmic(family: CurveFamily) -> NDArray[np.bool_]:
    """Whether each parameter of a family enters by its logarithm, shape (k,)."""
    return np.array([p.lower > 0.0 and not p.linear for p in family.parameters])
