"""Estimation with an extended model: the base curve by any estimator, effects added afterwards."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from math import hypot, isfinite

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.extended.correction import (
    build_contact,
    have_channels,
    remove_effects,
    scale_to_usual,
)
from adhesion_can.estimation.extended.current_curve import (
    CurvePeaks,
    LatestConditions,
    LatestLagStates,
    SteadyLagStates,
    compute_peaks,
)
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.estimation.extended.switch_times import switches_of
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.normal_quantiles import NORMAL_90
from adhesion_can.physics.burckhardt import peak
from adhesion_can.physics.effects import LagStates, compute_change
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import Samples

UPDATES = 10
"""Number of updates with samples between two computations of the peak's sensitivities."""
FARTHEST_PLACE = 1.5
"""Largest ratio of the base curve's λ_m to that of the model's, either way, at which the shape of a
model with another curve family is that of the rail: elsewhere nobody has seen it."""
LATE_US = 50_000
"""Time after a step of a signal within which a sample may belong to the value before, µs: samples
wait for the readings that bracket them, and a slow message may come a little late."""
STEP = 0.1
"""Step of an effect's parameter for a sensitivity, in its standard deviations."""


class ExtendedEstimator:
    """Estimator of the base curve that gives the curve in the conditions of the latest samples.

    This curve is factor · curve(slip') with the speed, loads, covariates and states of the latest
    samples. The estimate has its peak, and as (c1, c2, c3) the Burckhardt curve with this peak and
    the base curve's shape. Effects of time alone (slow drift, a spline over time) count as 1: the
    estimator follows such changes itself. Where the usual factor of the effects is far from 1, the
    base curve is that of the usual factor: a level beyond any rail's is none for an estimator.

    The uncertainty of the effects' parameters adds to that of the peak as far as the latest
    conditions differ from those in which the base curve was estimated. In the same conditions the
    errors of an effect cancel out.

    Args:
        inner: New estimator for the base curve.
        model: Extended model with the effects.
        axles: Number of axles of the vehicle, for the order of the axles in reverse.
        settings: Limits from which the peak counts as identifiable, and range of slip.

    """

    def __init__(
        self,
        inner: Estimator,
        model: ExtendedModel,
        axles: int = 6,
        settings: IdentifiabilitySettings | None = None,
    ) -> None:
        self._inner = inner
        self._settings = settings or IdentifiabilitySettings()
        self._actives = model.online
        self._directions = [
            _principal_directions(model.covariance_of(active)) for active in self._actives
        ]
        self._axles = axles
        self._shape_place = None if model.curve is None else float(peak(*model.base).lambda_m)
        self._form_std = (0.0, 0.0) if model.curve is None else model.curve.peak_std
        self._scaled = False
        self._signals = _SteppedSignals()
        self._switches = switches_of(self._actives)
        self._lags = LatestLagStates()
        self._origin_us: int | None = None
        self._conditions: LatestConditions | None = None
        self._uncertainty = _EffectUncertainty()
        self._base: Estimate | None = None
        self._current: Estimate | None = None
        self.left_out: Counter[str] = Counter()
        """Number of samples to which the model could not be applied, by reason."""

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        corrected = self._correct(samples) if len(samples) else samples
        base = self._inner.update(corrected, now_us)
        if base is None or self._conditions is None:
            return None
        if base is not self._base or len(samples):
            self._base, self._current = (
                base,
                self._with_effects(base, self._conditions, len(corrected)),
            )
        return self._current

    def _correct(self, samples: Samples) -> Samples:
        """Samples of the base curve; the latest conditions follow."""
        if self._origin_us is None:
            self._origin_us = int(samples.t_us[0])
        origin, axles = self._origin_us, self._axles
        if not self._scaled:
            scaled = scale_to_usual(samples, self._actives, origin, axles)
            self._scaled, self._actives = scaled is not None, scaled or self._actives
        before = self._signals.update(samples)
        samples = self._with_switches(samples)
        if before is not None:
            samples = self._with_uncertain_signals(samples, before)
        result = remove_effects(samples, self._actives, origin, axles, self._lags)
        self.left_out += result.left_out
        # Also from samples of which the effects leave too little: coasting in a curve.
        if result.contact is not None:
            self._conditions = LatestConditions.update(result.contact, self._conditions)
        return result.samples

    def _with_switches(self, samples: Samples) -> Samples:
        """Samples with the values of switches that they show, before their messages do."""
        base = self._base
        if not self._switches or base is None:
            return samples
        if not have_channels(samples, self._actives, Counter()).all():
            return samples
        steady = SteadyLagStates(self._lags.states)
        for switch in self._switches:
            samples = switch.apply(samples, base, self._actives, steady, self._axles)
        return samples

    def _with_uncertain_signals(self, samples: Samples, before: Mapping[str, float]) -> Samples:
        """Samples whose variances hold the difference that values before a step would make.

        Args:
            samples: Samples soon after a step of a signal.
            before: Values of the signals before the step, by name.

        """
        known = have_channels(samples, self._actives, Counter())
        if not known.any():
            return samples
        steady = SteadyLagStates(self._lags.states)
        now = build_contact(samples.select(known), int(samples.t_us[0]), self._axles)
        held = {name: np.full(len(now.slip), value) for name, value in before.items()}
        then = replace(now, covariates={**now.covariates, **held})
        new, old = (
            compute_change(self._actives, contact, steady).factor for contact in (now, then)
        )
        var = samples.transient_var.copy()
        var[known] += ((old / new - 1.0) * now.adhesion) ** 2
        return replace(samples, transient_var=var)

    def _with_effects(
        self, base: Estimate, conditions: LatestConditions, fresh: int
    ) -> Estimate | None:
        """Estimate of the curve in the latest conditions; None where the effects have no value."""
        lags, slip_max = SteadyLagStates(self._lags.states), self._settings.slip_max
        peaks = compute_peaks(base, self._actives, conditions, lags, slip_max)
        if not (isfinite(peaks.mu_max) and isfinite(peaks.lambda_m)):
            return None
        if self._uncertainty.is_due(fresh):
            sensitivities = self._sensitivities(base, conditions, lags, peaks)
            self._uncertainty.update(sensitivities, base.samples)
        mu_std, lambda_std = map(hypot, self._uncertainty.stds, self._form_std)
        estimate = scale_estimate(base, peaks, mu_std, lambda_std, self._settings)
        # Far from where the shape was found, the curve may have another one.
        place, reach = self._shape_place, FARTHEST_PLACE * base.lambda_m
        if place is None or place <= reach <= FARTHEST_PLACE**2 * place:
            return estimate
        return replace(estimate, identifiable=Identifiable(mu_max=False, lambda_m=False))

    def _sensitivities(
        self, base: Estimate, conditions: LatestConditions, lags: LagStates, at: CurvePeaks
    ) -> Array:
        """Changes of (ln μ_max, ln λ_m) per standard deviation of the parameters; shape (k, 2)."""
        rows = []
        for place, directions in enumerate(self._directions):
            for direction in directions:
                active, actives = self._actives[place], list(self._actives)
                moved = np.array(active.values) + STEP * direction
                actives[place] = replace(active, values=tuple(moved.tolist()))
                to = compute_peaks(base, actives, conditions, lags, self._settings.slip_max)
                rows.append((to.mu_max / at.mu_max - 1.0, to.lambda_m / at.lambda_m - 1.0))
        return np.array(rows).reshape(-1, 2) / STEP


def _principal_directions(covariance: Array) -> Array:
    """Principal directions of a covariance (k, k), each one standard deviation long, (m, k)."""
    std = np.sqrt(covariance.diagonal())
    scale = np.where(std > 0.0, std, 1.0)
    # Eigenvectors of the correlations, as parameters differ by many powers of ten.
    variances, directions = np.linalg.eigh(covariance / scale / scale[:, None])
    good = variances > 1e-9
    return np.asarray((directions * np.sqrt(np.maximum(variances, 0.0)) * scale[:, None]).T[good])


class _SteppedSignals:
    """Covariates that have taken a new value lately, with the value before."""

    def __init__(self) -> None:
        self._latest: dict[str, float] = {}
        self._before: dict[str, tuple[int, float]] = {}
        """By name: stamp of the first sample after the step, µs, and value before it."""

    def update(self, samples: Samples) -> dict[str, float] | None:
        """Values before the latest steps, by name; None where none was late enough to matter."""
        now_us = int(samples.t_us[0])
        for name, column in samples.covariates.items():
            value = float(column[-1])
            known = self._latest.get(name, value)
            if value != known and isfinite(known) and isfinite(value):
                self._before[name] = now_us, known
            self._latest[name] = value
        late = {n: v for n, (t_us, v) in self._before.items() if 0 <= now_us - t_us <= LATE_US}
        return late or None


class _EffectUncertainty:
    """Standard deviation of the peak by the uncertainty of the effects' parameters."""

    def __init__(self) -> None:
        self._updates = 0
        self._samples = 0
        self._mean: Array | None = None
        self.stds = (0.0, 0.0)
        """Relative standard deviations of μ_max and λ_m."""

    def is_due(self, fresh: int) -> bool:
        """Whether the sensitivities are due again, after an update with so many new samples."""
        self._samples += fresh
        self._updates -= fresh > 0
        return self._updates < 0

    def update(self, sensitivities: Array, samples: int) -> None:
        """Set the standard deviations from the sensitivities in the latest conditions.

        Args:
            sensitivities: Changes of (ln μ_max, ln λ_m) per standard deviation, shape (k, 2).
            samples: Number of samples from which the base curve was estimated.

        """
        share = min(1.0, self._samples / max(samples, 1))
        mean = sensitivities if self._mean is None else self._mean
        self._mean = mean + share * (sensitivities - mean)
        deviation = sensitivities - self._mean
        mu_max, lambda_m = np.sqrt((deviation * deviation).sum(axis=0)).tolist()
        self.stds = (mu_max, lambda_m)
        self._updates, self._samples = UPDATES, 0


def scale_estimate(
    base: Estimate,
    peaks: CurvePeaks,
    mu_std_share: float,
    lambda_std_share: float,
    settings: IdentifiabilitySettings,
) -> Estimate:
    """Estimate with the base curve scaled to the peaks with effects.

    Args:
        base: Estimate of the base curve.
        peaks: Peaks with effects.
        mu_std_share: Further relative standard deviation of μ_max, 1.
        lambda_std_share: Further relative standard deviation of λ_m, 1.
        settings: Limits from which the peak counts as identifiable.

    """
    high = peaks.mu_max / base.mu_max if base.mu_max > 0.0 else 1.0
    wide = peaks.lambda_m / base.lambda_m if base.lambda_m > 0.0 else 1.0
    mu_max, lambda_m = base.mu_max * high, base.lambda_m * wide
    scale = np.array([high, 1.0 / wide, high / wide])
    mu_std, lambda_std = mu_std_share * mu_max, lambda_std_share * lambda_m
    pooled = (peaks.mu_max, peaks.lambda_m)
    per_axle = {
        axle: (axle_peak[0] * to[0] / base.mu_max, axle_peak[1] * to[1] / base.lambda_m)
        for axle, axle_peak in base.per_axle.items()
        if base.mu_max > 0.0 and base.lambda_m > 0.0
        for to in (peaks.axles.get(axle, pooled),)
    }
    return replace(
        base,
        c1=base.c1 * high,
        c2=base.c2 / wide,
        c3=base.c3 * high / wide,
        covariance=base.covariance * np.outer(scale, scale),
        mu_max=mu_max,
        mu_max_std=hypot(base.mu_max_std * high, mu_std),
        lambda_m=lambda_m,
        lambda_m_std=hypot(base.lambda_m_std * wide, lambda_std),
        noise_std=base.noise_std,
        identifiable=Identifiable(
            mu_max=base.identifiable.mu_max and mu_std_share <= settings.mu_max_std,
            lambda_m=base.identifiable.lambda_m and lambda_std_share <= settings.lambda_m_std,
        ),
        per_axle=per_axle,
        mu_max_interval=_scaled_interval(base.mu_max_interval, base.mu_max, high, mu_std),
        lambda_m_interval=_scaled_interval(base.lambda_m_interval, base.lambda_m, wide, lambda_std),
    )


def _scaled_interval(
    interval: tuple[float, float], middle: float, by: float, further_std: float
) -> tuple[float, float]:
    """90 % interval scaled about 0 and widened by an independent error."""
    more = NORMAL_90 * further_std
    low, high = by * (middle - interval[0]), by * (interval[1] - middle)
    if not more:
        return by * interval[0], by * interval[1]
    return by * middle - hypot(low, more), by * middle + hypot(high, more)
