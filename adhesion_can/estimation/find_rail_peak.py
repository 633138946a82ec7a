"""Peak of the rail by the curve families that hold, beside a fit of Burckhardt's curve.

Burckhardt's curve has one bend, and where a rail bends otherwise its peak is wrong by far more than
its standard deviation says. So the families are compared on the same samples: where the samples
state errors of their slips, by binned samples with those errors removed
(`curves.online_comparison`), else by held-out score (`curves.hold_out`). Burckhardt's answer
remains where the data do not contradict it. Else the peak is the pooled one of the families that
the data cannot separate, with what the best of them leaves of the samples, and with the errors
common to all samples.
"""

from dataclasses import replace
from math import hypot
from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.curves.binned_points import build_points
from adhesion_can.estimation.curves.binned_samples import BinnedSamples, join_binned
from adhesion_can.estimation.curves.fit import (
    mean_conditions,
    noise_variance,
    standardised_residual,
)
from adhesion_can.estimation.curves.hold_out import (
    LEAST_SAMPLES,
    are_independent,
    compare_families,
    number_time_blocks,
)
from adhesion_can.estimation.curves.online_comparison import MISFIT_WIDTH, FamilyTracker
from adhesion_can.estimation.curves.peak import find_top
from adhesion_can.estimation.curves.points import CurvePoints, correlation_factor
from adhesion_can.estimation.curves.result import COMMON_ADHESION, COMMON_SLIP
from adhesion_can.estimation.identifiability import IdentifiabilitySettings, assess_peak
from adhesion_can.estimation.rail_peak import BURCKHARDT, RailPeak
from adhesion_can.physics.curves import Conditions, CurveFamily
from adhesion_can.physics.estimate import Estimate, Identifiable, PeakEstimate
from adhesion_can.physics.samples import Samples

MOST_SCORED = 20_000
"""Number of samples from which the held-out score takes every second one, every third, .."""
LEAST_PROBABILITY = 0.02
"""Probability of a family below which the data contradict it."""
BEST_AGREES, AGREES = 3.0, 2.0
"""Standard deviations of the pooled peak within which Burckhardt's is the same: where it is the
best family, and where another one is better."""
LEAST_WEIGHT = 0.05
"""Weight of Burckhardt's family in the pooled peak below which its own peak is not the answer."""
LEAST_FALL = 0.02
"""Fall of the curve beyond its peak, as a share of it, below which the peak has no place."""
MOST_CELLS, CELL_SAMPLES = 16, 8
"""Largest number of cells of slip over which a misfit is looked for, and least samples of one."""
MISFIT_LEVEL, LEAST_MISFIT = 1e-3, 0.01
"""Significance level of a misfit, and its root mean square as a share of μ_max, from which a
family does not hold."""
GRID = 160
"""Number of slips at which a curve's peak is looked at."""


class _Misfit(NamedTuple):
    """What a curve leaves of the means of samples.

    Attributes:
        square: Sum of squares by the inverse variances of independent errors.
        information: Sum of these inverse variances.
        freedom: Degrees of freedom.
        factor: Variance of a mean residual over that of independent errors.

    """

    square: float
    information: float
    freedom: int
    factor: float

    def size(self) -> float:
        """Root mean square beyond the noise; 0 where it is within chance."""
        # Less than is expected is within chance, and needs no quantile.
        if self.freedom < 1 or self.square <= self.factor * self.freedom:
            return 0.0
        # As scipy.stats.chi2.isf, which takes half a second to import.
        limit = self.factor * float(scipy.special.chdtri(self.freedom, MISFIT_LEVEL))
        if self.square <= limit:
            return 0.0
        return float(np.sqrt((self.square - self.factor * self.freedom) / self.information))


class _Comparison(NamedTuple):
    """Families compared on the samples of a surface.

    Attributes:
        plausible: Names of the families that the data cannot separate, the best first.
        weight: Weight of Burckhardt's family in the pooled peak.
        best: Family that describes the samples best.
        values: Its values.
        pooled: Peak pooled over the plausible families, without the common errors.
        misfit: What the best family leaves.
        conditions: Mean speed and load.

    """

    plausible: tuple[str, ...]
    weight: float
    best: CurveFamily
    values: Array
    pooled: PeakEstimate
    misfit: _Misfit
    conditions: Conditions


def find_rail_peak(
    samples: Samples,
    plain: Estimate,
    settings: IdentifiabilitySettings,
) -> RailPeak | None:
    """Peak of the rail by the families that hold on the samples of one surface.

    Args:
        samples: Samples in the order of their stamps; those without a speed take no part, since
            some families depend on it.
        plain: Estimate with Burckhardt's curve from these samples.
        settings: Limits from which the peak counts as identifiable.

    Returns:
        Peak; None for too few samples to compare families.

    """
    samples = samples.select(np.isfinite(samples.speed))
    if len(samples) < LEAST_SAMPLES:
        return None
    compare = _compare_binned if samples.slip_total_var.any() else _compare_scores
    comparison = compare(samples, plain, settings.slip_max)
    if comparison is None or not comparison.pooled.mu_max > 0.0:
        return None
    mu_max, lambda_m, mu_std, lambda_std = comparison.pooled
    misfit = comparison.misfit.size() / mu_max
    misfit = misfit if misfit >= LEAST_MISFIT else 0.0
    grid = np.geomspace(1e-3, settings.slip_max, GRID)
    curve = comparison.best.adhesion(grid, comparison.values, comparison.conditions)
    curvature = float(find_top(grid, curve)[2])
    peak = PeakEstimate(
        mu_max,
        lambda_m,
        hypot(mu_std, mu_max * misfit, mu_max * COMMON_ADHESION),
        hypot(lambda_std, lambda_m * misfit / MISFIT_WIDTH / curvature, COMMON_SLIP),
    )
    points = CurvePoints.from_samples(samples).compressed()
    return RailPeak(
        plausible=comparison.plausible,
        burckhardt_holds=not misfit and _burckhardt_agrees(plain, comparison),
        misfit=misfit,
        peak=peak,
        identifiable=_assess(samples, comparison, peak, settings),
        noise_std=noise_variance(points, comparison.best, comparison.values) ** 0.5,
        speed=float(comparison.conditions.speed),
        plain=plain,
    )


def _burckhardt_agrees(plain: Estimate, comparison: _Comparison) -> bool:
    """Whether Burckhardt's family is plausible, and its peak that of all plausible ones."""
    if BURCKHARDT not in comparison.plausible or comparison.weight < LEAST_WEIGHT:
        return False
    limit = BEST_AGREES if comparison.plausible[0] == BURCKHARDT else AGREES
    mu_max, lambda_m, mu_std, lambda_std = comparison.pooled
    return (
        abs(plain.mu_max - mu_max) <= limit * hypot(mu_std, plain.mu_max_std)
        and abs(plain.lambda_m - lambda_m) <= limit * hypot(lambda_std, plain.lambda_m_std)
    )  # fmt: skip


def _assess(
    samples: Samples, comparison: _Comparison, peak: PeakEstimate, settings: IdentifiabilitySettings
) -> Identifiable:
    """Whether the samples reach the peak, and whether the curve falls beyond it."""
    reached = float(np.quantile(np.abs(samples.slip), 1.0 - settings.reach))
    known = assess_peak(
        (peak.mu_max, peak.mu_max_std), (peak.lambda_m, peak.lambda_m_std), reached, settings
    )
    end = float(comparison.best.adhesion(reached, comparison.values, comparison.conditions))
    falls = end <= (1.0 - LEAST_FALL) * peak.mu_max
    enough = len(samples) >= settings.samples
    return Identifiable(mu_max=known.mu_max and enough, lambda_m=known.lambda_m and falls)


def _compare_binned(samples: Samples, plain: Estimate, slip_max: float) -> _Comparison | None:
    """Families on binned samples, the errors of the slips removed."""
    loaded = replace(samples, load=np.where(samples.load > 1.0, samples.load, np.nan))
    parts = [loaded.select(rows) for rows in _blocks(samples)]
    tracker, points = FamilyTracker(), CurvePoints.from_samples(samples).compressed()
    binned = [BinnedSamples.from_samples(part, plain.noise_std) for part in parts]
    comparison = tracker.compare(binned, plain.theta)
    if comparison is None:
        return None
    # Once more with the noise, and the errors that last, about the family that is best.
    best = comparison.leader
    noise_std = noise_variance(points, best.family, best.values) ** 0.5
    binned = [BinnedSamples.from_samples(part, noise_std) for part in parts]
    comparison = tracker.compare(binned, plain.theta) or comparison
    best, means = comparison.leader, build_points(join_binned(binned), plain.theta)
    residual = means.adhesion - means.predict(best.family, best.values)
    conditions = mean_conditions(points)
    names = sorted(comparison.probability, key=lambda name: -comparison.probability[name])
    return _Comparison(
        tuple(name for name in names if comparison.probability[name] >= LEAST_PROBABILITY),
        comparison.probability[BURCKHARDT],
        best.family,
        best.values,
        comparison.peak(conditions, slip_max),
        _Misfit(
            float(means.weight @ residual**2),
            float(means.weight.sum()),
            len(residual) - len(best.values),
            comparison.inflation,
        ),
        conditions,
    )


def _blocks(samples: Samples) -> list[NDArray[np.int64]]:
    """Rows of each block of time."""
    block, _ = number_time_blocks(samples)
    order = np.argsort(block, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(block[order])) + 1)


def _compare_scores(samples: Samples, _plain: Estimate, slip_max: float) -> _Comparison | None:
    """Families by held-out score, the slips taken as exact."""
    every = -(-len(samples) // MOST_SCORED)
    thin = samples.select(slice(None, None, every))
    comparison = compare_families(thin, slip_max=slip_max)
    if comparison is None:
        return None
    fit = comparison.families[0].fit
    values = np.array(fit.values)
    return _Comparison(
        comparison.plausible,
        sum(
            member.weight for member in comparison.families if member.fit.family.name == BURCKHARDT
        ),
        fit.family,
        values,
        PeakEstimate(
            comparison.mu_max, comparison.lambda_m, comparison.mu_max_std, comparison.lambda_m_std
        ),
        _misfit_by_slip(thin, fit.family, values, fit.noise_std),
        fit.conditions,
    )


def _misfit_by_slip(
    samples: Samples, family: CurveFamily, values: Array, noise_std: float
) -> _Misfit:
    """What a curve leaves of the samples' means over cells of slip."""
    points = CurvePoints.from_samples(samples)
    residual = standardised_residual(points, family, values, noise_std**2)
    factor = 1.0 if are_independent(samples) else correlation_factor(residual, samples)
    cells = min(MOST_CELLS, len(samples) // CELL_SAMPLES)
    rank = np.argsort(np.argsort(points.slip, kind="stable"), kind="stable")
    cell = rank * cells // len(samples)
    sums, count = np.bincount(cell, residual, cells), np.bincount(cell, minlength=cells)
    square = float(np.sum(sums**2 / count))
    return _Misfit(square, len(samples) / noise_std**2, cells - len(values), factor)
