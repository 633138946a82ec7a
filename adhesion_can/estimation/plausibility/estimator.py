"""Stage in front of any estimator that watches its samples and vouches for its estimate, or not."""

from collections import deque
from copy import deepcopy

import numpy as np

from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.plausibility.settings import PlausibilitySettings
from adhesion_can.estimation.plausibility.watch import PlausibilityWatch
from adhesion_can.estimation.tracker.points import is_valid
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import NO_SAMPLES, Samples
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.values import Stateful

RECENT_US = 1_000_000
"""Time over which it is counted how many samples were left out, µs."""
MOST_LEFT_OUT = 0.5
"""Share of the samples that are beyond the model from which there is an objection."""


class WatchedEstimator(Stateful):
    """Estimator whose samples are watched.

    After a jump the samples do not reach the estimator, and the estimate is the one from before. An
    estimate with an objection has no known standard deviation.

    Args:
        inner: Estimator of the curve.
        vehicle: Vehicle that the samples come from.
        settings: Limits of the watch.
        slip_max: Largest |λ| of a usable sample.

    """

    def __init__(
        self,
        inner: Estimator,
        vehicle: Locomotive,
        settings: PlausibilitySettings,
        slip_max: float,
    ) -> None:
        self.inner = inner
        self._watch = PlausibilityWatch(vehicle, settings)
        self._ceiling = settings.mu_ceiling
        self._slip_max = slip_max
        self._counts: deque[tuple[int, int, int]] = deque()
        """Stamp of an update, number of its samples, and of those beyond the model."""
        self._recent = self._beyond = 0
        """Sums of both."""
        self._kept: Estimator | None = None
        """The estimator from before a step of the efforts whose answer is awaited."""
        self._objection = Objection.NONE
        self._sound: Estimate | None = None
        """The estimate from before a jump that stands."""
        self._given: Estimate | None = None
        """Latest estimate of `inner`."""
        self._current: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        fed = samples
        if len(samples):
            waited, stood = self._watch.waits, self._watch.jump is not Objection.NONE
            self._objection = self._watch.add(samples, self._given)
            if self._watch.waits and not waited:
                self._kept = deepcopy(self.inner)
            if self._watch.jump is not Objection.NONE:
                fed = NO_SAMPLES
                # What was learned between a jump and its objection is not sent: the numbers of
                # LOW_EXCITATION are still what a careful drive begins with.
                if self._kept is not None:
                    self.inner = self._kept
                elif not stood:
                    self._sound = self._watch.earlier
            else:
                self._sound = None
            if not self._watch.waits:
                self._kept = None
            self._count(samples)
        given = self.inner.update(fed, now_us)
        if given is None:
            self._current = None
        elif given is not self._given or len(samples):
            self._current = self._vouched(self._sound or given)
        self._given = given
        return self._current

    def _count(self, samples: Samples) -> None:
        """Count what is left out."""
        valid = is_valid(samples, self._slip_max)
        t_us, count = samples.t_us.item(-1), len(samples)
        beyond = count - int(np.count_nonzero(valid))
        self._counts.append((t_us, count, beyond))
        self._recent += count
        self._beyond += beyond
        while self._counts[0][0] < t_us - RECENT_US:
            _, count, beyond = self._counts.popleft()
            self._recent -= count
            self._beyond -= beyond

    def _vouched(self, estimate: Estimate) -> Estimate:
        """The estimate with the objections to it."""
        objection = self._objection
        if objection is Objection.NONE:
            objection = self._further_objection(estimate)
        if objection is Objection.NONE:
            return estimate
        return estimate.objected(objection)

    def _further_objection(self, estimate: Estimate) -> Objection:
        """Objection by the estimate itself, or by what was left out of it."""
        if estimate.identifiable.mu_max and estimate.mu_max > self._ceiling:
            return Objection.BEYOND_CEILING
        if self._beyond > MOST_LEFT_OUT * self._recent:
            return Objection.SLIPS_BEYOND_MODEL
        return Objection.NONE
