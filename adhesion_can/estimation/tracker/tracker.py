"""The default estimator: posterior of the curve from all samples since the last surface change.

Per update, at a cost that does not depend on the length of the drive:

1. the samples become a vector of sums, weighted by the errors of their slips (`curve_sums`);
2. the run-length posterior gives the probability that the surface changed before one of the latest
   updates; after a change the estimate continues from the sums of that hypothesis (`run_length`);
3. the curves of the posterior are weighted by the sums (`posterior`), for several rates of
   forgetting, since humidity and temperature change the curve slowly; the rate with the best
   predictions has the largest weight (`memories`);
4. the deviations of single axles are estimated from their residuals (`axle_deviations`).

The estimate is the median over all curves, with standard deviations and 90 % intervals.
"""

from collections.abc import Iterable
from math import exp, hypot, inf, sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.identifiability import (
    FALL_SIGNIFICANCE,
    IdentifiabilitySettings,
)
from adhesion_can.estimation.tracker.axle_deviations import AxleDeviations
from adhesion_can.estimation.tracker.common_errors import common_shift
from adhesion_can.estimation.tracker.curve_sums import (
    curvature_at,
    residual_at,
    slope_at,
    slope_by_adhesion,
)
from adhesion_can.estimation.tracker.increment import increment
from adhesion_can.estimation.tracker.layout import BINS, CORRECTED, DOF, LENGTH
from adhesion_can.estimation.tracker.memories import FadingMemories
from adhesion_can.estimation.tracker.points import (
    CoastingGate,
    OutlierGate,
    build_points,
    is_valid,
    shows_surface,
)
from adhesion_can.estimation.tracker.posterior import (
    Curves,
    CurveSummary,
    NoisePrior,
    draw,
    join_parts,
    log_weights,
    normalise,
    summarise,
    widened_interval,
)
from adhesion_can.estimation.tracker.prior import Prior, shape_coordinates
from adhesion_can.estimation.tracker.run_length import (
    Evidence,
    RunLengthHypotheses,
)
from adhesion_can.estimation.tracker.settings import TrackerSettings
from adhesion_can.physics.burckhardt import CurveParameters, adhesion
from adhesion_can.physics.estimate import CHANGED, Estimate, Identifiable
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Stateful

MIN_MIXTURE_PROBABILITY = 0.05
"""Probability from which a hypothesis or a memory enters the estimate."""
MIN_EFFECTIVE_CURVES = 16.0
"""Least effective number of curves that describe a distribution."""
MAX_NOISE_SAMPLES = 20.0
"""Largest weight of the noise estimate on a new surface, samples: noise is the sensors'."""
NOISE_KNOWN_US = 2_000_000
"""Time after the first sample of all from which the noise of the slips is known, µs: before that
what the sensors do cannot be distinguished from another surface."""
NOT_REACHED = 0.32
"""Error of μ_max beside the posterior's standard deviation while the peak is not reached, which
makes that 1.05 times as large. The posterior takes the slips as chosen whatever the surface; but
who drives below the peak stops where the surface is about to give way. At 90 and 95 % of μ_max the
exact posterior's ±1.96 standard deviations hold 90.5 to 93.5 % (`tools/bench prepeak`)."""
COMMON_ERROR_THRESHOLD = 0.006
"""(c2 σ)² of the slip's error by the vehicle speed, from which `common_shift` is worth it."""
PRIVATE_ERROR_THRESHOLD = 0.001
"""(c2 σ)² of the slip's error by the wheel speed, from which weights need another slope."""


class Tracker(Stateful):
    """Estimator of the curve since the last change of the surface, as the module describes it.

    Args:
        settings: Settings of the tracker and of its parts; None: the defaults.
        identifiability: Limits from which the peak counts as identifiable; None: the defaults.
        known_changes_us: Stamps from which on the surface is another one, µs, for a reference that
            need not detect them; None: changes are detected from the samples.

    """

    def __init__(
        self,
        settings: TrackerSettings | None = None,
        identifiability: IdentifiabilitySettings | None = None,
        *,
        known_changes_us: Iterable[int] | None = None,
    ) -> None:
        self._settings = settings = settings or TrackerSettings()
        self._limits = limits = identifiability or IdentifiabilitySettings()
        self._known_changes = None if known_changes_us is None else sorted(known_changes_us)
        self._learned: list[CurveParameters] = list(settings.known_surfaces)
        prior = Prior(settings.prior, self._learned)
        slip_max, size = limits.slip_max, settings.curves
        noise_prior = NoisePrior(settings.noise_std**2, 1.0)
        self._memories = FadingMemories(settings.memory, prior, noise_prior, slip_max, size)
        self._hypotheses = RunLengthHypotheses(settings.run_length, prior)
        self._axles = AxleDeviations(settings.axles)
        self._gate = OutlierGate()
        self._coasting = CoastingGate()
        self._load_var = 0.0
        self._sign = 1.0
        self._now_us: int | None = None
        self._since_us = self._begun_us = 0
        self._settling = 0.0
        self._current: Estimate | None = None
        self.variance_inflation = 1.0
        """Variance of a mean residual over that by independent errors; at least 1. The evidence for
        a change of the surface is divided by it: errors that last look like changes."""

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        seconds = 0.0 if self._now_us is None else max(now_us - self._now_us, 0) * 1e-6
        self._now_us = now_us
        valid = is_valid(samples, self._limits.slip_max)
        if np.count_nonzero(valid) < len(valid):
            samples = samples.select(valid)
        usable = self._coasting.passes(samples)
        if np.count_nonzero(usable) < len(usable):
            samples = samples.select(usable)
        current = self._current
        if current is None:
            if not len(samples):
                return None
            current = self._begin(samples)
        self._memories.fade(seconds)
        self._axles.fade(seconds)
        changed = self._add(samples, current) if len(samples) else 0.0
        self._memories.refresh()
        self._current = self._estimate(changed)
        return self._current

    def _begin(self, samples: Samples) -> Estimate:
        given_var = float(np.mean(samples.adhesion_var))
        noise = NoisePrior(given_var, 4.0) if given_var > 0.0 else self._memories.noise
        self._memories.restart(np.zeros(LENGTH), noise)
        self._since_us = self._begun_us = int(samples.t_us[0])
        return self._estimate(0.0)

    def _add(self, samples: Samples, current: Estimate) -> float:
        """Add samples; returns the probability that the surface changed before the latest."""
        weigh = self._settings.errors_in_variables
        points = build_points(samples, errors_in_variables=weigh)
        noise_var = self._memories.noise_var
        theta = current.theta
        residual, slope = residual_at(points, theta), slope_at(points, theta)
        slip_var = points.private_var + points.common_var
        explained = noise_var + slope * slope * slip_var + points.transient_var
        good = self._gate.passes(np.abs(residual) / np.sqrt(explained), samples.axle)
        if good is not None:
            points, samples = points.select(good), samples.select(good)
            residual, slope, explained = residual[good], slope[good], explained[good]
        unmeasured = np.count_nonzero(samples.load_std)
        self._load_var = (
            float(np.mean((samples.load_std / samples.load) ** 2)) if unmeasured else 0.0
        )
        self._sign = points.sign.item(-1)
        moved = points
        weight_slope = curvature = None
        if current.c2**2 * points.private_var.max() > PRIVATE_ERROR_THRESHOLD:
            # From the measured adhesion, whatever the slip.
            weight_slope = slope_by_adhesion(points, current.theta)
        if current.c2**2 * points.common_var.max() > COMMON_ERROR_THRESHOLD:
            moved = common_shift(points, current.theta, noise_var)
            shift = points.slip - moved.slip
            residual, slope = residual_at(moved, current.theta), slope_at(moved, current.theta)
            # Points of a new surface must not be moved towards the current curve.
            moved = moved._replace(adhesion=points.adhesion - slope * shift)
        if weight_slope is not None:
            curvature = curvature_at(moved, slope, current.theta)
        # How far the slips reached comes from the sensors, not from the curve to be estimated.
        reached = points.surely_reached
        slip_max = self._limits.slip_max
        added = increment(moved, slope, noise_var, slip_max, weight_slope, curvature, reached)
        costs, cost = self._memories.predict(added)
        changed, restarted = self._look_for_change(Evidence(added, cost), samples)
        if not restarted:
            self._memories.add(added[CORRECTED], costs)
            level = points.adhesion - residual
            shifted = -points.sign * slope
            self._axles.add(samples.axle, level, shifted, residual, noise_var / explained)
        return changed

    # ------------------------------------------------------------------ surface changes

    def _look_for_change(self, evidence: Evidence, samples: Samples) -> tuple[float, bool]:
        """Probability that the surface changed, and whether the memories were restarted.

        After a restart they hold these samples already.
        """
        fresh = evidence.sums[CORRECTED]
        first_us = int(samples.t_us[0])
        if self._known_changes is not None:
            if not self._known_changes or first_us < self._known_changes[0]:
                return 0.0, False
            self._known_changes = [t for t in self._known_changes if t > first_us]
            self._restart(fresh, first_us)
            return 1.0, True
        if self._settling > 0.0:
            return 0.0, self._settle(evidence, first_us)
        too_early = first_us - self._begun_us < NOISE_KNOWN_US and samples.slip_common_var.any()
        if too_early or self._memories.dof < self._limits.samples or not shows_surface(samples):
            return 0.0, False
        self._hypotheses.add(evidence, first_us)
        factors = self._log_factors(self._memories.dof)
        changed = self._hypotheses.probability(factors)
        if changed >= CHANGED:
            best = int(np.argmax(factors))
            self._restart(self._hypotheses.sums[best], self._hypotheses.since_us[best])
            self._hypotheses.close(best, evidence, self._memories.noise_var)
            self._settling = float(self._settings.run_length.settling_samples)
        return changed, changed >= CHANGED

    def _log_factors(self, noise_dof: float | None) -> Array:
        noise_var, inflation = self._memories.noise_var, self.variance_inflation
        return self._hypotheses.log_factors(noise_var, noise_dof, inflation)

    def _restart(self, sums: Array, since_us: int) -> None:
        current = self._current
        if current is not None and current.identifiable.both:
            self._learn(current.theta)
        noise = NoisePrior(self._memories.noise_var, min(self._memories.dof, MAX_NOISE_SAMPLES))
        self._memories.prior = Prior(self._settings.prior, self._learned)
        self._memories.restart(sums, noise)
        self._axles.fade(0.0, share=0.1)
        self._since_us = since_us

    def _settle(self, evidence: Evidence, first_us: int) -> bool:
        """Revise the time of a change by later samples; whether the memories were restarted."""
        self._hypotheses.extend(evidence, first_us)
        self._settling -= float(evidence.sums[CORRECTED, DOF])
        best = int(np.argmax(self._log_factors(None)))
        moved = self._hypotheses.since_us[best] != self._since_us
        if moved:
            self._memories.restart(self._hypotheses.sums[best], self._memories.noise)
            self._since_us = self._hypotheses.since_us[best]
        if self._settling <= 0.0:
            self._hypotheses.clear()
        return moved

    def _learn(self, theta: CurveParameters) -> None:
        """Keep a surface for the prior; one that is known already is replaced."""
        spread = np.array(self._settings.prior.narrow_std)
        phi = shape_coordinates(np.array([*self._learned, theta]))
        deviation = np.abs(phi[:-1] - phi[-1]) / spread
        kept = [old for old, row in zip(self._learned, deviation, strict=True) if row.max() > 1.0]
        self._learned = [*kept, theta][max(len(kept) + 1 - self._settings.prior.learned, 0) :]

    # -------------------------------------------------------------------------- the estimate

    def _estimate(self, changed: float) -> Estimate:
        """Estimate from all memories, and from a change that is possible but not yet accepted."""
        parts = self._memories.leading(MIN_MIXTURE_PROBABILITY)
        if MIN_MIXTURE_PROBABILITY < changed < CHANGED:
            parts = [(curves, (1.0 - changed) * weights) for curves, weights in parts]
            parts.append(self._after_change(changed))
        curves, weights = parts[0] if len(parts) == 1 else join_parts(parts)
        summary = summarise(curves, weights)
        mu_max, lambda_m, theta = self._median_curve(summary)
        mu_lag, lambda_lag = self._memories.lag()
        load_std = mu_max * sqrt(self._load_var)
        mu_var, lambda_var = summary.mu_max_var, summary.lambda_m_var
        reached = _reach(self._memories.histogram, self._limits.reach, self._limits.slip_max)
        if reached < lambda_m:
            mu_lag = hypot(mu_lag, NOT_REACHED * sqrt(mu_var))
        extra_std = hypot(load_std, mu_lag)
        mu_std, lambda_std = hypot(sqrt(mu_var), mu_lag), hypot(sqrt(lambda_var), lambda_lag)
        covariance = summary.covariance
        identifiable = Identifiable(mu_max=False, lambda_m=False)
        if summary.effective < MIN_EFFECTIVE_CURVES:
            covariance, mu_std, lambda_std = np.diag([inf] * 3), inf, inf
            extra_std = lambda_lag = inf
        else:
            falls = summary.fall > FALL_SIGNIFICANCE * sqrt(covariance.item(8))
            identifiable = self._identifiable(
                mu_std / mu_max, (lambda_m, lambda_std), reached, falls=falls
            )
        return Estimate(
            c1=theta[0],
            c2=theta[1],
            c3=theta[2],
            covariance=covariance,
            mu_max=mu_max,
            mu_max_std=hypot(mu_std, load_std),
            lambda_m=lambda_m,
            lambda_m_std=lambda_std,
            noise_std=sqrt(self._memories.noise_var),
            samples=round(self._memories.count),
            identifiable=identifiable,
            surface_since_us=self._since_us,
            change_probability=changed,
            per_axle=self._axles.estimate(mu_max, lambda_m, self._sign, self._memories.noise_var),
            mu_max_interval=_with_estimate(widened_interval(summary.mu_max, extra_std), mu_max),
            lambda_m_interval=_with_estimate(
                widened_interval(summary.lambda_m, lambda_lag), lambda_m
            ),
        )

    def _median_curve(self, summary: CurveSummary) -> tuple[float, float, CurveParameters]:
        """μ_max, λ_m and (c1, c2, c3) of the curve with the medians of μ_m, λ_m and shape.

        Posteriors of a peak that is barely reached are skewed, and their means biased.
        """
        mu, slip, s = summary.mu_m, summary.slip_m, summary.shape
        c1, c2 = mu / (1.0 - exp(-s) * (1.0 + s)), s / slip
        theta = (c1, c2, c1 * c2 * exp(-s))
        end = self._limits.slip_max
        return (mu, slip, theta) if slip <= end else (float(adhesion(end, *theta)), end, theta)

    def _after_change(self, changed: float) -> tuple[Curves, Array]:
        """Curves of the most probable hypothesis, weighted by the probability of a change."""
        factors = self._hypotheses.log_factors(self._memories.noise_var, self._memories.dof)
        sums = self._hypotheses.sums[int(np.argmax(factors))]
        noise = NoisePrior(self._memories.noise_var, min(self._memories.dof, MAX_NOISE_SAMPLES))
        slip_max, size = self._limits.slip_max, self._settings.curves
        curves = draw(sums, noise, self._memories.prior, slip_max, size)
        costs, dof = curves.costs(sums), float(sums[DOF])
        weights = normalise(log_weights(curves.log_base, costs, dof, noise))
        return curves, changed * weights

    def _identifiable(
        self, mu_max_std: float, lambda_m: tuple[float, float], reached: float, *, falls: bool
    ) -> Identifiable:
        """Whether data, not the prior, determine the peak: reached, with a significant fall beyond.

        Args:
            mu_max_std: Relative standard deviation of μ_max, 1.
            lambda_m: Slip ratio λ_m of the peak and its standard deviation, 1.
            reached: Slip ratio that the share `reach` of the samples exceeds.
            falls: Whether the fall beyond the peak is significant.

        """
        settings = self._limits
        if self._memories.dof < settings.samples:
            return Identifiable(mu_max=False, lambda_m=False)
        slip, slip_std = lambda_m
        farthest = slip + 2.0 * slip_std
        narrow = falls and slip_std <= settings.lambda_m_std * slip
        return Identifiable(
            mu_max=mu_max_std <= settings.mu_max_std
            and reached >= settings.mu_max_reach * farthest,
            lambda_m=narrow and reached >= farthest,
        )


def _with_estimate(interval: tuple[float, float], value: float) -> tuple[float, float]:
    """Interval that holds the estimate, which may lie beside it where hardly anything is known.

    The estimate is a curve with the medians of μ_m, λ_m and shape, each of them by itself.
    """
    return min(interval[0], value), max(interval[1], value)


def _reach(histogram: Array, share: float, slip_max: float) -> float:
    """Slip ratio that a share of the samples exceeds, by the lower edge of its bin."""
    beyond = histogram[::-1].cumsum()
    count = int(np.count_nonzero((beyond > 0.0) & (beyond >= share * beyond[-1])))
    return max(count - 1, 0) * slip_max / BINS
