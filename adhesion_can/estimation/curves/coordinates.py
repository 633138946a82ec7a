"""Coordinates in which a curve family is fitted with its prior, values or their logarithms."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.curves import CurveFamily, bounds
from adhesion_can.values import Value

LEAST_VALUE = 1e-9
"""Least value that has a logarithm: a bound of 0 has none, and below this no curve differs."""


@dataclass(frozen=True, eq=False, slots=True)
class Coordinates(Value):
    """Coordinates of a family's values, with their bounds and their normal prior; shape (k,) each.

    Attributes:
        logarithmic: Whether a coordinate is the logarithm of the value.
        centre: Means of the prior.
        precision: Inverse variances of the prior.
        lower: Lower bounds.
        upper: Upper bounds.

    """

    logarithmic: NDArray[np.bool_]
    centre: Array
    precision: Array
    lower: Array
    upper: Array

    def to_values(self, coordinates: Array) -> Array:
        """Values of the family's parameters, shape (k, ...)."""
        logs = self.logarithmic.reshape(-1, *[1] * (coordinates.ndim - 1))
        return np.where(logs, np.exp(np.where(logs, coordinates, 0.0)), coordinates)

    def from_values(self, values: Array) -> Array:
        """Coordinates of values of the family's parameters, shape (k,)."""
        return _from_values(values, self.logarithmic)


def coordinates_of(family: CurveFamily) -> Coordinates:
    """Coordinates of a family; ValueError where a parameter has no prior."""
    priors = [p.prior for p in family.parameters if p.prior is not None]
    if len(priors) < len(family.parameters):
        raise ValueError(f"{family.title}: not every parameter has a prior")
    mean, std, logarithmic = (np.array(column) for column in zip(*priors, strict=True))
    lower, upper = bounds(family)
    return Coordinates(
        logarithmic,
        _from_values(mean, logarithmic),
        std**-2.0,
        _from_values(lower, logarithmic),
        _from_values(upper, logarithmic),
    )


def _from_values(values: Array, logarithmic: NDArray[np.bool_]) -> Array:
    positive = np.where(logarithmic, np.maximum(values, LEAST_VALUE), 1.0)
    return np.where(logarithmic, np.log(positive), values)
