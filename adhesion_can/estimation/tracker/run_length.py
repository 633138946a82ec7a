"""Whether, and since when, the rail is another one: run-length hypotheses.

After every update one more contender stands up: 'the rail changed just before this update'. Each
keeps the sums of the samples since, and is weighed by the Bayes factor of a fresh curve for them
against the curve of the rail before (Adams & MacKay, arXiv:0710.3742). Both take the noise as
equally unknown, so that noise which rises, or an error that no curve explains, speaks for neither.

A contender's curve is a mixture over the nodes of c2 with c1 and c3 integrated out in closed form.
That is a probability density of the data before they are seen, so on a rail that did not change its
Bayes factor exceeds 1/α with a probability of at most α (Ville 1939): the rate of false alarms is
set, not tuned. The contenders' ages thin out with age, so their number stays the same for ever.
"""

from dataclasses import dataclass
from math import exp, inf, log, sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker import curve_sums as segments
from adhesion_can.estimation.tracker.curve_sums import DOF, LENGTH, X_NODES, Z
from adhesion_can.estimation.tracker.prior import Prior

_MEAN, _STD = np.array([0.3, 0.15]), np.array([0.4, 0.4])
"""Of (c1, c3) of a rail not seen yet."""
LEFT_OUT = 16.0
"""Price of leaving an update out, in units of σ², beyond what noise explains."""
WIDEST = 1.5
"""Of three ages in a row, (elder − younger)/middle: 1.5 is a factor of 2 from one to the next."""


@dataclass(frozen=True, slots=True)
class RunLengthSettings:
    """When another rail is believed in.

    Attributes:
        false_alarm: probability per update that the rail changed, as the estimator takes it; also
            bounds how often it errs on a rail that did not.
        contenders: number of run lengths that are kept.
        dense: so many of the latest are all kept.
        noise_freedom: samples that the knowledge of the noise is worth in a comparison.
        settling_samples: after a change, samples over which its moment may still be revised.

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


class Contenders:
    """The run-length hypotheses that are kept.

    Args:
        settings: see there.
        prior: of the steepness of a rail not seen yet.

    """

    def __init__(self, settings: RunLengthSettings, prior: Prior) -> None:
        self._settings = settings
        spacing = np.abs(np.gradient(X_NODES))
        log_prior = prior.log_marginal(1, X_NODES) + np.log(spacing)
        self._log_prior = log_prior - np.logaddexp.reduce(log_prior)
        self.clear()

    def clear(self) -> None:
        """Forget all of them."""
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
        """Of the samples since each contender's change, shape (len, LENGTH)."""
        return self._sums[: self._count]

    @property
    def since_us(self) -> list[int]:
        """Stamp of the first sample after each contender's change, µs."""
        return self._since_us

    def add(self, increment: Array, old_cost: float, t_us: int) -> None:
        """Take an update, and one more contender that begins with it.

        Args:
            increment: its sums.
            old_cost: what it costs the old curve, as J.
            t_us: stamp of its first sample.

        """
        slot = self._free_slot()
        self._updates += 1
        self._sums[slot], self._old_cost[slot] = 0.0, 0.0
        self._since_us[slot], self._born[slot] = t_us, self._updates
        self._sums[: self._count] += increment
        self._old_cost[: self._count] += old_cost

    def close(self, believed: int, latest_cost: float, latest_dof: float, noise_var: float) -> None:
        """The rail has changed: one last contender, of what comes from now on.

        The latest update may hold samples of both rails. For this contender it belongs to
        neither: it costs what noise does, and a little for leaving it out.

        Args:
            believed: place of the contender that was believed in; it stays.
            latest_cost: what the latest update costs the old curve, as J.
            latest_dof: its degrees of freedom.
            noise_var: σ² of the adhesion.

        """
        slot = self._free_slot(believed)
        self._updates += 1
        self._sums[slot] = 0.0
        # J of noise alone scatters by √(2 n) σ²: twice that is no sign of another rail.
        neither = latest_dof + LEFT_OUT + 2.0 * sqrt(2.0 * latest_dof)
        self._old_cost[slot] = latest_cost - neither * noise_var
        self._since_us[slot], self._born[slot] = -1, self._updates

    def extend(self, increment: Array, t_us: int) -> None:
        """Take an update of the new rail, after `close`: the old curve is out of it."""
        self._sums[: self._count] += increment
        self._since_us = [t_us if since == -1 else since for since in self._since_us]

    def _free_slot(self, kept: int | None = None) -> int:
        """Place of a new contender; where none is free, that of the one that is missed least.

        It is the one whose neighbours in age stand closest around it, so that the ages come to
        grow by an even factor. Where that is large already, the eldest goes.
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
        """Logarithm of the Bayes factor of each contender against the old curve, shape (len,).

        Args:
            noise_var: σ² of the adhesion.
            noise_dof: samples that it comes from, of which at most `noise_freedom` count; None
                takes it as certain.

        """
        s = self.sums * (1.0 / noise_var)
        p1, p3 = _STD**-2.0
        # Corrected scores may leave a sum of squares below zero where the slips say nothing of c2.
        a = np.maximum(s[:, segments.A], 0.0) + p1
        b = s[:, segments.B]
        d = np.maximum(s[:, segments.D, None], 0.0) + p3
        r1 = s[:, segments.C] + p1 * _MEAN[0]
        r3 = s[:, segments.E, None] + p3 * _MEAN[1]
        det = np.maximum(a * d - b * b, 1e-12 * a * d)
        explained = (r1 * (d * r1 - (2.0 * r3) * b) + a * (r3 * r3)) / det
        at_rest = p1 * _MEAN[0] ** 2 + p3 * _MEAN[1] ** 2
        cost = np.maximum(s[:, Z, None] + at_rest - explained, 0.0)
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
        """Probability that the rail changed before one of the last updates."""
        if not len(log_factors):
            return 0.0
        log_odds = float(np.logaddexp.reduce(log_factors)) + log(self._settings.false_alarm)
        return 1.0 / (1.0 + exp(-min(max(log_odds, -700.0), 700.0)))
