"""The default estimator: the curve from all samples since the rail last changed.

Per update, at a cost that does not depend on the length of the drive:

1. the samples become an increment of sums (`segments`), weighed by the errors of their slips;
2. run-length hypotheses (`changes`) say whether the rail is another one since one of the latest
   updates; if so, the estimate goes on from the sums of that hypothesis;
3. the posterior's curves (`posterior`) are weighted by the sums, for several memories, since
   humidity and temperature move the curve slowly: the one that has predicted best leads
   (`memories`);
4. what single axles have of their own is told from their residuals (`axles`).

What comes out is the median over all of them, with standard deviations and 90 % intervals.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import exp, hypot, inf, sqrt
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.tracker.axle_deviations import AxleDeviations, AxleSettings
from adhesion_can.estimation.tracker.curve_sums import (
    BINS,
    DOF,
    HISTOGRAM,
    LENGTH,
    Points,
    Theta,
    bend_at,
    common_shift,
    increment,
    residual_at,
    slope_at,
    slope_by_adhesion,
)
from adhesion_can.estimation.tracker.memories import Memories, MemorySettings
from adhesion_can.estimation.tracker.points import GlitchGate, is_usable, points_of
from adhesion_can.estimation.tracker.posterior import (
    Curves,
    Noise,
    draw,
    effective,
    joined,
    log_weights,
    normalised,
)
from adhesion_can.estimation.tracker.prior import (
    Prior,
    PriorSettings,
    shape_coordinates,
)
from adhesion_can.estimation.tracker.run_length import Contenders, RunLengthSettings
from adhesion_can.physics.burckhardt import CurveParameters, adhesion
from adhesion_can.physics.estimate import CHANGED, Estimate, Identifiable
from adhesion_can.physics.samples import Samples

MIXED_FROM = 0.05
"""Probability from which a hypothesis enters the estimate."""
FEWEST_CURVES = 16.0
"""Fewer curves than these, effectively, describe no distribution."""
NOISE_KEPT = 20.0
"""Samples that the knowledge of the noise is worth on a new rail: it belongs to the sensors."""
FALL_SEEN = 4.0
"""c3 over its standard deviation from which the curve was seen to fall beyond its peak."""


SHARES = (0.05, 0.5, 0.95)
WORTH_A_SHIFT = 0.006
"""(c2 σ)² of the vehicle speed's error in slip from which the curve bends within it."""
WORTH_A_CORRECTION = 0.001
"""Likewise of the wheel speed's, from which the weights must not go with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackerSettings:
    """Settings of the tracker, with those of its parts.

    Attributes:
        curves: Number of weighted curves that represent the posterior of each fading memory; even,
            at least 64. More curves: smoother intervals, proportionally more CPU.
        noise_std: Standard deviation of the adhesion noise before the first samples, where these
            carry no variance of their own, 1. It is then estimated; a larger value only makes the
            first updates less certain.
        errors_in_variables: Whether the variances of the slips are used (generalised least squares
            with corrected scores); False takes the slips as exact, which biases the peak where
            their errors are large.
        run_length: Settings of the detection of surface changes, section `[run_length]`.
        memory: Settings of the fading memories, section `[memory]`.
        prior: Settings of the prior of a new surface, section `[prior]`.
        axles: Settings of the deviations of single axles, section `[axles]`.
        known_surfaces: (c1, c2, c3) of surfaces that an earlier run identified; they enter the
            prior from the start. Not a key of the configuration file.

    """

    curves: int = 384
    noise_std: float = 0.003
    errors_in_variables: bool = True
    run_length: RunLengthSettings = field(default_factory=RunLengthSettings)
    memory: MemorySettings = field(default_factory=MemorySettings)
    prior: PriorSettings = field(default_factory=PriorSettings)
    axles: AxleSettings = field(default_factory=AxleSettings)
    known_surfaces: tuple[CurveParameters, ...] = field(default=(), metadata={"toml": False})

    def __post_init__(self) -> None:
        if self.curves < 64 or self.curves % 2 or not self.noise_std > 0:
            raise ValueError("curves must be even and at least 64, noise_std positive")


class _Parts(NamedTuple):
    """Settings by the part that they are for."""

    tracker: TrackerSettings
    run_length: RunLengthSettings
    memory: MemorySettings
    prior: PriorSettings
    axles: AxleSettings
    identifiability: IdentifiabilitySettings


class Tracker:
    """Follows the curve through a stream of samples; see the module.

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
        settings = settings or TrackerSettings()
        self._parts = parts = _Parts(
            tracker=settings,
            run_length=settings.run_length,
            memory=settings.memory,
            prior=settings.prior,
            axles=settings.axles,
            identifiability=identifiability or IdentifiabilitySettings(),
        )
        self._told = None if known_changes_us is None else sorted(known_changes_us)
        self._learned: list[Theta] = list(settings.known_surfaces)
        prior = Prior(parts.prior, self._learned)
        slip_max, size = parts.identifiability.slip_max, parts.tracker.curves
        own = Noise(parts.tracker.noise_std**2, 1.0)
        self._memories = Memories(parts.memory, prior, own, slip_max, size)
        self._contenders = Contenders(parts.run_length, prior)
        self._axles = AxleDeviations(parts.axles)
        self._gate = GlitchGate()
        self._load_var = 0.0
        self._sign = 1.0
        self._now_us: int | None = None
        self._since_us = 0
        self._settling = 0.0
        self._held: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """See `Estimator.update`."""
        seconds = 0.0 if self._now_us is None else max(now_us - self._now_us, 0) * 1e-6
        self._now_us = now_us
        usable = is_usable(samples, self._parts.identifiability.slip_max)
        if not usable.all():
            samples = samples.select(usable)
        held = self._held
        if held is None:
            if not len(samples):
                return None
            held = self._begin(samples)
        self._memories.fade(seconds)
        self._axles.fade(seconds)
        changed = self._take(samples, held) if len(samples) else 0.0
        self._memories.refresh()
        self._held = self._estimate(changed)
        return self._held

    def _begin(self, samples: Samples) -> Estimate:
        stated = float(np.mean(samples.adhesion_var))
        noise = Noise(stated, 4.0) if stated > 0.0 else self._memories.noise
        self._memories.restart(np.zeros(LENGTH), noise)
        self._since_us = int(samples.t_us[0])
        return self._estimate(0.0)

    def _take(self, samples: Samples, held: Estimate) -> float:
        """Take samples; returns the probability that the rail changed with the latest of them."""
        weigh = self._parts.tracker.errors_in_variables
        points = points_of(samples, errors_in_variables=weigh)
        noise_var = self._memories.noise_var
        residual, slope = residual_at(points, held.theta), slope_at(points, held.theta)
        explained = noise_var + slope * slope * (points.private_var + points.common_var)
        explained += points.transient_var
        good = self._gate.passes(np.abs(residual) / np.sqrt(explained), samples.axle)
        if good is not None:
            points, samples = points.select(good), samples.select(good)
            residual, slope, explained = residual[good], slope[good], explained[good]
        unmeasured = samples.load_std.any()
        self._load_var = (
            float(np.mean((samples.load_std / samples.load) ** 2)) if unmeasured else 0.0
        )
        self._sign = float(points.sign[-1])
        added = fresh = self._sums_of(points, slope, held)
        if held.c2**2 * points.common_var.max() > WORTH_A_SHIFT:
            moved = common_shift(points, held.theta, noise_var)
            shift = points.slip - moved.slip
            residual, slope = residual_at(moved, held.theta), slope_at(moved, held.theta)
            # Another rail's points are not moved: they must not be bent towards the present one.
            moved = moved._replace(adhesion=points.adhesion - slope * shift)
            added = self._sums_of(moved, slope, held, points)
            # How far the slips reached is told by the sensors, not by the curve in question.
            added[HISTOGRAM] = fresh[HISTOGRAM]
        costs, cost = self._memories.predict(added)
        changed, anew = self._look_for_change(fresh, cost, samples)
        if not anew:
            self._memories.take(added, costs)
            level = points.adhesion - residual
            shifted = -points.sign * slope
            self._axles.add(samples.axle, level, shifted, residual, noise_var / explained)
        return changed

    def _sums_of(
        self, points: Points, slope: Array, held: Estimate, measured: Points | None = None
    ) -> Array:
        """Sums of points; the private errors are told by the adhesion as it was measured."""
        own_slope = bend = None
        if held.c2**2 * points.private_var.max() > WORTH_A_CORRECTION:
            own_slope = slope_by_adhesion(measured or points, held.theta)
            bend = bend_at(points, slope, held.theta)
        slip_max = self._parts.identifiability.slip_max
        return increment(points, slope, self._memories.noise_var, slip_max, own_slope, bend)

    # ------------------------------------------------------------------ changes of the rail

    def _look_for_change(self, fresh: Array, cost: float, samples: Samples) -> tuple[float, bool]:
        """Probability that the rail changed, and whether the memories have begun anew.

        Then they hold these samples already.
        """
        first_us = int(samples.t_us[0])
        if self._told is not None:
            if not self._told or first_us < self._told[0]:
                return 0.0, False
            self._told = [t for t in self._told if t > first_us]
            self._begin_anew(fresh, first_us)
            return 1.0, True
        if self._settling > 0.0:
            return 0.0, self._settle(fresh, first_us)
        if self._memories.dof < self._parts.identifiability.samples:
            return 0.0, False
        self._contenders.add(fresh, cost, first_us)
        factors = self._contenders.log_factors(self._memories.noise_var, self._memories.dof)
        changed = self._contenders.probability(factors)
        if changed >= CHANGED:
            best = int(np.argmax(factors))
            self._begin_anew(self._contenders.sums[best], self._contenders.since_us[best])
            self._contenders.close(best, cost, float(fresh[DOF]), self._memories.noise_var)
            self._settling = float(self._parts.run_length.settling_samples)
        return changed, changed >= CHANGED

    def _begin_anew(self, sums: Array, since_us: int) -> None:
        held = self._held
        if held is not None and held.identifiable.both:
            self._learn(held.theta)
        noise = Noise(self._memories.noise_var, min(self._memories.dof, NOISE_KEPT))
        self._memories.prior = Prior(self._parts.prior, self._learned)
        self._memories.restart(sums, noise)
        self._axles.fade(0.0, share=0.1)
        self._since_us = since_us

    def _settle(self, fresh: Array, first_us: int) -> bool:
        """Samples after a change tell still better when it was: whether it is another moment."""
        self._contenders.extend(fresh, first_us)
        self._settling -= float(fresh[DOF])
        best = int(np.argmax(self._contenders.log_factors(self._memories.noise_var)))
        moved = self._contenders.since_us[best] != self._since_us
        if moved:
            self._memories.restart(self._contenders.sums[best], self._memories.noise)
            self._since_us = self._contenders.since_us[best]
        if self._settling <= 0.0:
            self._contenders.clear()
        return moved

    def _learn(self, theta: tuple[float, float, float]) -> None:
        """Remember a surface; one that is known already is brought up to date."""
        spread = np.array(self._parts.prior.narrow_std)
        phi = shape_coordinates(np.array([*self._learned, theta]))
        away = np.abs(phi[:-1] - phi[-1]) / spread
        kept = [old for old, row in zip(self._learned, away, strict=True) if row.max() > 1.0]
        self._learned = [*kept, theta][max(len(kept) + 1 - self._parts.prior.learned, 0) :]

    # -------------------------------------------------------------------------- the estimate

    def _estimate(self, changed: float) -> Estimate:
        """Of all memories, and of a change that is possible but not believed yet."""
        parts = self._memories.leading(MIXED_FROM)
        if MIXED_FROM < changed < CHANGED:
            parts = [(curves, (1.0 - changed) * weights) for curves, weights in parts]
            parts.append(self._possible(changed))
        curves, weights = parts[0] if len(parts) == 1 else _joined(parts)
        shares = _shares_below(curves, weights)
        mu_max, lambda_m, theta = self._middle(curves, shares)
        mu_lag, lambda_lag = self._memories.lag()
        load_std = mu_max * sqrt(self._load_var)
        further = hypot(load_std, mu_lag)
        mu_std = hypot(_std(curves.mu_max, weights), mu_lag)
        lambda_std = hypot(_std(curves.lambda_m, weights), lambda_lag)
        away = curves.theta - weights @ curves.theta
        covariance = (away * weights[:, None]).T @ away
        known = Identifiable(mu_max=False, lambda_m=False)
        if effective(weights) < FEWEST_CURVES:
            covariance, mu_std, lambda_std = np.diag([inf] * 3), inf, inf
            further = lambda_lag = inf
        else:
            falls = float(weights @ curves.theta[:, 2]) > FALL_SEEN * sqrt(covariance[2, 2])
            known = self._identifiable(mu_std / mu_max, lambda_m, lambda_std, falls=falls)
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
            identifiable=known,
            surface_since_us=self._since_us,
            change_probability=changed,
            per_axle=self._axles.of(mu_max, lambda_m, self._sign, self._memories.noise_var),
            mu_max_interval=_interval(curves.mu_max[curves.order[0]], shares[0], further),
            lambda_m_interval=_interval(curves.lambda_m[curves.order[1]], shares[1], lambda_lag),
        )

    def _middle(self, curves: Curves, shares: Array) -> tuple[float, float, Theta]:
        """μ_max, λ_m and (c1, c2, c3) of the curve of which height, place and shape are medians.

        Posteriors of a peak that is barely reached are skewed: their means lie too far out.
        """
        mu, slip, s = (
            float(np.interp(0.5, share, values[order]))
            for values, order, share in zip(curves.peaks, curves.order, shares, strict=True)
        )
        c1, c2 = mu / (1.0 - exp(-s) * (1.0 + s)), s / slip
        theta = (c1, c2, c1 * c2 * exp(-s))
        end = self._parts.identifiability.slip_max
        return (mu, slip, theta) if slip <= end else (float(adhesion(end, *theta)), end, theta)

    def _possible(self, changed: float) -> tuple[Curves, Array]:
        """Curves of the likeliest contender, weighted by the probability of a change."""
        factors = self._contenders.log_factors(self._memories.noise_var, self._memories.dof)
        sums = self._contenders.sums[int(np.argmax(factors))]
        noise = Noise(self._memories.noise_var, min(self._memories.dof, NOISE_KEPT))
        slip_max, size = self._parts.identifiability.slip_max, self._parts.tracker.curves
        curves = draw(sums, noise, self._memories.prior, slip_max, size)
        costs, dof = curves.costs(sums), float(sums[DOF])
        weights = normalised(log_weights(curves.log_base, costs, dof, noise))
        return curves, changed * weights

    def _identifiable(
        self, mu_max_std: float, lambda_m: float, lambda_m_std: float, *, falls: bool
    ) -> Identifiable:
        """Whether the data, not the prior, tell the peak: it was reached, and seen to bend down.

        Args:
            mu_max_std: relative.
            lambda_m: λ_m.
            lambda_m_std: of it.
            falls: whether the fall beyond the peak was seen.

        """
        settings = self._parts.identifiability
        if self._memories.dof < settings.samples:
            return Identifiable(mu_max=False, lambda_m=False)
        reached = _reach(self._memories.histogram, settings.reach, settings.slip_max)
        farthest = lambda_m + 2.0 * lambda_m_std
        told = falls and lambda_m_std <= settings.lambda_m_std * lambda_m
        return Identifiable(
            mu_max=mu_max_std <= settings.mu_max_std
            and reached >= settings.mu_max_reach * farthest,
            lambda_m=told and reached >= farthest,
        )


def _joined(parts: list[tuple[Curves, Array]]) -> tuple[Curves, Array]:
    """Curves of several distributions, with their weights made one."""
    weights = np.concatenate([weights for _, weights in parts])
    return joined([curves for curves, _ in parts]), weights / weights.sum()


def _shares_below(curves: Curves, weights: Array) -> Array:
    """Share of the weight below each curve in their three orders, shape (3, n)."""
    in_order = weights[curves.order]
    return np.asarray(in_order.cumsum(axis=1) - 0.5 * in_order)


def _std(values: Array, weights: Array) -> float:
    away = values - weights @ values
    return sqrt(float(weights @ (away * away)))


def _interval(in_order: Array, share_below: Array, further_std: float) -> tuple[float, float]:
    """Between the 5 and the 95 % quantile, widened by an independent error."""
    low, middle, high = np.interp(SHARES, share_below, in_order)
    more = 1.645 * further_std
    return float(middle - hypot(middle - low, more)), float(middle + hypot(high - middle, more))


def _reach(histogram: Array, share: float, slip_max: float) -> float:
    """Slip that a share of the samples exceeded, by the lower edge of its bin."""
    beyond = np.cumsum(histogram[::-1])[::-1]
    held = np.flatnonzero((beyond > 0.0) & (beyond >= share * beyond[0]))
    return float(held[-1]) * slip_max / BINS if len(held) else 0.0
