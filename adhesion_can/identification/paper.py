"""The paper's block estimator as a service needs it: with standard errors, and with doubt.

The search is the paper's (`evolution`). What stands here around it is what a controller must know
and the paper does not say: whether a block can tell the peak at all, and what to believe when it
cannot. A block that cannot does not replace an estimate that could, as long as it does not
contradict it; a block that contradicts it means that the rail has changed.
"""

from collections import deque
from dataclasses import dataclass, replace
from math import hypot

import numpy as np

from adhesion_can.identification.evolution import EvolutionSettings, first_theta, search
from adhesion_can.identification.likelihood import innovation, standard_errors
from adhesion_can.identification.samples import common_load_std
from adhesion_can.physics.burckhardt import Array, peak
from adhesion_can.physics.data import Estimate, Identifiable, Samples


@dataclass(frozen=True, slots=True)
class IdentifiabilitySettings:
    """When a set of samples can tell the peak.

    Attributes:
        mu_max_std: largest standard deviation of μ_max, as a share of it.
        lambda_m_std: largest standard deviation of λ_m, as a share of it.
        reach: share of the samples that must lie beyond λ̂_m for λ_m to be identifiable: the
            curve is believed where it was seen to bend down, not where its formula says so.
        mu_max_reach: slip, as a share of λ̂_m, that as many samples must exceed for μ_max.
        slip_max: samples of larger |λ| are outside the model and are left out.

    """

    mu_max_std: float = 0.03
    lambda_m_std: float = 0.3
    reach: float = 0.03
    mu_max_reach: float = 0.7
    slip_max: float = 0.5


@dataclass(frozen=True, slots=True)
class ChangeSettings:
    """When a block contradicts the estimate.

    Attributes:
        ratio: root mean square of the innovation over that of the block's own fit.
        floor: the same, never declared below this absolute size of adhesion.

    """

    ratio: float = 1.6
    floor: float = 0.006


def assess(
    theta: Array, cost: float, samples: Samples, settings: IdentifiabilitySettings
) -> Estimate:
    """Estimate with standard errors from θ̂ and the samples that it was fitted to.

    Args:
        theta: (c1, c2, c3).
        cost: J(θ̂), eq. 13.
        samples: that it was fitted to, at least one.
        settings: see there.

    """
    h, _ = samples.folded()
    noise = float(np.sqrt(max(cost, 0.0) / max(len(h) - 3, 1)))
    errors = standard_errors(theta, h, noise, settings.slip_max)
    c1, c2, c3 = map(float, theta)
    top = peak(c1, c2, c3, settings.slip_max)
    mu_max, lambda_m = float(top.mu_max), float(top.lambda_m)
    mu_std = hypot(errors.mu_max, mu_max * common_load_std(samples.load, samples.load_std))
    reached = float(np.quantile(h, 1.0 - settings.reach))
    return Estimate(
        c1=c1,
        c2=c2,
        c3=c3,
        covariance=errors.covariance,
        mu_max=mu_max,
        mu_max_std=mu_std,
        lambda_m=lambda_m,
        lambda_m_std=errors.lambda_m,
        noise_std=noise,
        samples=len(h),
        identifiable=Identifiable(
            mu_max=errors.mu_max <= settings.mu_max_std * mu_max
            and reached >= settings.mu_max_reach * lambda_m,
            lambda_m=errors.lambda_m <= settings.lambda_m_std * lambda_m and reached >= lambda_m,
        ),
        surface_since_us=int(samples.t_us[0]),
    )


class PaperEstimator:
    """Block processing by the modified differential evolution, as a service's estimator.

    Args:
        settings: of the search.
        identifiability: see there.
        change: see there.

    """

    def __init__(
        self,
        settings: EvolutionSettings | None = None,
        identifiability: IdentifiabilitySettings | None = None,
        change: ChangeSettings | None = None,
    ) -> None:
        self._settings = settings or EvolutionSettings()
        self._identifiability = identifiability or IdentifiabilitySettings()
        self._change = change or ChangeSettings()
        self._rng = np.random.default_rng(self._settings.seed)
        self._theta = first_theta(self._settings, self._rng)
        self._waiting: deque[Samples] = deque()
        self._held: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """See `Estimator.update`; the estimate moves once per block of samples."""
        del now_us  # a block is a number of samples, not a time
        usable = np.isfinite(samples.slip) & np.isfinite(samples.adhesion)
        usable &= np.abs(samples.slip) <= self._identifiability.slip_max
        self._waiting.append(samples.select(usable))
        while (block := self._take_block()) is not None:
            self._held = self._identify(block)
        return self._held

    def _take_block(self) -> Samples | None:
        size = self._settings.block
        if sum(map(len, self._waiting)) < size:
            return None
        joined = Samples.concatenate(list(self._waiting))
        self._waiting.clear()
        self._waiting.append(joined.select(slice(size, None)))
        return joined.select(slice(size))

    def _identify(self, block: Samples) -> Estimate:
        h, z = block.folded()
        found = search(h, z, self._theta, self._settings, self._rng)
        fresh = assess(found.theta, found.cost, block, self._identifiability)
        held = self._held
        if held is None or self._contradicts(held, fresh, h, z):
            self._theta = found.theta
            return replace(fresh, change_probability=float(held is not None))
        if fresh.identifiable.both or not held.identifiable.both:
            self._theta = found.theta
            return replace(fresh, surface_since_us=held.surface_since_us)
        return replace(held, change_probability=0.0)

    def _contradicts(self, held: Estimate, fresh: Estimate, h: Array, z: Array) -> bool:
        """Whether the block's innovation is more than its own noise explains."""
        rms = float(np.sqrt(np.mean(innovation(held.theta, h, z) ** 2)))
        return rms > max(self._change.ratio * fresh.noise_std, self._change.floor)
