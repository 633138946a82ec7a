"""Detection of surface changes by the run-length posterior (Adams & MacKay, arXiv:0710.3742, 2007).

Each update adds a hypothesis: 'the surface changed just before this update'. A hypothesis keeps the
sums of the samples since then. Its weight is the Bayes factor of a new curve for these samples
against the curve so far. Both treat the noise variance as equally unknown, so that rising noise, or
an error that no curve explains, favours neither.

The new curve of a hypothesis is a mixture over the nodes of c2 with c1 and c3 integrated out in
closed form. That is a marginal likelihood. So without a change the Bayes factor exceeds 1/α with a
probability of at most α (Ville's inequality, 1939): the rate of false alarms is set, not tuned.
Hypotheses are pruned so that their ages grow geometrically, and their number stays constant.
"""

from dataclasses import dataclass
from math import exp, inf, log, sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker import curve_sums
from adhesion_can.estimation.tracker.curve_sums import DOF, LENGTH, X_NODES, Z
from adhesion_can.estimation.tracker.prior import Prior

_MEAN, _STD = np.array([0.3, 0.15]), np.array([0.4, 0.4])
"""Prior mean and standard deviation of (c1, c3) of a new surface."""
LEFT_OUT = 16.0
"""Cost of leaving an update out, in units of σ², beyond the expectation by noise."""
WIDEST = 1.5
"""Largest (elder − younger)/middle of three neighbouring ages; 1.5 is a factor of 2 each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunLengthSettings:
    """Run-length detection of surface changes.

    Attributes:
        false_alarm: Prior probability of a change per update, above 0; it bounds the rate of false
            alarms. Larger: changes are detected earlier, with more false alarms.
        contenders: Number of run lengths that are kept. Larger: finer dating of changes, more CPU.
        dense: Number of the latest run lengths that are all kept, below `contenders`.
        noise_freedom: Largest weight of the noise estimate in a comparison, samples. Larger: the
            noise is trusted more, so that its increase may look like a change.
        settling_samples: Number of samples after a change within which its time may be revised.

    """

    false_alarm: float = 1e-9
    contenders: int = 9
    dense: int = 3
    noise_freedom: float = 100.0
    settling_samples: int = 240

    def __post_init__(self) -> None:
        if not 0 < self.false_alarm < 1:
            raise ValueError("false_alarm must be a probability above 0")
        if not 1 <= self.dense < self.contenders:
            raise ValueError("dense must be at least 1 and below contenders")
        if self.noise_freedom <= 0 or self.settling_samples < 0:
            raise ValueError("noise_freedom must be positive, settling_samples not negative")


class RunLengthHypotheses:
    """Run-length hypotheses that are kept.

    Args:
        settings: Number of hypotheses and rate of false alarms.
        prior: Prior of a new surface, for its steepness c2.

    """

    def __init__(self, settings: RunLengthSettings, prior: Prior) -> None:
        self._settings = settings
        spacing = np.abs(np.gradient(X_NODES))
        log_prior = prior.log_marginal(1, X_NODES) + np.log(spacing)
        self._log_prior = log_prior - np.logaddexp.reduce(log_prior)
        self.clear()

    def clear(self) -> None:
        """Remove all hypotheses."""
        self._count = 0
        self._updates = 0
        self._sums: Array = np.zeros((self._settings.contenders, LENGTH))
        self._old_cost: Array = np.zeros(self._settings.contenders)
        self._since_us: list[int] = []
        self._born: list[int] = []

    def __len__(self) -> int:
        return self._count

    @property
    def sums(self) -> Array:
        """Sums of the samples since each hypothesis' change, shape (len, LENGTH)."""
        return self._sums[: self._count]

    @property
    def since_us(self) -> list[int]:
        """Stamp of the first sample after each hypothesis' change, µs."""
        return self._since_us

    def add(self, increment: Array, old_cost: float, t_us: int) -> None:
        """Add an update to all hypotheses, and a hypothesis that begins with it.

        Args:
            increment: Sums of the update's samples, shape (LENGTH,).
            old_cost: Sum of squares J of the samples with the curve so far.
            t_us: Stamp of the update's first sample, µs.

        """
        slot = self._free_slot()
        self._updates += 1
        self._sums[slot], self._old_cost[slot] = 0.0, 0.0
        self._since_us[slot], self._born[slot] = t_us, self._updates
        self._sums[: self._count] += increment
        self._old_cost[: self._count] += old_cost

    def close(self, accepted: int, latest_cost: float, latest_dof: float, noise_var: float) -> None:
        """Add a last hypothesis after a detected change: it begins with the next update.

        The latest update may hold samples of both surfaces. For this hypothesis the update belongs
        to neither: it costs the expectation by noise, and a little for leaving it out.

        Args:
            accepted: Index of the hypothesis that was accepted; it is kept.
            latest_cost: Sum of squares J of the latest update with the curve so far.
            latest_dof: Degrees of freedom of the latest update.
            noise_var: Variance σ² of the adhesion noise.

        """
        slot = self._free_slot(accepted)
        self._updates += 1
        self._sums[slot] = 0.0
        # J of noise alone scatters by √(2 n) σ²: twice that is no sign of another surface.
        neither = latest_dof + LEFT_OUT + 2.0 * sqrt(2.0 * latest_dof)
        self._old_cost[slot] = latest_cost - neither * noise_var
        self._since_us[slot], self._born[slot] = -1, self._updates

    def extend(self, increment: Array, t_us: int) -> None:
        """Add an update of the new surface, after `close`, to all hypotheses."""
        self._sums[: self._count] += increment
        self._since_us = [t_us if since == -1 else since for since in self._since_us]

    def _free_slot(self, kept: int | None = None) -> int:
        """Index for a new hypothesis; where none is free, that of the most redundant one.

        It is the one whose neighbours in age are relatively closest, so that the ages grow
        geometrically. Where they are far apart already, the eldest is removed.
        """
        if self._count < self._settings.contenders:
            self._count += 1
            self._since_us.append(0)
            self._born.append(0)
            return self._count - 1
        places = (place for place in range(self._count) if place != kept)
        eldest_first = sorted(places, key=self._born.__getitem__)
        age = [float(self._updates + 1 - self._born[slot]) for slot in eldest_first]
        inner = range(1, len(eldest_first) - self._settings.dense)
        crowded = {k: (age[k - 1] - age[k + 1]) / age[k] for k in inner}
        closest = min(crowded, key=crowded.__getitem__, default=0)
        return eldest_first[closest if crowded.get(closest, inf) < WIDEST else 0]

    def log_factors(self, noise_var: float, noise_dof: float | None = None) -> Array:
        """Log Bayes factor of each hypothesis against no change, shape (len,).

        Args:
            noise_var: Variance σ² of the adhesion noise.
            noise_dof: Degrees of freedom of that variance, of which at most `noise_freedom` count;
                None: it is exact.

        """
        s = self.sums * (1.0 / noise_var)
        p1, p3 = _STD**-2.0
        # Corrected scores may give a negative sum of squares where slips do not determine c2.
        a = np.maximum(s[:, curve_sums.A], 0.0) + p1
        b = s[:, curve_sums.B]
        d = np.maximum(s[:, curve_sums.D, None], 0.0) + p3
        r1 = s[:, curve_sums.C] + p1 * _MEAN[0]
        r3 = s[:, curve_sums.E, None] + p3 * _MEAN[1]
        det = np.maximum(a * d - b * b, 1e-12 * a * d)
        explained = (r1 * (d * r1 - (2.0 * r3) * b) + a * (r3 * r3)) / det
        prior_term = p1 * _MEAN[0] ** 2 + p3 * _MEAN[1] ** 2
        cost = np.maximum(s[:, Z, None] + prior_term - explained, 0.0)
        occam = self._log_prior - 0.5 * np.log(det * (1.0 / (p1 * p3)))
        old = self._old_cost[: self._count, None] / noise_var
        if noise_dof is None:
            score = occam + 0.5 * (old - cost)
        else:
            nu = min(self._settings.noise_freedom, noise_dof)
            freedom = nu + self.sums[:, DOF, None]
            score = occam + 0.5 * freedom * np.log((nu + np.maximum(old, 0.0)) / (nu + cost))
        top = score.max(axis=1)
        return np.asarray(top + np.log(np.exp(score - top[:, None]).sum(axis=1)))

    def probability(self, log_factors: Array) -> float:
        """Posterior probability that the surface changed before one of the last updates."""
        if not len(log_factors):
            return 0.0
        log_odds = float(np.logaddexp.reduce(log_factors)) + log(self._settings.false_alarm)
        return 1.0 / (1.0 + exp(-min(max(log_odds, -700.0), 700.0)))
