"""The paper's block estimator with standard errors, identifiability, and change detection.

The search is the paper's (`differential_evolution`). Additions are needed by a controller and left
open: whether the peak is identifiable from a block, and which estimate to use when it is not. A
block without identifiable peak does not replace an estimate with one while the two agree.

In the paper a block never spans a change of the surface. Here a change is detected from the
innovations of the latest samples, and the block starts again where it happened. From half of that
block on the new surface is estimated where its height is identifiable, or where little of the block
is missing; until then the old values are still given, as not identifiable and with infinite
standard deviations.
"""

from collections import deque
from dataclasses import replace
from math import hypot, inf

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.forgetting import UNKNOWN, select_usable
from adhesion_can.estimation.baselines.settings import ChangeSettings, EvolutionSettings
from adhesion_can.estimation.differential_evolution import (
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
"""Largest number of searches of one block."""
FIRST_SHARE, WHOLE_SHARE = 0.5, 0.9
"""Shares of the first block on a new surface from which that surface is estimated: where the part
shows its height, and in any case. A block that starts a few samples behind the change would else be
full a whole block later, while the old surface's values are given."""
SETTLED = 1e-3
"""Relative decrease of J below which a repeated search counts as converged."""


class PaperEstimator:
    """Block processing by the modified differential evolution, as a service's estimator.

    Args:
        settings: Settings of the search.
        identifiability: Limits from which the peak counts as identifiable, and range of slip.
        change: Settings of the change detection.

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
        self._current: Estimate | None = None
        self._current_std = inf
        self._changing = False
        self._next_look = inf  # samples that wait

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it; a new estimate once per block."""
        del now_us  # a block is a number of samples, not a time
        usable = select_usable(samples, self._identifiability.slip_max)
        if len(usable):
            self._waiting.append(usable)
            declared = self._look_for_change()
            while (block := self._next_block()) is not None:
                self._current = self._identify(block)
            self._look_at_first_part()
            if declared and not self._changing and self._current is not None:
                # The block of the new surface was full at once: the change is still to be reported.
                self._current = replace(self._current, change_probability=1.0)
        return self._current

    def _look_at_first_part(self) -> None:
        """Estimate a new surface from a part of its first block, where that shows its height."""
        count = sum(map(len, self._waiting))
        if not self._changing or count < self._next_look:
            return
        part = Samples.concatenate(list(self._waiting))
        h, z = part.folded()
        result = search(h, z, self._theta, self._settings, self._rng)
        result = self._search_until_converged(result, h, z)
        fresh = assess(result.theta, result.cost, part, self._identifiability)
        self._next_look = count + FIRST_SHARE * (self._settings.block - count)
        whole = count >= WHOLE_SHARE * self._settings.block
        if whole:
            self._waiting.clear()  # it counts as the block, and the next one begins behind it
        if (whole or fresh.identifiable.mu_max) and self._current is not None:
            self._theta, self._current_std = result.theta, fresh.mu_max_std
            since, self._changing = self._current.surface_since_us, False
            self._current = replace(fresh, surface_since_us=since, change_probability=0.0)

    def _next_block(self) -> Samples | None:
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
        """Whether the latest samples contradict the estimate; the block starts at the change."""
        current, change = self._current, self._change
        if (
            current is None
            or not current.identifiable.both
            or sum(map(len, self._waiting)) < change.window
        ):
            return False
        waiting = Samples.concatenate(list(self._waiting))
        scaled = self._scaled_innovation(current, waiting)
        squares = scaled**2
        latest = slice(-change.window, None)
        if np.mean(squares[latest]) <= change.ratio**2:
            return False
        if not _is_structured(np.abs(waiting.slip[latest]), scaled[latest], change.structure):
            return False
        # The change is where the cumulative sum of the excess squares begins to rise
        # (CUSUM; Page, Biometrika 41, 1954).
        excess = np.concatenate([[0.0], np.cumsum(squares - change.ratio**2)])
        cut = min(int(np.argmin(excess)), len(waiting) - 1)
        self._wait_with(waiting.select(slice(cut, None)))
        self._changing = True
        self._next_look = FIRST_SHARE * self._settings.block
        self._current = replace(
            current,
            covariance=UNKNOWN,
            mu_max_std=inf,
            lambda_m_std=inf,
            identifiable=Identifiable(mu_max=False, lambda_m=False),
            surface_since_us=int(waiting.t_us[cut]),
            change_probability=1.0,
        )
        return True

    def _scaled_innovation(self, current: Estimate, samples: Samples) -> Array:
        """Innovations over their standard deviations by noise in adhesion and in slip."""
        h, z = samples.folded()
        slope = adhesion_slope(h, *current.theta)
        explained = (
            max(current.noise_std, self._change.floor) ** 2 + slope**2 * samples.slip_total_var
        )
        return np.asarray(innovation(current.theta, h, z) / np.sqrt(explained))

    def _search_until_converged(self, result: Search, h: Array, z: Array) -> Search:
        """Result of a search from a distant start, repeated until it has converged.

        Within its iteration limit a search may stop short of the optimum, where standard errors
        from the curvature are wrong.
        """
        for _ in range(MOST_SEARCHES - 1):
            again = search(h, z, result.theta, self._settings, self._rng)
            settled = again.cost > (1.0 - SETTLED) * result.cost
            result = again
            if settled:
                break
        return result

    def _identify(self, block: Samples) -> Estimate:
        h, z = block.folded()
        result = search(h, z, self._theta, self._settings, self._rng)
        if self._current is None or self._changing:
            result = self._search_until_converged(result, h, z)
        fresh = assess(result.theta, result.cost, block, self._identifiability)
        current, self._changing = self._current, False
        if current is None or fresh.identifiable.both or not current.identifiable.both:
            self._theta, self._current_std = result.theta, fresh.mu_max_std
            since = fresh.surface_since_us if current is None else current.surface_since_us
            return replace(fresh, surface_since_us=since)
        # The old estimate stays; the mean distance of the block from it adds to its uncertainty.
        distance = float(np.mean(innovation(current.theta, h, z)))
        return replace(current, mu_max_std=hypot(self._current_std, distance))


def _is_structured(slip: Array, scaled: Array, threshold: float) -> bool:
    """Whether innovations differ from zero by groups of neighbouring slips, beyond their scatter.

    The mean square of four groups' means over the scatter within them (an F statistic): near 1 for
    noise of any size, near the number of samples of a group where the curve lies elsewhere. The
    common error of the vehicle speed lifts it to about the number of axles.
    """
    parts = np.array_split(scaled[np.argsort(slip, kind="stable")], 4)
    between = np.mean([len(part) * part.mean() ** 2 for part in parts])
    within = np.mean([part.var() for part in parts])
    return bool(between > threshold * max(within, 1e-12))
