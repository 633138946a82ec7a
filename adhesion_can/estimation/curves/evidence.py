"""Curve families fitted to points with their priors, and the evidence for each.

The evidence is Laplace's approximation (Kass and Raftery, Journal of the American Statistical
Association 90 (1995)): about the best curve the posterior counts as normal.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import log

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.curves.binned_points import BinnedPoints
from adhesion_can.estimation.curves.coordinates import Coordinates, coordinates_of
from adhesion_can.estimation.curves.gauss_newton import NormalEquations, minimise, normal_equations
from adhesion_can.physics.curves import FAMILIES, Conditions, CurveFamily
from adhesion_can.values import Value

STEPS = 20
"""Largest number of steps of a fit."""
LONGEST_STEP = 0.7
"""Largest change of a coordinate in one step."""
CONVERGED = 2e-4
"""Decrease of the cost, as a share of it, below which a step is the last one."""
FIRST_DAMPING = 1e-3
"""Damping of the first step: the best curve of some samples less is near."""
DRAWS = 64
"""Curves that are drawn of a family for the standard deviations."""

WEIGHED: tuple[CurveFamily, ...] = tuple(
    family for family in FAMILIES.values() if family.prior_weight > 0.0
)
"""Families that are weighed online, Burckhardt's first."""


@dataclass(frozen=True, eq=False, slots=True)
class NormalPosterior(Value):
    """Normal approximation of the posterior of a family's coordinates.

    Attributes:
        family: Family of the curve.
        coordinates: Its coordinates, with their bounds and their prior.
        mode: Coordinates of the best curve, shape (k,).
        cost: Weighted sum of squares there, with the prior's.
        precision: Inverse covariance of the coordinates, shape (k, k).

    """

    family: CurveFamily
    coordinates: Coordinates
    mode: Array
    cost: float
    precision: Array

    @property
    def values(self) -> Array:
        """Values of the family's parameters at the best curve, shape (k,)."""
        return self.coordinates.to_values(self.mode)

    @property
    def log_evidence(self) -> float:
        """Logarithm of the probability of the points and the family, but for a constant."""
        prior_std = self.coordinates.precision**-0.5
        determined = np.linalg.slogdet(self.precision * np.outer(prior_std, prior_std))[1]
        return log(self.family.prior_weight) - 0.5 * (self.cost + float(determined))

    def draw_curves(self, slip: Array, conditions: Conditions) -> Array:
        """Curves of the posterior at slip ratios of shape (n,), shape (DRAWS, n)."""
        lower = np.linalg.cholesky(self.precision)
        steps = np.linalg.solve(lower.T, _normal_draws(len(self.mode)))
        ends = self.coordinates.lower[:, None], self.coordinates.upper[:, None]
        values = self.coordinates.to_values(np.clip(self.mode[:, None] + steps, *ends))
        return self.family.adhesion(slip, values[:, :, None], conditions)


@cache
def _normal_draws(size: int) -> Array:
    """Fixed standard normal draws, shape (size, DRAWS)."""
    return np.random.default_rng(size).standard_normal((size, DRAWS))


def fit_posterior(
    points: BinnedPoints, family: CurveFamily, start: Array, inflation: float
) -> NormalPosterior:
    """Fit from given coordinates.

    Args:
        points: Points of the curve.
        family: Family of the curve.
        start: Coordinates to start with, shape (k,).
        inflation: Factor of the points' variances by errors that last.

    """
    coordinates = coordinates_of(family)
    weight = points.weight / inflation

    def evaluate(y: Array) -> NormalEquations:
        values = coordinates.to_values(y)
        residual = points.adhesion - points.predict(family, values)
        by_values = points.average(family.gradient, values)
        gradient = by_values * np.where(coordinates.logarithmic, values, 1.0)[:, None]
        equations = normal_equations(residual, gradient, weight)
        return equations.with_prior(y - coordinates.centre, coordinates.precision)

    mode, best = minimise(
        evaluate,
        start,
        (coordinates.lower, coordinates.upper),
        steps=STEPS,
        converged=CONVERGED,
        longest=LONGEST_STEP,
        damping=FIRST_DAMPING,
    )
    return NormalPosterior(family, coordinates, mode, best.cost, best.gram)


def fit_from_starts(points: BinnedPoints, family: CurveFamily, inflation: float) -> NormalPosterior:
    """Fit from the family's own starting values, the two most promising of them."""
    starts = np.array(family.starts(points.slip, points.adhesion, points.conditions))

    def cost(values: Array) -> float:
        return float(points.weight @ (points.adhesion - points.predict(family, values)) ** 2)

    to_coordinates = coordinates_of(family).from_values
    fits = [
        fit_posterior(points, family, to_coordinates(values), inflation)
        for values in sorted(starts, key=cost)[:2]
    ]
    return min(fits, key=lambda fit: fit.cost)


def weigh_families(fits: Sequence[NormalPosterior]) -> Mapping[str, float]:
    """Posterior probability of each family by its name."""
    logs = np.array([fit.log_evidence for fit in fits])
    weights = np.exp(logs - logs.max())
    weights /= weights.sum()
    return {fit.family.name: float(w) for fit, w in zip(fits, weights, strict=True)}
