"""Families compared on all samples of a surface, and the peak pooled over them.

Each family is fitted to the binned samples (`family_fit`). Its evidence is Laplace's approximation
(Kass and Raftery, Journal of the American Statistical Association 90 (1995)), with the points'
variances inflated by errors that last: the same inflation for all, that of the family that fits
best. The pooled peak is the mean over the families by their probabilities; its variance contains
the spread between them (Hoeting et al., Bayesian model averaging, Statistical Science 14 (1999)).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import inf, log, sqrt
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.batch_means import batch_inflation
from adhesion_can.estimation.families.bin_points import BinPoints, build_points
from adhesion_can.estimation.families.binned_samples import (
    ADHESION,
    COUNT,
    SLIP,
    BinnedSamples,
    join_binned,
)
from adhesion_can.estimation.families.family_fit import (
    PRIORS,
    FamilyFit,
    coordinate_bounds,
    fit_family,
    fit_from_starts,
    known_families,
    predict,
    to_values,
)
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.curves import Conditions, CurveFamily
from adhesion_can.physics.estimate import PeakEstimate
from adhesion_can.values import Stateful, Value

FEWEST_POINTS = 15
"""Points of the curve below which families are not compared."""
FIRST_INFLATION = 20.0
"""Inflation of the variances before anything is known of the errors that last."""
DRAWS = 64
"""Curves that are drawn of each family for the standard deviations."""
GRID = np.geomspace(1e-3, 0.5, 160)
"""Slips at which peaks are searched."""
HELD = 4.0
"""Standard deviations of the mean residual of the latest samples beyond which the surface may be
another one."""
LEAST_CHANGE = 0.05
"""Share of the adhesion by which a mean residual may differ in any case."""
NEGLIGIBLE = 1e-3
"""Probability of a family below which it does not enter the pooled peak."""
MISFIT_WIDTH = 0.4
"""Width of a misfit in ln λ: a narrower one is noise, a wider one moves the peak less."""


class LevelError(NamedTuple):
    """Level of some samples against a curve.

    Attributes:
        share: Mean residual as a share of the curve's adhesion.
        noise: Standard error of `share` by independent errors.
        lasting: Standard error of `share` by errors that last.

    """

    share: float
    noise: float
    lasting: float

    @property
    def holds(self) -> bool:
        """Whether the samples may lie on the curve."""
        return abs(self.share) <= HELD * self.lasting + LEAST_CHANGE


@dataclass(frozen=True, eq=False)
class FamilyComparison(Value):
    """Families fitted to the samples of a surface.

    Attributes:
        fits: Fit of each family, Burckhardt's first.
        probability: Probability of each family by its name.
        inflation: Factor of the variances by errors that last about the leading family.
        misfit: Root mean square of what the leading family leaves of the points, beyond their
            noise, as a share of its largest adhesion under the points' mean conditions.

    """

    fits: tuple[FamilyFit, ...]
    probability: Mapping[str, float]
    inflation: float
    misfit: float

    @property
    def leader(self) -> FamilyFit:
        """Most probable family."""
        return max(self.fits, key=lambda one: self.probability[one.family.name])

    def level_error(
        self, binned: BinnedSamples, theta: CurveParameters, steepest: float = inf
    ) -> LevelError | None:
        """Level of further samples against the leading family's curve; None without a point.

        Args:
            binned: Samples by bins.
            theta: Parameters (c1, c2, c3) of a curve nearby, for the weights alone.
            steepest: Largest logarithmic slope d ln μ/d ln λ of a point that is used: where the
                curve is steep its level is also that of the slip's error.

        """
        family, values = self.leader.family, self.leader.values
        points = build_points(binned, theta)
        predicted = predict(family, values, points)
        slope = family.slope(points.slip, values, points.conditions) * points.slip / predicted
        flat = np.abs(slope) <= steepest
        if not flat.any():
            return None
        points = points._replace(weight=points.weight * flat)
        # The factor of the curve by which they differ, by weighted least squares.
        information = float(points.weight @ predicted**2)
        share = float((points.weight * predicted) @ (points.adhesion - predicted)) / information
        return LevelError(share, sqrt(1.0 / information), sqrt(self.inflation / information))

    def peak(self, conditions: Conditions, slip_max: float) -> PeakEstimate:
        """Pooled peak.

        Args:
            conditions: Present speed and load.
            slip_max: End of the valid range, slip ratio.

        """
        grid = GRID[slip_max >= GRID]
        tops, stds, weights = [], [], []
        for fit in self.fits:
            weight = self.probability[fit.family.name]
            if weight < NEGLIGIBLE:
                continue
            curve = fit.family.adhesion(grid, fit.values, conditions)
            *top, bend = find_top(grid, curve).tolist()
            others = find_top(grid, draw_curves(fit, grid, conditions))[:2].T
            scatter = np.sqrt(np.mean((others - top) ** 2, axis=0))
            error = self.misfit / MISFIT_WIDTH / bend
            tops.append(top)
            stds.append(np.hypot(scatter, np.multiply(top, (self.misfit, error))))
            weights.append(weight)
        share = np.array(weights) / sum(weights)
        top, std = np.array(tops), np.array(stds)
        mean = share @ top
        spread = np.sqrt(share @ (std**2 + (top - mean) ** 2))
        return PeakEstimate(float(mean[0]), float(mean[1]), float(spread[0]), float(spread[1]))


class FamilyTracker(Stateful):
    """Compares families block by block of a drive, each fit beginning with the one before."""

    def __init__(self) -> None:
        self._fits: dict[str, FamilyFit] = {}
        self._inflation = FIRST_INFLATION
        self._count = 0

    def restart(self) -> None:
        """Start a new surface."""
        self._fits, self._inflation, self._count = {}, FIRST_INFLATION, 0

    def compare(
        self, blocks: Sequence[BinnedSamples], theta: CurveParameters
    ) -> FamilyComparison | None:
        """Families fitted to the blocks of a surface; None where there are too few samples.

        Args:
            blocks: Samples of each block by bins.
            theta: Parameters (c1, c2, c3) of a curve nearby, for the weights alone.

        """
        binned = join_binned(blocks)
        points = build_points(binned, theta)
        if len(points.rows) < FEWEST_POINTS:
            return None
        self._count += 1
        # A power of two: now and then a better minimum may be elsewhere.
        anew = self._count & (self._count - 1) == 0
        for family in known_families():
            self._fits[family.name] = self._fit(points, family, anew=anew)
        fits = tuple(self._fits.values())
        probability = _probabilities(fits)
        leader = max(fits, key=lambda one: probability[one.family.name])
        self._inflation = _inflation(leader, points, binned, blocks)
        residual = points.adhesion - predict(leader.family, leader.values, points)
        square = float(points.weight @ residual**2) - len(residual)
        misfit = sqrt(max(square, 0.0) / float(points.weight.sum()))
        level = float(np.max(predict(leader.family, leader.values, points)))
        return FamilyComparison(fits, probability, self._inflation, misfit / level)

    def _fit(self, points: BinPoints, family: CurveFamily, *, anew: bool) -> FamilyFit:
        known = self._fits.get(family.name)
        fits = []
        if known is not None:
            fits.append(fit_family(points, family, known.coordinates, self._inflation))
        if anew or known is None:
            fits.append(fit_from_starts(points, family, self._inflation))
        return min(fits, key=lambda one: one.cost + one.penalty)


def _probabilities(fits: Sequence[FamilyFit]) -> dict[str, float]:
    """Posterior probabilities of families."""
    logs = []
    for fit in fits:
        prior = PRIORS[fit.family.name]
        precision = np.array(prior.std) ** -2.0
        determined = np.linalg.slogdet(
            fit.gram / np.sqrt(np.outer(precision, precision)) + np.eye(len(precision))
        )[1]
        logs.append(log(prior.weight) - 0.5 * (fit.cost + fit.penalty + float(determined)))
    weights = np.exp(np.array(logs) - max(logs))
    weights /= weights.sum()
    return {fit.family.name: float(w) for fit, w in zip(fits, weights, strict=True)}


def _inflation(
    leader: FamilyFit, points: BinPoints, binned: BinnedSamples, blocks: Sequence[BinnedSamples]
) -> float:
    """Variance of a mean residual over that of independent errors, by batch means of any length."""
    place = binned.place[points.rows]
    count = binned.sums[COUNT, points.rows]
    mean_slip, of_sample = binned.sums[SLIP, points.rows] / count, points.weight / count
    predicted = predict(leader.family, leader.values, points)
    slope = leader.family.slope(points.slip, leader.values, points.conditions)
    score, noise = [], []
    for block in blocks:
        at = np.searchsorted(place, block.place)
        inside = (at < len(place)) & (place[np.minimum(at, len(place) - 1)] == block.place)
        rows, own = at[inside], block.sums[:, inside]
        left = own[ADHESION] - own[COUNT] * predicted[rows]
        left -= slope[rows] * (own[SLIP] - own[COUNT] * mean_slip[rows])
        score.append(float(of_sample[rows] @ left))
        noise.append(float(of_sample[rows] @ own[COUNT]))
    return batch_inflation(np.array(score), np.array(noise))


@cache
def _normal_draws(size: int) -> Array:
    """Fixed standard normal draws, shape (size, DRAWS)."""
    return np.random.default_rng(size).standard_normal((size, DRAWS))


def draw_curves(fit: FamilyFit, grid: Array, conditions: Conditions) -> Array:
    """Curves of the family's normal approximation, shape (DRAWS, grid)."""
    prior = PRIORS[fit.family.name]
    lower = np.linalg.cholesky(fit.gram + np.diag(np.array(prior.std) ** -2.0))
    steps = np.linalg.solve(lower.T, _normal_draws(len(prior.std)))
    coordinates = np.clip(
        fit.coordinates[:, None] + steps, *(end[:, None] for end in coordinate_bounds(fit.family))
    )
    values = to_values(fit.family, coordinates)
    return fit.family.adhesion(grid, values[:, :, None], conditions)


def find_top(grid: Array, curves: Array) -> Array:
    """Height and place of the largest value of curves, and the relative bend there; (3, ..).

    The bend is −d² ln μ/d(ln λ)²; the place is that of the parabola through three points.

    Args:
        grid: Slip ratios, even in ln λ, shape (n,).
        curves: Adhesion on the grid, shape (.., n).

    """
    top = np.argmax(curves, axis=-1)
    step = log(grid[1] / grid[0])
    inner = np.clip(top, 1, len(grid) - 2)
    left, middle, right = (
        np.take_along_axis(curves, (inner + k)[..., None], axis=-1)[..., 0] for k in (-1, 0, 1)
    )
    second = (2.0 * middle - left - right) / step**2
    bend = np.maximum(second / middle, 1e-3)
    interior = (inner == top) & (second > 0.0)
    shift = 0.5 * (right - left) / step / np.where(interior, second, 1.0)
    heights = np.take_along_axis(curves, top[..., None], axis=-1)[..., 0]
    return np.stack(
        [
            np.where(interior, middle + 0.5 * second * shift * shift, heights),
            np.where(interior, grid[inner] * np.exp(np.where(interior, shift, 0.0)), grid[top]),
            bend,
        ]
    )
