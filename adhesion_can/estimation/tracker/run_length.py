"""Detection of surface changes by the run-length posterior (Adams & MacKay, arXiv:0710.3742, 2007).

Each update adds a hypothesis: 'the surface changed just before this update'. A hypothesis keeps the
sums of the samples since then. Its weight is the Bayes factor of a new curve for these samples
against the curve so far. Both treat the noise variance as equally unknown, so that rising noise, or
an error that no curve explains, favours neither.

The new curve of a hypothesis is a mixture over the nodes of c2 with c1 and c3 integrated out in
closed form. That is a marginal likelihood. So without a change the Bayes factor exceeds 1/α with a
probability of at most α (Ville's inequality, 1939): the rate of false alarms is set, not tuned.
Where wheel speeds err, two sums of squares compete, and the new curve gets the larger one at each
c2. With the measured slips as they are a curve that is too flat fits best (regression dilution),
with corrected scores one that is too steep may have a sum of squares near zero or below. Both are
counted from the same sum of the curve so far, which has no such advantage.

Hypotheses are pruned so that their ages grow geometrically, and their number stays constant.
"""

from math import exp, log
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.layout import (
    CORRECTED,
    DOF,
    LENGTH,
    MEASURED,
    X_NODES,
    A,
    B,
    C,
    D,
    E,
    Z,
)
from adhesion_can.estimation.tracker.prior import Prior
from adhesion_can.estimation.tracker.settings import RunLengthSettings
from adhesion_can.values import Stateful

LEFT_OUT = 16.0
"""Cost of leaving an update out, in units of σ², beyond the expectation by noise."""
WIDEST = 1.5
"""Largest (elder − younger)/middle of three neighbouring ages; 1.5 is a factor of 2 each."""
NEW_MEAN, NEW_STD = (0.3, 0.15), (0.4, 0.4)
"""Prior mean and standard deviation of (c1, c3) of a new surface."""
_NEW_PRECISION = (NEW_STD[0] ** -2.0, NEW_STD[1] ** -2.0)
_NEW_SQUARE = (NEW_MEAN[0] / NEW_STD[0]) ** 2 + (NEW_MEAN[1] / NEW_STD[1]) ** 2


class Evidence(NamedTuple):
    """Samples of an update, and their sum of squares J with the curve so far.

    Attributes:
        sums: Sums with corrected scores and with the slips as measured, shape (2, LENGTH).
        old_cost: J of the curve so far in both, shape (2,).

    """

    sums: Array
    old_cost: Array


class RunLengthHypotheses(Stateful):
    """Run-length hypotheses that are kept.

    Args:
        settings: Number of hypotheses and rate of false alarms.
        prior: Prior of a new surface, for its steepness c2.

    """

    def __init__(self, settings: RunLengthSettings, prior: Prior) -> None:
        self._settings = settings
        spacing = np.abs(np.gradient(X_NODES))
        log_prior = prior.log_marginal(1, X_NODES) + np.log(spacing)
        # With the determinant of the prior's precision of (c1, c3).
        self._log_prior = log_prior - np.logaddexp.reduce(log_prior) - log(NEW_STD[0] * NEW_STD[1])
        self.clear()

    def clear(self) -> None:
        """Remove all hypotheses."""
        self._count = 0
        self._updates = 0
        # Of both kinds, as in `Evidence`.
        self._sums: Array = np.zeros((2, self._settings.hypotheses, LENGTH))
        self._old_cost: Array = np.zeros((2, self._settings.hypotheses))
        self._since_us: list[int] = []
        self._born: list[int] = []

    def __len__(self) -> int:
        return self._count

    @property
    def sums(self) -> Array:
        """Sums of the samples since each hypothesis' change, shape (len, LENGTH).

        They are those with corrected scores.
        """
        return self._sums[CORRECTED, : self._count]

    @property
    def since_us(self) -> list[int]:
        """Stamp of the first sample after each hypothesis' change, µs."""
        return self._since_us

    def add(self, update: Evidence, t_us: int) -> None:
        """Add an update to all hypotheses, and a hypothesis that starts with it.

        Args:
            update: Samples of the update.
            t_us: Stamp of the update's first sample, µs.

        """
        slot = self._free_slot()
        self._updates += 1
        self._sums[:, slot], self._old_cost[:, slot] = 0.0, 0.0
        self._since_us[slot], self._born[slot] = t_us, self._updates
        self._sums[:, : self._count] += update.sums[:, None]
        self._old_cost[:, : self._count] += update.old_cost[:, None]

    def close(self, accepted: int, latest: Evidence, noise_var: float) -> None:
        """Add a last hypothesis after a detected change: it starts with the next update.

        The latest update may hold samples of both surfaces. For this hypothesis the update belongs
        to neither: it costs the expectation by noise, and a little for leaving it out.

        Args:
            accepted: Index of the hypothesis that was accepted; it is kept.
            latest: Samples of the latest update.
            noise_var: Variance σ² of the adhesion noise.

        """
        slot = self._free_slot(accepted)
        self._updates += 1
        self._sums[:, slot] = 0.0
        dof = latest.sums[:, DOF]
        # J of noise alone scatters by √(2 n) σ²: twice that is no sign of another surface.
        neither = dof + LEFT_OUT + 2.0 * np.sqrt(2.0 * dof)
        self._old_cost[:, slot] = latest.old_cost - neither * noise_var
        self._since_us[slot], self._born[slot] = -1, self._updates

    def extend(self, update: Evidence, t_us: int) -> None:
        """Add an update of the new surface, after `close`, to all hypotheses."""
        self._sums[:, : self._count] += update.sums[:, None]
        self._since_us = [t_us if since == -1 else since for since in self._since_us]

    def _free_slot(self, kept: int | None = None) -> int:
        """Index for a new hypothesis; where none is free, that of the most redundant one.

        It is the one whose neighbours in age are relatively closest, so that the ages grow
        geometrically. Where they are far apart already, the eldest is removed.
        """
        if self._count < self._settings.hypotheses:
            self._count += 1
            self._since_us.append(0)
            self._born.append(0)
            return self._count - 1
        born = self._born
        places = [place for place in range(self._count) if place != kept]
        eldest_first = sorted(places, key=born.__getitem__)
        age = [self._updates + 1 - born[slot] for slot in eldest_first]
        closest, least = 0, WIDEST
        for k in range(1, len(eldest_first) - self._settings.dense):
            crowded = (age[k - 1] - age[k + 1]) / age[k]
            if crowded < least:
                closest, least = k, crowded
        return eldest_first[closest]

    def log_factors(
        self, noise_var: float, noise_dof: float | None = None, inflation: float = 1.0
    ) -> Array:
        """Log Bayes factor of each hypothesis against no change, shape (len,).

        Args:
            noise_var: Variance σ² of the adhesion noise.
            noise_dof: Degrees of freedom of that variance, of which at most `noise_freedom` count;
                None: it is exact.
            inflation: Variance of a mean error over that of independent ones. All sums are divided
                by it, as if as many samples fewer had been seen (tempered likelihood).

        """
        sums, old_cost = self._sums[:, : self._count], self._old_cost[:, : self._count]
        old, cost, det = _new_curve_costs(sums, old_cost, noise_var * inflation)
        gain = 0.5 * (old - cost)
        if noise_dof is not None:
            freedom = min(self._settings.noise_freedom, noise_dof)
            halves = 0.5 * (freedom + sums[MEASURED, :, DOF] / inflation)
            ratio = (freedom + np.maximum(old, 0.0)) / (freedom + cost)
            # Noise may have risen. Where it seems to have fallen, in a span as short as this, the
            # errors of the slips have not: their variances are stated, and would shrink with it.
            gain = np.minimum(gain, halves[:, None] * np.log(ratio))
        of_both = (self._log_prior - 0.5 * np.log(det)) + gain
        terms = np.minimum(of_both[0], of_both[1])
        top = terms.max(axis=1)
        return np.asarray(top + np.log(np.exp(terms - top[:, None]).sum(axis=1)))

    def probability(self, log_factors: Array) -> float:
        """Posterior probability that the surface changed before one of the last updates."""
        if not len(log_factors):
            return 0.0
        log_odds = float(np.logaddexp.reduce(log_factors)) + log(self._settings.false_alarm)
        return 1.0 / (1.0 + exp(-min(max(log_odds, -700.0), 700.0)))


def _new_curve_costs(sums: Array, old_cost: Array, noise_var: float) -> tuple[Array, Array, Array]:
    """J of the curve so far and of a new one at each node, both over σ².

    Args:
        sums: Sums of each hypothesis, both kinds, shape (2, k, LENGTH).
        old_cost: J of the curve so far in them, shape (2, k).
        noise_var: Variance σ² of the adhesion noise.

    Returns:
        J of the curve so far, shape (k, 1); the least of a new curve, with its prior, and the
        determinant of the precision of (c1, c3), both of shape (2, k, NODES).

    """
    s = sums[..., : Z + 1] * (1.0 / noise_var)
    p1, p3 = _NEW_PRECISION
    # Corrected scores may give a negative sum of squares where slips do not determine c2.
    a = np.maximum(s[..., A], 0.0) + p1
    b = s[..., B]
    d = np.maximum(s[..., D, None], 0.0) + p3
    r1 = s[..., C] + p1 * NEW_MEAN[0]
    r3 = s[..., E, None] + p3 * NEW_MEAN[1]
    product = a * d
    det = np.maximum(product - b * b, 1e-12 * product)
    explained = (r1 * (d * r1 - (2.0 * r3) * b) + a * (r3 * r3)) / det
    # Both are counted from J of the curve so far with the slips as measured.
    old = old_cost[MEASURED, :, None] / noise_var
    apart = old - old_cost[..., None] / noise_var
    cost = np.maximum(s[..., Z, None] + (apart + _NEW_SQUARE) - explained, 0.0)
    return old, cost, det
