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
        return to_values(coordinates, logs)

    def from_values(self, values: Array) -> Array:
        """Coordinates of values of the family's parameters, shape (k,)."""
        return to_coordinates(values, self.logarithmic)


def coordinates_of(family: CurveFamily) -> Coordinates:
    """Coordinates of a family; ValueError where a parameter has no prior."""
    priors = [p.prior for p in family.parameters if p.prior is not None]
    if len(priors) < len(family.parameters):
        raise ValueError(f"{family.title}: not every parameter has a prior")
    mean, std, logarithmic = (np.array(column) for column in zip(*priors, strict=True))
    lower, upper = bounds(family)
    return Coordinates(
        logarithmic,
        to_coordinates(mean, logarithmic),
        std**-2.0,
        to_coordinates(lower, logarithmic),
        to_coordinates(upper, logarithmic),
    )


def to_values(coordinates: Array, logarithmic: NDArray[np.bool_]) -> Array:
    """Values of parameters of which some are given by their logarithm; shapes broadcast."""
    return np.where(logarithmic, np.exp(np.where(logarithmic, coordinates, 0.0)), coordinates)


def to_coordinates(values: Array, logarithmic: NDArray[np.bool_]) -> Array:
    """The reverse of `to_values`; a value below `LEAST_VALUE` counts as that."""
    positive = np.where(logarithmic, np.maximum(values, LEAST_VALUE), 1.0)
    return np.where(logarithmic, np.log(positive), values)
