"""The paper's block estimator as a service needs it: with standard errors, and with doubt.

The search is the paper's (`evolution`). What stands here around it is what a controller must know
and the paper does not say: whether a block can tell the peak at all, and what to believe when it
cannot. A block that cannot does not replace an estimate that could, as long as the two agree.

In the paper a block never spans a change of the rail. Here the innovation of the latest samples
tells the change, and the block begins anew where it happened; until that block is full the old
values are still given, with no claim left to them.
"""

from collections import deque
from dataclasses import dataclass, replace
from math import hypot, inf

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.differential_evolution import (
    EvolutionSettings,
    Search,
    first_theta,
    search,
)
from adhesion_can.estimation.identifiability import IdentifiabilitySettings, assess
from adhesion_can.estimation.likelihood import innovation
from adhesion_can.physics.burckhardt import adhesion_slope
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import Samples

MOST_SEARCHES = 6
SETTLED = 1e-3
"""A search has come to rest when the next one lowers J by less than this share."""


@dataclass(frozen=True, slots=True)
class ChangeSettings:
    """When the latest samples contradict the estimate.

    Attributes:
        window: latest samples that are looked at.
        ratio: root mean square of their innovation over what noise explains.
        floor: noise is taken as at least this much, in adhesion.
        structure: their means over neighbouring slips must exceed so many times what their own
            scatter explains: more noise alone is no other rail.

    """

    window: int = 120
    ratio: float = 2.0
    floor: float = 0.003
    structure: float = 25.0

    def __post_init__(self) -> None:
        if not (self.window >= 1 and self.ratio > 0 and self.floor > 0):
            raise ValueError("window, ratio and floor must be positive")


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
        self._held_std = inf
        self._changing = False

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """See `Estimator.update`; the estimate moves once per block of samples."""
        del now_us  # a block is a number of samples, not a time
        usable = np.isfinite(samples.slip) & np.isfinite(samples.adhesion)
        usable &= np.abs(samples.slip) <= self._identifiability.slip_max
        if usable.any():
            self._waiting.append(samples.select(usable))
            declared = self._look_for_change()
            while (block := self._take_block()) is not None:
                self._held = self._identify(block)
            if declared and not self._changing and self._held is not None:
                # The block of the new rail was full at once: the change is still to be told.
                self._held = replace(self._held, change_probability=1.0)
        return self._held

    def _take_block(self) -> Samples | None:
        size = self._settings.block
        if sum(map(len, self._waiting)) < size:
            return None
        joined = Samples.concatenate(list(self._waiting))
        self._wait_with(joined.select(slice(size, None)))
        return joined.select(slice(size))

    def _wait_with(self, samples: Samples) -> None:
        self._waiting.clear()
        if len(samples):
            self._waiting.append(samples)

    def _look_for_change(self) -> bool:
        """Whether the latest samples contradict the estimate; the block begins where they do."""
        held, change = self._held, self._change
        if (
            held is None
            or not held.identifiable.both
            or sum(map(len, self._waiting)) < change.window
        ):
            return False
        waiting = Samples.concatenate(list(self._waiting))
        scaled = self._scaled_innovation(held, waiting)
        squares = scaled**2
        latest = slice(-change.window, None)
        if np.mean(squares[latest]) <= change.ratio**2:
            return False
        if not _is_structured(np.abs(waiting.slip[latest]), scaled[latest], change.structure):
            return False
        # The change is where the sum of what noise does not explain begins to rise.
        excess = np.concatenate([[0.0], np.cumsum(squares - change.ratio**2)])
        cut = min(int(np.argmin(excess)), len(waiting) - 1)
        self._wait_with(waiting.select(slice(cut, None)))
        self._changing = True
        self._held = replace(
            held,
            covariance=np.diag([np.inf] * 3),
            mu_max_std=inf,
            lambda_m_std=inf,
            identifiable=Identifiable(mu_max=False, lambda_m=False),
            surface_since_us=int(waiting.t_us[cut]),
            change_probability=1.0,
        )
        return True

    def _scaled_innovation(self, held: Estimate, samples: Samples) -> Array:
        """Innovation over what noise explains of it: in adhesion, and in slip by the slope."""
        h, z = samples.folded()
        slope = adhesion_slope(h, *held.theta)
        explained = max(held.noise_std, self._change.floor) ** 2 + slope**2 * samples.slip_total_var
        return np.asarray(innovation(held.theta, h, z) / np.sqrt(explained))

    def _continued(self, found: Search, h: Array, z: Array) -> Search:
        """A search from far away, gone on with until it has come to rest.

        Within its iteration limit it may stop short of the optimum, and what the curvature there
        says of the standard errors is not true.
        """
        for _ in range(MOST_SEARCHES - 1):
            again = search(h, z, found.theta, self._settings, self._rng)
            settled = again.cost > (1.0 - SETTLED) * found.cost
            found = again
            if settled:
                break
        return found

    def _identify(self, block: Samples) -> Estimate:
        h, z = block.folded()
        found = search(h, z, self._theta, self._settings, self._rng)
        if self._held is None or self._changing:
            found = self._continued(found, h, z)
        fresh = assess(found.theta, found.cost, block, self._identifiability)
        held, self._changing = self._held, False
        if held is None or fresh.identifiable.both or not held.identifiable.both:
            self._theta, self._held_std = found.theta, fresh.mu_max_std
            since = fresh.surface_since_us if held is None else held.surface_since_us
            return replace(fresh, surface_since_us=since)
        # The old estimate stands; how far the block lies off it on the mean is doubt about it.
        off = float(np.mean(innovation(held.theta, h, z)))
        return replace(held, mu_max_std=hypot(self._held_std, off))


def _is_structured(slip: Array, scaled: Array, threshold: float, groups: int = 4) -> bool:
    """Whether innovations differ from zero by groups of neighbouring slips, beyond their scatter.

    The mean square of the groups' means over the scatter within them (an F statistic): near 1 for
    noise of any size, near the number of samples of a group where the curve lies elsewhere. The
    common error of the vehicle speed lifts it to about the number of axles.
    """
    parts = np.array_split(scaled[np.argsort(slip, kind="stable")], groups)
    between = np.mean([len(part) * part.mean() ** 2 for part in parts])
    within = np.mean([part.var() for part in parts])
    return bool(between > threshold * max(within, 1e-12))
