"""The present rail's posterior, with memories of several lengths.

On a rail that stays, every sample is worth keeping; on one that dries, the old ones mislead. So the
sums are kept with several rates of forgetting, and each memory is trusted by what it has predicted.
"""

from dataclasses import dataclass
from math import exp, expm1, log

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker import curve_sums as segments
from adhesion_can.estimation.tracker.curve_sums import COUNT, DOF, HISTOGRAM, LENGTH, NODES
from adhesion_can.estimation.tracker.posterior import Curves, Noise, draw, log_weights, normalised
from adhesion_can.estimation.tracker.prior import Prior

LEAST_DENSITY = exp(-3.0)
"""Least factor by which one update can change the trust: no single one decides."""
FEW, FEW_FOLLOWERS = 1 / 5, 1 / 20
"""Shares of the curves that must carry the weight: of the memory that leads, of the others."""
CERTAIN = 0.9
"""Trust of the longest memory with which nothing lags."""
SURELY = 2.0
"""Standard deviations of a shorter memory from which its distance is no chance."""
NEWS = 0.03
"""Share of the samples that must be new since the last draw for another one."""
LOST = 0.7
"""Share of the samples for which curves were drawn below which they no longer reach far enough."""


@dataclass(frozen=True, slots=True)
class MemorySettings:
    """How the present rail is remembered.

    Attributes:
        times_s: after which a sample's weight has faded to a third, longest first: the first is
            for a rail that stays, the others follow one that drifts.
        drift: probability that another memory than the first is the right one.
        switch_s: mean time after which one that drifts goes back to where the trust began.

    """

    times_s: tuple[float, ...] = (3600.0, 15.0, 3.0)
    drift: float = 0.01
    switch_s: float = 10.0

    def __post_init__(self) -> None:
        if not self.times_s or min(self.times_s) <= 0 or self.switch_s <= 0:
            raise ValueError("times_s must name at least one time, all times be positive")
        if list(self.times_s) != sorted(self.times_s, reverse=True):
            raise ValueError("times_s must fall: longest first")
        if not 0 <= self.drift < 1:
            raise ValueError("drift must be at least 0 and below 1")


class Memories:
    """Posteriors of the present rail, one for each memory.

    Args:
        settings: see there.
        prior: of a rail not seen yet.
        noise: of the adhesion, as far as known.
        slip_max: end of the model's range.
        size: number of curves of each memory.

    """

    def __init__(
        self, settings: MemorySettings, prior: Prior, noise: Noise, slip_max: float, size: int
    ) -> None:
        self.prior = prior
        self.noise = noise
        self.noise_var = noise.var
        self._settings, self._slip_max, self._size = settings, slip_max, size
        count = len(settings.times_s)
        self._rates = 1.0 / np.array(settings.times_s)
        drift = settings.drift if count > 1 else 0.0
        self._shares = np.array([1.0 - drift] + [drift / max(count - 1, 1)] * (count - 1))
        self._trust: Array = self._shares.copy()
        # One row of everything a memory, so that all of them are one operation.
        self._sums: Array = np.zeros((count, LENGTH))
        self._curves: list[Curves] = []
        self._at_x: Array = np.empty((count * size, NODES))
        self._factors: Array = np.empty((5, count * size))
        self._base: Array = np.empty((count, size))
        self._costs: Array = np.empty((count, size))
        self._weights: Array = np.empty((count, size))
        self._drawn_dof: Array = np.zeros(count)
        self._taken: Array = np.zeros(count)
        self._leader = 0

    @property
    def dof(self) -> float:
        """Degrees of freedom of the sums that lead."""
        return float(self._sums[self._leader, DOF])

    @property
    def count(self) -> float:
        """Samples in the sums that lead."""
        return float(self._sums[self._leader, COUNT])

    @property
    def histogram(self) -> Array:
        """Samples by slip in the sums that lead."""
        return self._sums[self._leader, HISTOGRAM]

    def restart(self, sums: Array, noise: Noise) -> None:
        """Go on from the sums of another stretch, all memories alike."""
        self.noise = noise
        self._sums[:] = sums
        curves = draw(sums, noise, self.prior, self._slip_max, self._size)
        self._curves = [curves] * len(self._sums)
        for i in range(len(self._sums)):
            self._adopt(i, curves)
        self._trust = self._shares.copy()
        self._weigh()

    def fade(self, seconds: float) -> None:
        """Forget, and let the trust go back to where it began, as time goes by."""
        if seconds <= 0.0:
            return
        share = np.exp(-seconds * self._rates)[:, None]
        self._sums *= share
        self._costs *= share
        back = -expm1(-seconds * self._settings.drift / self._settings.switch_s)
        self._trust = (1.0 - back) * self._trust + back * self._shares

    def predict(self, added: Array) -> tuple[Array, float]:
        """What new samples cost the present curves.

        Args:
            added: their sums.

        Returns:
            J of each curve of each memory, and the J that stands for all of them: −2σ² ln of the
            density that they predicted, up to a constant.

        """
        costs = segments.costs(added, self._at_x, self._factors).reshape(self._costs.shape)
        scale = -0.5 / self.noise_var
        least = costs.min(axis=1)
        inside = np.einsum("ij,ij->i", self._weights, np.exp(scale * (costs - least[:, None])))
        log_density = scale * least + np.log(np.maximum(inside, 1e-300))
        best = log_density.max()
        density = np.exp(log_density - best)
        cost = (best + log(self._trust @ density)) / scale
        trust = self._trust * np.maximum(density, LEAST_DENSITY)
        self._trust = trust / trust.sum()
        return costs, float(cost)

    def take(self, added: Array, costs: Array) -> None:
        """Add samples whose costs `predict` has told."""
        self._sums += added
        self._costs += costs
        self._taken += added[DOF]

    def refresh(self) -> None:
        """Weigh the curves by the sums; draw others where too few of them carry the weight."""
        self._weigh()
        effective = 1.0 / np.einsum("ij,ij->i", self._weights, self._weights)
        least = np.full(len(effective), self._size * FEW_FOLLOWERS)
        least[self._leader] = self._size * FEW
        # Where no draw is better (one slip only, say), a new one waits for new samples.
        poor = (effective < least) & (self._taken > NEWS * self._sums[:, DOF])
        poor |= self._sums[:, DOF] < LOST * self._drawn_dof
        if poor.any():
            for i in np.flatnonzero(poor):
                self._draw(int(i))
            self._weigh()

    def leading(self, least: float) -> list[tuple[Curves, Array]]:
        """Curves and weights of the memories that have at least so much trust; weights sum to 1."""
        chosen = np.flatnonzero(self._trust >= min(least, self._trust.max()))
        total = self._trust[chosen].sum()
        return [(self._curves[i], self._trust[i] / total * self._weights[i]) for i in chosen]

    def lag(self) -> tuple[float, float]:
        """What the memory that leads may lag behind, in μ_max and λ_m: its distance from the next.

        0 where the shorter memory's own uncertainty explains the distance, and for the shortest.
        """
        i, shorter = self._leader, self._leader + 1
        if shorter == len(self._curves) or (i == 0 and self._trust[0] > CERTAIN):
            return 0.0, 0.0
        lags = []
        for name in ("mu_max", "lambda_m"):
            long, short = (getattr(self._curves[k], name) for k in (i, shorter))
            middle = self._weights[shorter] @ short
            std = np.sqrt(self._weights[shorter] @ (short - middle) ** 2)
            distance = abs(float(middle - self._weights[i] @ long))
            lags.append(distance if distance > SURELY * std else 0.0)
        return lags[0], lags[1]

    def _draw(self, i: int) -> None:
        self._adopt(i, draw(self._sums[i], self.noise, self.prior, self._slip_max, self._size))

    def _adopt(self, i: int, curves: Curves) -> None:
        own = slice(i * self._size, (i + 1) * self._size)
        self._curves[i], self._base[i] = curves, curves.log_base
        self._at_x[own], self._factors[:, own] = curves.at_x, curves.factors
        self._costs[i] = curves.costs(self._sums[i])
        self._drawn_dof[i], self._taken[i] = self._sums[i, DOF], 0.0

    def _weigh(self) -> None:
        self._leader = leader = int(np.argmax(self._trust))
        dof = self._sums[:, DOF, None]
        self._weights = normalised(log_weights(self._base, self._costs, dof, self.noise))
        cost = self._weights[leader] @ np.maximum(self._costs[leader], 0.0)
        self.noise_var = self.noise.given(float(cost), float(dof[leader, 0]))
