"""Families compared on all samples of a surface, and the peak pooled over them.

Each family is fitted to the binned samples and weighed by its evidence (`evidence`). The points'
variances are inflated by errors that last: the same inflation for all, that of the family that fits
best. The pooled peak is the mean over the families by their probabilities; its variance contains
the spread between them (Hoeting et al., Bayesian model averaging, Statistical Science 14 (1999)).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from adhesion_can.estimation.batch_means import batch_inflation
from adhesion_can.estimation.curves.binned_points import BinnedPoints, build_points
from adhesion_can.estimation.curves.binned_samples import (
    ADHESION,
    COUNT,
    SLIP,
    BinnedSamples,
    join_binned,
)
from adhesion_can.estimation.curves.evidence import (
    WEIGHED,
    NormalPosterior,
    fit_from_starts,
    fit_posterior,
    weigh_families,
)
from adhesion_can.estimation.curves.peak import find_top
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.curves import Conditions, CurveFamily
from adhesion_can.physics.estimate import PeakEstimate
from adhesion_can.values import Stateful, Value

FEWEST_POINTS = 15
"""Points of the curve below which families are not compared."""
FIRST_INFLATION = 20.0
"""Inflation of the variances before anything is known of the errors that last."""
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

    fits: tuple[NormalPosterior, ...]
    probability: Mapping[str, float]
    inflation: float
    misfit: float

    @property
    def leader(self) -> NormalPosterior:
        """Most probable family."""
        return max(self.fits, key=lambda fit: self.probability[fit.family.name])

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
        predicted = points.predict(family, values)
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
            *top, curvature = find_top(grid, curve).tolist()
            others = find_top(grid, fit.draw_curves(grid, conditions))[:2].T
            scatter = np.sqrt(np.mean((others - top) ** 2, axis=0))
            error = self.misfit / MISFIT_WIDTH / curvature
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
        self._fits: dict[str, NormalPosterior] = {}
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
        for family in WEIGHED:
            self._fits[family.name] = self._fit(points, family, anew=anew)
        fits = tuple(self._fits.values())
        probability = weigh_families(fits)
        leader = max(fits, key=lambda fit: probability[fit.family.name])
        self._inflation = _inflation(leader, points, binned, blocks)
        predicted = points.predict(leader.family, leader.values)
        residual = points.adhesion - predicted
        square = float(points.weight @ residual**2) - len(residual)
        misfit = sqrt(max(square, 0.0) / float(points.weight.sum()))
        misfit /= float(predicted.max())
        return FamilyComparison(fits, probability, self._inflation, misfit)

    def _fit(self, points: BinnedPoints, family: CurveFamily, *, anew: bool) -> NormalPosterior:
        known = self._fits.get(family.name)
        fits = []
        if known is not None:
            fits.append(fit_posterior(points, family, known.mode, self._inflation))
        if anew or known is None:
            fits.append(fit_from_starts(points, family, self._inflation))
        return min(fits, key=lambda fit: fit.cost)


def _inflation(
    leader: NormalPosterior,
    points: BinnedPoints,
    binned: BinnedSamples,
    blocks: Sequence[BinnedSamples],
) -> float:
    """Variance of a mean residual over that of independent errors, by batch means of any length."""
    place = binned.place[points.rows]
    count = binned.sums[COUNT, points.rows]
    mean_slip, of_sample = binned.sums[SLIP, points.rows] / count, points.weight / count
    predicted = points.predict(leader.family, leader.values)
    slope = leader.family.slope(points.slip, leader.values, points.conditions)
    score, noise = [], []
    for block in blocks:
        at = np.searchsorted(place, block.place)
        inside = (at < len(place)) & (place[np.minimum(at, len(place) - 1)] == block.place)
        rows, sums = at[inside], block.sums[:, inside]
        left = sums[ADHESION] - sums[COUNT] * predicted[rows]
        left -= slope[rows] * (sums[SLIP] - sums[COUNT] * mean_slip[rows])
        score.append(float(of_sample[rows] @ left))
        noise.append(float(of_sample[rows] @ sums[COUNT]))
    return batch_inflation(np.array(score), np.array(noise))
