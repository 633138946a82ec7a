"""Estimator that doubts itself: a tracker, and the comparison of its model with the drive."""

from dataclasses import replace
from math import hypot, inf, sqrt

import numpy as np

from adhesion_can.estimation.curves.online_comparison import FamilyComparison
from adhesion_can.estimation.doubt.monitor import DoubtMonitor, further_std
from adhesion_can.estimation.doubt.settings import DoubtSettings, InstrumentUncertainty
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.normal_quantiles import NORMAL_90
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.burckhardt import peak as burckhardt_peak
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.curves.burckhardt_family import curve_with_peak
from adhesion_can.physics.curves.same_peak import burckhardt_with_same_peak
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.estimate import Estimate, Identifiable, PeakEstimate, has_peak
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Stateful

BURCKHARDT = "burckhardt"
SPEED_STEP = 0.5
"""Change of the speed from which the peak is computed again, m/s."""


class DoubtingTracker(Stateful):
    """Tracker whose standard deviations contain what its model may be wrong by.

    The comparison works on blocks of the drive. Between them the latest assessment holds. The
    tracker learns from it how long errors last, so that they do not look like changes of the
    surface.

    Args:
        tracker: New tracker.
        axles: Number of axles of the vehicle.
        settings: Settings of the doubt.
        instruments: Errors of the instruments before the data show them.
        limits: Limits from which the peak counts as identifiable; None: the defaults.

    """

    def __init__(
        self,
        tracker: Tracker,
        axles: int,
        settings: DoubtSettings | None = None,
        instruments: InstrumentUncertainty | None = None,
        limits: IdentifiabilitySettings | None = None,
    ) -> None:
        self._tracker = tracker
        self._limits = limits or IdentifiabilitySettings()
        self._settings = settings = settings or DoubtSettings()
        self._monitor = DoubtMonitor(
            axles,
            settings,
            instruments or InstrumentUncertainty(),
            self._limits.slip_max,
        )
        self._conditions: Conditions | None = None
        self._peak: (
            tuple[tuple[FamilyComparison, int], tuple[PeakEstimate, CurveParameters]] | None
        ) = None
        self._inner: Estimate | None = None
        self._current: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        inner = self._tracker.update(samples, now_us)
        if inner is None:
            return None
        fresh = len(samples) > 0 and self._monitor.add(samples, inner)
        if fresh:
            self._tracker.variance_inflation = self._monitor.inflation
        if fresh or inner is not self._inner:
            self._inner, self._current = inner, self._judged(inner, samples)
        return self._current

    def _judged(self, estimate: Estimate, samples: Samples) -> Estimate:
        """Estimate with what may be wrong with it; pooled where families know it better."""
        widened = self._widened(estimate)
        comparison = self._monitor.assessment.families
        if comparison is None:
            return widened
        if len(samples):
            self._conditions = Conditions(float(samples.speed.mean()), float(samples.load.mean()))
        if self._conditions is None or not self._monitor.surface_holds:
            return widened
        pooled, theta = self._pooled(comparison, self._conditions)
        if not has_peak(pooled):
            return widened
        limits = self._limits
        mu_share, lambda_share = self._monitor.assessment.instrument_std
        # The level that comes next scatters about the mean one.
        mu_share = hypot(mu_share, self._monitor.level_std)
        mu_std = hypot(pooled.mu_max_std, mu_share * pooled.mu_max)
        lambda_std = hypot(pooled.lambda_m_std, lambda_share * pooled.lambda_m)
        known = (
            mu_std <= limits.mu_max_std * pooled.mu_max
            and lambda_std <= limits.lambda_m_std * pooled.lambda_m
            and pooled.lambda_m + lambda_std <= self._monitor.reached
        )
        if not known:
            if widened.doubt is not Doubt.SHAPE:
                return widened
            # What no family knows, a curve whose form is in doubt does not know either.
            return self._widened(estimate, (mu_std / pooled.mu_max, lambda_std / pooled.lambda_m))
        # The curve's numbers are as uncertain as its peak.
        level, place = mu_std / pooled.mu_max, lambda_std / pooled.lambda_m
        stds = np.array(theta) * (level, place, hypot(level, place))
        by_mu, by_lambda = pooled.mu_max / estimate.mu_max, pooled.lambda_m / estimate.lambda_m
        return replace(
            widened,
            c1=theta[0],
            c2=theta[1],
            c3=theta[2],
            covariance=np.diag(stds * stds),
            mu_max=pooled.mu_max,
            mu_max_std=mu_std,
            lambda_m=pooled.lambda_m,
            lambda_m_std=lambda_std,
            identifiable=Identifiable(mu_max=True, lambda_m=True),
            mu_max_interval=_interval(pooled.mu_max, mu_std),
            lambda_m_interval=_interval(pooled.lambda_m, lambda_std),
            per_axle={
                axle: (mu_max * by_mu, lambda_m * by_lambda)
                for axle, (mu_max, lambda_m) in estimate.per_axle.items()
            },
            family=comparison.leader.family.name,
        )

    def _pooled(
        self, comparison: FamilyComparison, conditions: Conditions
    ) -> tuple[PeakEstimate, CurveParameters]:
        """Pooled peak and the Burckhardt curve that has it; again for another block or speed."""
        key = comparison, round(float(conditions.speed) / SPEED_STEP)
        if self._peak is None or self._peak[0] != key:
            end, leader = self._limits.slip_max, comparison.leader
            peak = comparison.peak(conditions, end)
            if not (
                has_peak(peak) and leader.family.peak(leader.values, conditions, end).mu_max > 0
            ):
                # Efforts that read 0, or have the wrong sign: no curve has such a peak.
                self._peak = key, (PeakEstimate(0.0, 0.0, inf, inf), (0.0, 0.0, 0.0))
                return self._peak[1]
            nearest = burckhardt_with_same_peak(leader.family, leader.values, conditions, end)
            top = burckhardt_peak(*nearest)
            theta = curve_with_peak(peak.mu_max, peak.lambda_m, nearest[1] * float(top.lambda_m))
            self._peak = key, (peak, theta)
        return self._peak[1]

    def _widened(self, estimate: Estimate, least: tuple[float, float] = (0.0, 0.0)) -> Estimate:
        """Estimate with the standard deviations that the latest assessment leaves it.

        Args:
            estimate: Estimate of the tracker.
            least: Least standard deviations of μ_max and λ_m, as shares of them.

        """
        if not has_peak(estimate):
            nothing = Identifiable(mu_max=False, lambda_m=False)
            return replace(estimate, mu_max_std=inf, lambda_m_std=inf, identifiable=nothing)
        assessment, limits = self._monitor.assessment, self._limits
        mu_share, lambda_share = map(max, further_std(assessment, estimate), least)
        if assessment.plain is None:
            # Samples near the peak tell its height, whatever the shape, but not its place.
            lambda_share = self._settings.first_lambda_m_std
        lambda_share = max(lambda_share, self._monitor.slip_error(estimate.lambda_m))
        mu_share = max(mu_share, self._monitor.level_error(estimate.mu_max))
        # What the full model explains, its distance from the estimate stands for.
        remaining = assessment.remaining
        inflation = remaining.beyond_chance
        # The level that comes next scatters about the mean one, over blocks or half seconds.
        level = remaining.level_std / estimate.mu_max if inflation > 1.0 else 0.0
        scatter = self._monitor.level_scatter
        if assessment.doubt is Doubt.NONE:
            level = max(level, scatter)
        else:
            # The distance to the full model is a part of that scatter.
            mu_share = max(mu_share, scatter)
        mu_share = hypot(mu_share, level)
        scale = sqrt(inflation)
        mu_std = hypot(scale * estimate.mu_max_std, mu_share * estimate.mu_max)
        lambda_std = hypot(scale * estimate.lambda_m_std, lambda_share * estimate.lambda_m)
        known = estimate.identifiable
        return replace(
            estimate,
            covariance=inflation * estimate.covariance,
            mu_max_std=mu_std,
            lambda_m_std=lambda_std,
            identifiable=Identifiable(
                mu_max=known.mu_max and mu_std <= limits.mu_max_std * estimate.mu_max,
                lambda_m=known.lambda_m and lambda_std <= limits.lambda_m_std * estimate.lambda_m,
            ),
            mu_max_interval=_widened_interval(
                estimate.mu_max_interval, estimate.mu_max, scale, mu_share * estimate.mu_max
            ),
            lambda_m_interval=_widened_interval(
                estimate.lambda_m_interval,
                estimate.lambda_m,
                scale,
                lambda_share * estimate.lambda_m,
            ),
            doubt=Doubt.NOT_AVAILABLE if assessment.plain is None else assessment.doubt,
            family=BURCKHARDT,
        )


def _interval(middle: float, std: float) -> tuple[float, float]:
    """90 % interval of a normal distribution."""
    return middle - NORMAL_90 * std, middle + NORMAL_90 * std


def _widened_interval(
    interval: tuple[float, float], middle: float, scale: float, further_std: float
) -> tuple[float, float]:
    """90 % interval scaled about the estimate, and widened by an independent error."""
    more = NORMAL_90 * further_std
    below, above = scale * (middle - interval[0]), scale * (interval[1] - middle)
    return middle - hypot(below, more), middle + hypot(above, more)
