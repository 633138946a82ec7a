"""States of the service: conditions, their priorities, and the timers that they depend on.

The status follows from the conditions that hold at a due time, whatever the status was before:
the first row of `STATUS_RULES` whose condition holds gives it. `VALUES` gives the origin of
the setpoints' numbers in each status. `StatusMachine` owns the timers:

| timer | started by | effect |
|---|---|---|
| fault hold, `FAULT_HOLD_US` | a failed estimator, a second sender | FAULT till it ends |
| stale, `hold_s` | the first due time with a stale input | the last values are held till it ends |
| change, `change_s` | a change of the surface | SURFACE_CHANGE till it ends or the peak is known |
| sample age, `estimate_s` | each sample that can be used | LOW_EXCITATION once it has ended |

Once the sample age has ended, in coasting or at a standstill, the rail may have become another one
unseen, and low efforts would not show it: only samples near the peak that is believed start it
again.
"""

from collections.abc import Callable
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from adhesion_can.config import ServiceSettings
from adhesion_can.estimation.tracker.layout import CERTAIN_STDS
from adhesion_can.estimation.tracker.points import is_valid
from adhesion_can.physics.estimate import CHANGED, Estimate
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.status import Status

FAULT_HOLD_US = 1_000_000
"""Shortest time for which FAULT is sent, µs, so that no receiver misses it."""


BELIEVED = 1.25
"""Adhesion of a sample over the largest μ_max that is believed beyond which it is not used: what is
above that by more than noise."""

LEAST_USABLE = 2
"""Number of samples of an update, where it has so many, that must be usable: one may be far out."""
MET_AGAIN = 0.8
"""Share of μ_max that they reach after a pause before the peak is believed again."""


class Values(Enum):
    """Origin of the numbers in the setpoints."""

    CURRENT = auto()
    HELD = auto()
    NOT_AVAILABLE = auto()


class StatusConditions(NamedTuple):
    """Conditions that decide on the status, at one due time.

    Attributes:
        fault: Whether the estimator failed, or another service sent the same messages, less than
            `FAULT_HOLD_US` ago.
        stale: Whether a required input has been silent for more than three cycles.
        no_estimate: Whether there is no estimate yet.
        surface_change: Whether the surface has just changed.
        low_excitation: Whether the peak is not identifiable from the data, or the vehicle speed is
            not independent of the driven wheels.

    """

    fault: bool = False
    stale: bool = False
    no_estimate: bool = False
    surface_change: bool = False
    low_excitation: bool = False


class StatusRule(NamedTuple):
    """Row of the table of states.

    Attributes:
        condition: Predicate of the conditions at a due time.
        status: Status where the predicate holds and no earlier row's does.

    """

    condition: Callable[[StatusConditions], bool]
    status: Status


STATUS_RULES: tuple[StatusRule, ...] = (
    StatusRule(lambda conditions: conditions.fault, Status.FAULT),
    StatusRule(lambda conditions: conditions.stale, Status.STALE_INPUT),
    StatusRule(lambda conditions: conditions.no_estimate, Status.INIT),
    StatusRule(lambda conditions: conditions.surface_change, Status.SURFACE_CHANGE),
    StatusRule(lambda conditions: conditions.low_excitation, Status.LOW_EXCITATION),
    StatusRule(lambda _: True, Status.TRACKING),
)
"""Table of states in descending order of priority."""

VALUES: dict[Status, Values] = {
    Status.INIT: Values.NOT_AVAILABLE,
    Status.TRACKING: Values.CURRENT,
    Status.LOW_EXCITATION: Values.CURRENT,
    Status.SURFACE_CHANGE: Values.CURRENT,
    Status.STALE_INPUT: Values.HELD,
    Status.FAULT: Values.NOT_AVAILABLE,
}
"""Origin of the setpoints' numbers in each status."""


def select_status(conditions: StatusConditions) -> Status:
    """Status by the first row of `STATUS_RULES` whose condition holds."""
    return next(row.status for row in STATUS_RULES if row.condition(conditions))


class UsableLimits(NamedTuple):
    """What a usable sample is.

    Attributes:
        slip_max: Largest |λ|.
        mu_ceiling: Largest μ_max that is believed; inf: any.

    """

    slip_max: float
    mu_ceiling: float


class StatusMachine:
    """Status of the service, with the timers that it depends on.

    Args:
        settings: Durations of the timers.
        limits: What a usable sample is.

    """

    def __init__(self, settings: ServiceSettings, limits: UsableLimits) -> None:
        self._limits = limits
        self._hold_us = settings.hold_s * 1e6
        self._change_us = settings.change_s * 1e6
        self._sample_age_us = settings.estimate_s * 1e6
        self._fault_until_us = -1
        self._stale_since_us: int | None = None
        self._changed_at_us: int | None = None
        self._last_sample_us: int | None = None

    def restart(self) -> None:
        """Stop all timers but the fault hold."""
        self._stale_since_us = None
        self._changed_at_us = None
        self._last_sample_us = None

    def add_fault(self, t_us: int) -> None:
        """Start the fault hold."""
        self._fault_until_us = t_us + FAULT_HOLD_US

    def add_sample(self, t_us: int) -> None:
        """Start the sample age again, at the stamp of the latest sample."""
        self._last_sample_us = t_us

    def add_estimate(self, t_us: int, estimate: Estimate) -> None:
        """Start the change timer with a change of the surface, and stop it with a known peak."""
        if estimate.change_probability >= CHANGED:
            self._changed_at_us = t_us
        elif estimate.identifiable.both:
            self._changed_at_us = None

    def discard_estimate(self) -> None:
        """Stop the change timer: the estimate that reported the change is gone."""
        self._changed_at_us = None

    def advance(
        self,
        t_us: int,
        samples: Samples,
        estimate: Estimate | None,
        *,
        is_new: bool,
        stale: bool,
        speed_derived: bool,
    ) -> Status:
        """Status at a due time, with the timers started by what came since the one before.

        Args:
            t_us: Due time, µs; not before that of the previous call.
            samples: Samples that became complete since the due time before; may be empty.
            estimate: Latest estimate of the curve; None where there is none.
            is_new: Whether it is another estimate than at the due time before.
            stale: Whether a required input has been silent for more than three cycles.
            speed_derived: Whether the vehicle speed is derived from the driven axles.

        """
        if len(samples):
            self._look_at(samples, estimate)
        if is_new and estimate is not None:
            self.add_estimate(t_us, estimate)
        return self.update(t_us, estimate, stale=stale, speed_derived=speed_derived)

    def _look_at(self, samples: Samples, estimate: Estimate | None) -> None:
        """Start the sample age again where samples can be used."""
        if estimate is not None and estimate.objection is not Objection.NONE:
            return
        limits = self._limits
        adhesion = np.abs(samples.adhesion)
        believed = adhesion <= BELIEVED * limits.mu_ceiling
        if 2 * np.count_nonzero(believed) < len(samples):
            return  # what efforts or loads say of the others is no better
        # Of a wheel that rolls the error of the vehicle speed, which all axles share, makes a slip.
        usable = believed & is_valid(samples, limits.slip_max)
        usable &= adhesion > CERTAIN_STDS * np.sqrt(samples.adhesion_var)
        least = min(LEAST_USABLE, len(samples))
        if np.count_nonzero(usable) < least:
            return
        t_us = int(samples.t_us[usable][-1])
        if estimate is not None and self._last_sample_us is not None and self._is_silent(t_us):
            near = usable & (adhesion >= MET_AGAIN * estimate.mu_max)
            if np.count_nonzero(near) < least:
                return
        self.add_sample(t_us)

    def _is_silent(self, t_us: int) -> bool:
        """Whether the sample age has ended."""
        sample_us = self._last_sample_us
        return sample_us is None or t_us - sample_us > self._sample_age_us

    def update(
        self, t_us: int, estimate: Estimate | None, *, stale: bool, speed_derived: bool
    ) -> Status:
        """Status at a due time.

        Args:
            t_us: Due time, µs; not before that of the previous call.
            estimate: Latest estimate of the curve; None where there is none.
            stale: Whether a required input has been silent for more than three cycles.
            speed_derived: Whether the vehicle speed is derived from the driven axles.

        """
        if not stale:
            self._stale_since_us = None
        elif self._stale_since_us is None:
            self._stale_since_us = t_us
        changed_us = self._changed_at_us
        changing = changed_us is not None and t_us - changed_us <= self._change_us
        objected = estimate is not None and estimate.objection is not Objection.NONE
        identifiable = estimate is not None and estimate.identifiable.both
        return select_status(
            StatusConditions(
                fault=t_us < self._fault_until_us,
                stale=stale,
                no_estimate=estimate is None,
                surface_change=changing and not speed_derived and not objected,
                low_excitation=not identifiable or speed_derived or self._is_silent(t_us),
            )
        )

    def may_hold(self, t_us: int) -> bool:
        """Whether the last values may still be sent at a due time with a stale input."""
        return self._stale_since_us is not None and t_us - self._stale_since_us < self._hold_us
