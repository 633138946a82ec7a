"""Any estimator, made to follow the base curve of an extended model and to say the whole of it."""

from collections import Counter
from dataclasses import replace
from math import hypot

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.extended.correction import contact_of, corrected, without_effects
from adhesion_can.estimation.extended.current_curve import Held, Latest, Peaks, Present, peaks_of
from adhesion_can.estimation.extended.model import ExtendedModel, Matrix
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.physics.effects import LagStates
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import Samples

__all__ = ["ExtendedEstimator", "ExtendedModel", "Matrix", "corrected"]

UPDATES = 10
"""Updates with samples between two looks at how the peak moves with the effects' parameters."""
STEP = 0.1
"""Of a parameter for that, in its standard deviations."""


class ExtendedEstimator:
    """An estimator that sees points of the base curve and says the curve that holds now.

    That is factor · curve(slip') with the speed, loads, covariates and states of the latest
    samples: its peak, and for (c1, c2, c3) the Burckhardt curve that has this peak and the base
    curve's shape. What is a matter of time alone (slow drift, a spline over time) counts as 1: the
    estimator follows such changes itself.

    The doubt about the effects' parameters adds to that of the peak as far as the present condition
    differs from those in which the base curve was seen: in the same condition a wrong factor takes
    away from the base curve what it adds to the peak.

    Args:
        inner: a fresh estimator, of the base curve.
        model: see there.
        axles: of the vehicle, for places in reverse.
        settings: when the peak counts as identifiable, and the range of slip.

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
        self._directions = [_root(model.covariance_of(active)) for active in self._actives]
        self._axles = axles
        self._memory = Latest()
        self._origin_us: int | None = None
        self._present: Present | None = None
        self._doubt = _Doubt()
        self._of: Estimate | None = None
        self._held: Estimate | None = None
        self.left_out: Counter[str] = Counter()
        """Samples that the model could not be applied to, by reason."""

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """See `Estimator.update`."""
        taken = self._take(samples) if len(samples) else samples
        base = self._inner.update(taken, now_us)
        if base is None or self._present is None:
            return None
        if base is not self._of or len(taken):
            self._of, self._held = base, self._whole(base, self._present, len(taken))
        return self._held

    def _take(self, samples: Samples) -> Samples:
        if self._origin_us is None:
            self._origin_us = int(samples.t_us[0])
        origin, axles = self._origin_us, self._axles
        result = without_effects(samples, self._actives, origin, axles, self._memory)
        self.left_out += result.left_out
        if len(result.samples):
            seen = samples if result.kept.all() else samples.select(result.kept)
            self._present = Present.after(contact_of(seen, origin, axles), self._present)
        return result.samples

    def _whole(self, base: Estimate, present: Present, fresh: int) -> Estimate:
        """The estimate that holds in the present condition."""
        held, slip_max = Held(self._memory.states), self._settings.slip_max
        peaks = peaks_of(base, self._actives, present, held, slip_max)
        if self._doubt.is_due(fresh):
            slopes = self._slopes(base, present, held, peaks)
            self._doubt.look(slopes, base.samples)
        mu_doubt, lambda_doubt = self._doubt.stds
        return scaled(base, peaks, mu_doubt, lambda_doubt, self._settings)

    def _slopes(self, base: Estimate, present: Present, held: LagStates, at: Peaks) -> Array:
        """Changes of (ln μ_max, ln λ_m) with each direction of doubt, a std long; shape (k, 2)."""
        rows = []
        for place, directions in enumerate(self._directions):
            for direction in directions:
                active, actives = self._actives[place], list(self._actives)
                moved = np.array(active.values) + STEP * direction
                actives[place] = replace(active, values=tuple(moved.tolist()))
                to = peaks_of(base, actives, present, held, self._settings.slip_max)
                rows.append((to.mu_max / at.mu_max - 1.0, to.lambda_m / at.lambda_m - 1.0))
        return np.array(rows).reshape(-1, 2) / STEP


def _root(covariance: Array) -> Array:
    """Independent directions of a covariance (k, k), each a standard deviation long, (m, k)."""
    std = np.sqrt(covariance.diagonal())
    scale = np.where(std > 0.0, std, 1.0)
    # Of the correlations: parameters differ by many powers of ten.
    variances, directions = np.linalg.eigh(covariance / scale / scale[:, None])
    good = variances > 1e-9
    return np.asarray((directions * np.sqrt(np.maximum(variances, 0.0)) * scale[:, None]).T[good])


class _Doubt:
    """What the doubt about the effects adds to that of the peak."""

    def __init__(self) -> None:
        self._updates = 0
        self._samples = 0
        self._behind: Array | None = None
        self.stds = (0.0, 0.0)
        """Relative standard deviations of μ_max and λ_m."""

    def is_due(self, fresh: int) -> bool:
        """Whether to look again, after an update with so many samples."""
        self._samples += fresh
        self._updates -= fresh > 0
        return self._updates < 0

    def look(self, slopes: Array, behind: int) -> None:
        """Take slopes in the present condition; the estimate rests on so many samples."""
        share = min(1.0, self._samples / max(behind, 1))
        mean = slopes if self._behind is None else self._behind
        self._behind = mean + share * (slopes - mean)
        away = slopes - self._behind
        mu_max, lambda_m = np.sqrt((away * away).sum(axis=0)).tolist()
        self.stds = (mu_max, lambda_m)
        self._updates, self._samples = UPDATES, 0


def scaled(
    base: Estimate,
    peaks: Peaks,
    mu_doubt: float,
    lambda_doubt: float,
    settings: IdentifiabilitySettings,
) -> Estimate:
    """Estimate of the base curve, stretched to other peaks.

    Args:
        base: of the base curve.
        peaks: see there.
        mu_doubt: relative standard deviation that comes on top of μ_max's.
        lambda_doubt: likewise of λ_m's.
        settings: when the peak counts as identifiable.

    """
    high = peaks.mu_max / base.mu_max if base.mu_max > 0.0 else 1.0
    wide = peaks.lambda_m / base.lambda_m if base.lambda_m > 0.0 else 1.0
    mu_max, lambda_m = base.mu_max * high, base.lambda_m * wide
    stretch = np.array([high, 1.0 / wide, high / wide])
    mu_std, lambda_std = mu_doubt * mu_max, lambda_doubt * lambda_m
    pooled = (peaks.mu_max, peaks.lambda_m)
    per_axle = {
        axle: (own[0] * to[0] / base.mu_max, own[1] * to[1] / base.lambda_m)
        for axle, own in base.per_axle.items()
        if base.mu_max > 0.0 and base.lambda_m > 0.0
        for to in (peaks.axles.get(axle, pooled),)
    }
    return replace(
        base,
        c1=base.c1 * high,
        c2=base.c2 / wide,
        c3=base.c3 * high / wide,
        covariance=base.covariance * np.outer(stretch, stretch),
        mu_max=mu_max,
        mu_max_std=hypot(base.mu_max_std * high, mu_std),
        lambda_m=lambda_m,
        lambda_m_std=hypot(base.lambda_m_std * wide, lambda_std),
        noise_std=base.noise_std,
        identifiable=Identifiable(
            mu_max=base.identifiable.mu_max and mu_doubt <= settings.mu_max_std,
            lambda_m=base.identifiable.lambda_m and lambda_doubt <= settings.lambda_m_std,
        ),
        per_axle=per_axle,
        mu_max_interval=_stretched(base.mu_max_interval, base.mu_max, high, mu_std),
        lambda_m_interval=_stretched(base.lambda_m_interval, base.lambda_m, wide, lambda_std),
    )


def _stretched(
    interval: tuple[float, float], middle: float, by: float, further_std: float
) -> tuple[float, float]:
    """A 90 % interval stretched about 0 and widened by an independent error."""
    more = 1.645 * further_std
    low, high = by * (middle - interval[0]), by * (interval[1] - middle)
    if not more:
        return by * interval[0], by * interval[1]
    return by * middle - hypot(low, more), by * middle + hypot(high, more)
