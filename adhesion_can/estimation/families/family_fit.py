"""Fit of one curve family to points of a curve, with a prior, by damped Gauss-Newton steps."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.families.bin_points import BinPoints
from adhesion_can.physics.curves import FAMILIES, CurveFamily, bounds
from adhesion_can.values import Value

STEPS = 20
"""Largest number of steps of a fit."""
CONVERGED = 1e-2
"""Decrease of the cost below which a step is the last one."""


class FamilyPrior(NamedTuple):
    """Normal prior of a family's coordinates.

    Attributes:
        logarithmic: Whether a parameter enters by its logarithm.
        mean: Prior mean of the parameters.
        std: Prior standard deviation of the coordinates.
        weight: Prior probability of the family.

    """

    logarithmic: tuple[bool, ...]
    mean: tuple[float, ...]
    std: tuple[float, ...]
    weight: float


PRIORS: Mapping[str, FamilyPrior] = {
    "burckhardt": FamilyPrior((True,) * 3, (0.35, 45.0, 0.3), (0.6, 0.7, 1.2), 0.7),
    "burckhardt_c4": FamilyPrior(
        (True, True, True, False), (0.35, 45.0, 0.3, 0.0), (0.6, 0.7, 1.2, 0.1), 0.1
    ),
    "polach": FamilyPrior(
        (True, True, True, False, True),
        (0.5, 0.2, 0.4, 0.4, 0.4),
        (1.0, 1.0, 0.6, 0.25, 1.0),
        0.1,
    ),
    "magic_formula": FamilyPrior(
        (True, False, True, False), (60.0, 1.3, 0.4, 0.0), (1.0, 0.3, 0.6, 1.5), 0.1
    ),
}


@dataclass(frozen=True, slots=True)
class FamilyFit(Value):
    """A family fitted to points.

    Attributes:
        family: Family of the curve.
        coordinates: Fitted coordinates, shape (k,).
        cost: Weighted sum of squares, without the prior's.
        penalty: Prior's square of the coordinates.
        gram: Gram matrix of the Jacobian, without the prior, shape (k, k).

    """

    family: CurveFamily
    coordinates: Array
    cost: float
    penalty: float
    gram: Array

    @property
    def values(self) -> Array:
        """Values of the family's parameters, shape (k,)."""
        return to_values(self.family, self.coordinates)


def to_values(family: CurveFamily, coordinates: Array) -> Array:
    """Parameters from coordinates, shape (k, ...)."""
    logs = _logs(family)
    logs = logs.reshape(-1, *[1] * (coordinates.ndim - 1))
    return np.where(logs, np.exp(np.where(logs, coordinates, 0.0)), coordinates)


def to_coordinates(family: CurveFamily, values: Array) -> Array:
    """Coordinates from parameters, shape (k,)."""
    logs = _logs(family)
    return np.where(logs, np.log(np.where(logs, np.maximum(values, 1e-9), 1.0)), values)


def _logs(family: CurveFamily) -> NDArray[np.bool_]:
    """Whether each parameter enters by its logarithm, shape (k,)."""
    return np.array(PRIORS[family.name].logarithmic)


def coordinate_bounds(family: CurveFamily) -> tuple[Array, Array]:
    """Bounds of the coordinates, shape (k,) each."""
    lower, upper = bounds(family)
    return to_coordinates(family, lower), to_coordinates(family, upper)


def predict(family: CurveFamily, values: Array, points: BinPoints) -> Array:
    """Mean adhesion of the points, averaged over the scatter of their slips, shape (n,)."""
    above = family.adhesion(points.slip + points.slip_std, values, points.conditions)
    below = family.adhesion(points.slip - points.slip_std, values, points.conditions)
    return 0.5 * (above + below)


def fit_family(points: BinPoints, family: CurveFamily, start: Array, inflation: float) -> FamilyFit:
    """Fit from given coordinates.

    Args:
        points: Points of the curve.
        family: Family of the curve.
        start: Coordinates to start with, shape (k,).
        inflation: Factor of the points' variances by errors that last.

    """
    prior = PRIORS[family.name]
    centre = to_coordinates(family, np.array(prior.mean))
    precision = np.array(prior.std) ** -2.0
    lower, upper = coordinate_bounds(family)
    weight = points.weight / inflation
    logs = _logs(family)

    def evaluate(y: Array) -> tuple[float, float, Array, Array]:
        values = to_values(family, y)
        residual = points.adhesion - predict(family, values, points)
        gradient = 0.5 * (
            family.gradient(points.slip + points.slip_std, values, points.conditions)
            + family.gradient(points.slip - points.slip_std, values, points.conditions)
        )
        gradient = gradient * np.where(logs, values, 1.0)[:, None]
        away = y - centre
        weighted = gradient * weight
        score = weighted @ residual - precision * away
        return float(weight @ residual**2), float(precision @ away**2), score, weighted @ gradient.T

    y = np.clip(start, lower, upper)
    cost, penalty, score, gram = evaluate(y)
    damping = 1e-3
    for _ in range(STEPS):
        hessian = gram + np.diag(precision)
        pressed = ((y <= lower) & (score < 0.0)) | ((y >= upper) & (score > 0.0))
        free = np.flatnonzero(~pressed)
        inner = hessian[np.ix_(free, free)]
        step = np.zeros(len(y))
        step[free] = np.linalg.solve(inner + damping * np.diag(inner.diagonal()), score[free])
        moved = np.clip(y + np.clip(step, -0.7, 0.7), lower, upper)
        tried = evaluate(moved)
        before, after = cost + penalty, tried[0] + tried[1]
        if after < before:
            y, (cost, penalty, score, gram) = moved, tried
            damping *= 0.3
            if before - after < CONVERGED:
                break
        else:
            damping *= 6.0
            if damping > 1e4:
                break
    return FamilyFit(family, y, cost, penalty, gram)


def fit_from_starts(points: BinPoints, family: CurveFamily, inflation: float) -> FamilyFit:
    """Fit from the family's own starting values, the two most promising of them."""
    starts = family.starts(points.slip, points.adhesion, points.conditions)
    weight = points.weight / inflation

    def cost(values: tuple[float, ...]) -> float:
        residual = points.adhesion - predict(family, np.array(values), points)
        return float(weight @ residual**2)

    best = sorted(starts, key=cost)[:2]
    fits = [
        fit_family(points, family, to_coordinates(family, np.array(one)), inflation) for one in best
    ]
    return min(fits, key=lambda one: one.cost + one.penalty)


def known_families() -> list[CurveFamily]:
    """Families that are weighed, Burckhardt's first."""
    return [FAMILIES[name] for name in PRIORS]
