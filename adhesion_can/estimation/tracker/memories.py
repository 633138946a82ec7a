"""Posterior of the current surface with exponential forgetting at several rates.

On a constant surface every sample is worth keeping; on one that dries old samples mislead. So the
sums are kept with several rates of forgetting. Each of these fading memories has a probability from
its predictive density, with slow switching between them (dynamic model averaging; Raftery, Kárný
and Ettler, Technometrics 52, 2010).
"""

from dataclasses import dataclass
from math import exp, expm1, log
from typing import Self

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.layout import (
    CORRECTED,
    COUNT,
    DOF,
    HISTOGRAM,
    LENGTH,
    NODES,
    D,
    E,
    Z,
)
from adhesion_can.estimation.tracker.order_of_sums import sum_in_lanes
from adhesion_can.estimation.tracker.posterior import (
    Curves,
    NoisePrior,
    draw,
)
from adhesion_can.estimation.tracker.prior import Prior
from adhesion_can.estimation.tracker.settings import MemorySettings
from adhesion_can.values import Stateful, Value

LEAST_DENSITY = exp(-3.0)
"""Least factor on a memory's probability by one update, so that no single one decides."""
LEAST_EFFECTIVE, LEAST_EFFECTIVE_OTHERS = 1 / 5, 1 / 20
"""Least effective share of the curves of the most probable memory, and of the others."""
NO_LAG_PROBABILITY = 0.9
"""Probability of the longest memory from which on no lag is assumed."""
LAG_SIGNIFICANCE = 2.0
"""Distance of a shorter memory, in its standard deviations, from which it is significant."""
LEAST_NEW_SHARE = 0.03
"""Least share of samples that are new since the last draw, for another draw."""
LEAST_KEPT_SHARE = 0.7
"""Share of the samples at the last draw below which the curves are drawn again, wider."""


@dataclass(frozen=True, slots=True)
class _AllCurves(Value):
    """Curves of all memories side by side, so that all of them are one operation.

    A value, since it is large and seldom another one: copies of the memories share it.

    Attributes:
        at_x: `Curves.at_x` with a column a curve, shape (NODES, memories * size).
        factors: `Curves.factors`, shape (5, memories * size).
        log_base: `Curves.log_base`, shape (memories, size).

    """

    at_x: Array
    factors: Array
    log_base: Array

    @classmethod
    def empty(cls, memories: int, size: int) -> Self:
        """Room for the curves of all memories, not filled."""
        columns = memories * size
        return cls(np.empty((NODES, columns)), np.empty((5, columns)), np.empty((memories, size)))

    def with_memory(self, i: int, curves: Curves) -> Self:
        """The same with other curves in the i-th memory."""
        twin = type(self)(self.at_x.copy(), self.factors.copy(), self.log_base.copy())
        size = self.log_base.shape[1]
        columns = slice(i * size, (i + 1) * size)
        twin.at_x[:, columns], twin.factors[:, columns] = curves.at_x.T, curves.factors
        twin.log_base[i] = curves.log_base
        return twin


class FadingMemories(Stateful):
    """Posteriors of the current surface, one for each rate of forgetting.

    Args:
        settings: Time constants and probabilities of the memories.
        prior: Prior of a new surface.
        noise: Prior of the adhesion noise.
        slip_max: Largest slip ratio of the model.
        size: Number of curves of each memory.

    """

    def __init__(
        self, settings: MemorySettings, prior: Prior, noise: NoisePrior, slip_max: float, size: int
    ) -> None:
        self.prior = prior
        self.noise = noise
        self.noise_var = noise.var
        self._settings, self._slip_max, self._size = settings, slip_max, size
        count = len(settings.times_s)
        self._rates = 1.0 / np.array(settings.times_s)
        drift = settings.drift if count > 1 else 0.0
        # Numbers: for a handful of memories faster than arrays of them.
        self._shares = [1.0 - drift] + [drift / max(count - 1, 1)] * (count - 1)
        self._probability = self._shares
        # One row per memory, so that all of them are one operation.
        self._sums: Array = np.zeros((count, LENGTH))
        self._curves: list[Curves] = []
        self._all = _AllCurves.empty(count, size)
        self._costs: Array = np.empty((count, size))
        self._weights: Array = np.empty((count, size))
        self._drawn_dof = [0.0] * count
        self._new_dof = [0.0] * count
        self._leader = 0
        self._faded_s, self._kept = 0.0, np.ones((count, 1))

    @property
    def dof(self) -> float:
        """Degrees of freedom in the most probable memory."""
        return float(self._sums[self._leader, DOF])

    @property
    def count(self) -> float:
        """Number of samples in the most probable memory."""
        return float(self._sums[self._leader, COUNT])

    @property
    def histogram(self) -> Array:
        """Histogram of the slips in the most probable memory, shape (BINS,)."""
        return self._sums[self._leader, HISTOGRAM]

    def restart(self, sums: Array, noise: NoisePrior) -> None:
        """Restart all memories from the sums of another segment, shape (LENGTH,)."""
        self.noise = noise
        self._sums[:] = sums
        curves = draw(sums, noise, self.prior, self._slip_max, self._size)
        self._curves = [curves] * len(self._sums)
        for i in range(len(self._sums)):
            self._adopt(i, curves)
        self._probability = self._shares
        self._weigh()

    def fade(self, seconds: float) -> None:
        """Forget exponentially over a time; probabilities return towards their prior."""
        if seconds <= 0.0:
            return
        if seconds != self._faded_s:
            # Mostly the same time, that from one due time to the next.
            self._faded_s, self._kept = seconds, np.exp(-seconds * self._rates)[:, None]
        self._sums *= self._kept
        self._costs *= self._kept
        back = -expm1(-seconds * self._settings.drift / self._settings.switch_s)
        pairs = zip(self._probability, self._shares, strict=True)
        self._probability = [(1.0 - back) * now + back * share for now, share in pairs]

    def predict(self, added: Array) -> tuple[Array, Array]:
        """Sums of squares of new samples with the current curves, and their predictive density.

        The probabilities of the memories are updated by that of the sums with corrected scores.

        Args:
            added: Sums of the samples, both kinds, shape (2, LENGTH).

        Returns:
            J of each curve of each memory with corrected scores, shape (memories, size), and −2σ²
            times the logarithm of the predictive density of all of them, up to a constant, for both
            kinds of sums, shape (2,).

        """
        factors = self._all.factors
        at_curves = added[:, : 3 * NODES].reshape(-1, NODES) @ self._all.at_x
        terms = at_curves.reshape(len(added), 3, -1)
        terms *= factors[:3]
        further = added[:, D, None] * factors[3] + added[:, E, None] * factors[4]
        further += added[:, Z, None]
        costs = (terms.sum(axis=1) + further).reshape(-1, *self._costs.shape)
        least = costs.min(axis=2)
        scale = -0.5 / self.noise_var
        relative = costs - least[..., None]
        relative *= scale
        np.exp(relative, out=relative)
        relative *= self._weights
        inside = relative.sum(axis=2)
        log_density = scale * least + np.log(np.maximum(inside, 1e-300))
        cost = np.empty(len(added))
        likely: list[float] = []
        for kind, logs in enumerate(log_density.tolist()):
            best = max(logs)
            density = [exp(log_value - best) for log_value in logs]
            mean = sum([d * p for d, p in zip(density, self._probability, strict=True)])
            cost[kind] = (best + log(mean)) / scale
            if kind == CORRECTED:
                likely = [max(d, LEAST_DENSITY) for d in density]
        weighted = [p * factor for p, factor in zip(self._probability, likely, strict=True)]
        total = sum(weighted)
        self._probability = [weight / total for weight in weighted]
        return costs[CORRECTED], cost

    def add(self, added: Array, costs: Array) -> None:
        """Add samples by their sums and by their costs from `predict`."""
        self._sums += added
        self._costs += costs
        dof = added.item(DOF)
        self._new_dof = [new + dof for new in self._new_dof]

    def refresh(self) -> None:
        """Weight the curves by the sums, and draw new ones where too few carry the weight."""
        effective = self._weigh()
        leader, size = self._leader, self._size
        poor = []
        for i, dof in enumerate(self._sums[:, DOF].tolist()):
            least = size * (LEAST_EFFECTIVE if i == leader else LEAST_EFFECTIVE_OTHERS)
            # Where no draw is better (as with one slip only), a new one waits for new samples.
            is_poor = effective[i] < least and self._new_dof[i] > LEAST_NEW_SHARE * dof
            if is_poor or dof < LEAST_KEPT_SHARE * self._drawn_dof[i]:
                poor.append(i)
        for i in poor:
            self._draw(i)
        if poor:
            self._weigh()

    def leading(self, least: float) -> list[tuple[Curves, Array]]:
        """Curves and weights of the memories with at least a probability; weights sum to 1."""
        probability = self._probability
        least = min(least, max(probability))
        chosen = [(i, share) for i, share in enumerate(probability) if share >= least]
        if len(chosen) == 1:
            ((i, _),) = chosen
            return [(self._curves[i], self._weights[i])]
        total = sum(share for _, share in chosen)
        return [(self._curves[i], share / total * self._weights[i]) for i, share in chosen]

    def lag(self) -> tuple[float, float]:
        """Possible lag in (μ_max, λ_m): distance of the most probable memory from the next.

        0 where the shorter memory's own uncertainty explains the distance, and for the shortest.
        """
        i, shorter = self._leader, self._leader + 1
        if shorter == len(self._curves) or (i == 0 and self._probability[0] > NO_LAG_PROBABILITY):
            return 0.0, 0.0
        lags = []
        for name in ("mu_max", "lambda_m"):
            long, short = (getattr(self._curves[k], name) for k in (i, shorter))
            middle = self._weights[shorter] @ short
            std = np.sqrt(self._weights[shorter] @ (short - middle) ** 2)
            distance = abs(float(middle - self._weights[i] @ long))
            lags.append(distance if distance > LAG_SIGNIFICANCE * std else 0.0)
        return lags[0], lags[1]

    def _draw(self, i: int) -> None:
        self._adopt(i, draw(self._sums[i], self.noise, self.prior, self._slip_max, self._size))

    def _adopt(self, i: int, curves: Curves) -> None:
        self._curves[i], self._all = curves, self._all.with_memory(i, curves)
        self._costs[i] = curves.costs(self._sums[i])
        self._drawn_dof[i], self._new_dof[i] = self._sums.item(i, DOF), 0.0

    def _weigh(self) -> list[float]:
        """Weight the curves by the sums; effective number of curves of each memory."""
        probability = self._probability
        self._leader = leader = probability.index(max(probability))
        noise = self.noise
        costs, dof = np.maximum(self._costs, 0.0), self._sums[:, DOF]
        logs = np.log(costs + noise.freedom * noise.var)
        logs *= (0.5 * (noise.freedom + dof))[:, None]
        # Not in place: who asked for the weights may still have them.
        weights = self._all.log_base - logs
        weights -= weights.max(axis=1, keepdims=True)
        np.exp(weights, out=weights)
        weights /= sum_in_lanes(weights)[:, None]
        self._weights = weights
        products = np.concatenate([weights * weights, (weights[leader] * costs[leader])[None]])
        *squares, cost = sum_in_lanes(products).tolist()
        self.noise_var = noise.posterior_var(cost, dof.item(leader))
        return [1.0 / square for square in squares]
