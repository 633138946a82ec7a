"""What the service says and when, whatever way its inputs are taken.

A message is due at T0 + k · cycle, k = 0, 1, .., with T0 the stamp of the first accepted input. It
carries what was stamped before its due time: a frame stamped at it comes after it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, isfinite, isnan
from typing import NamedTuple

from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.extended.estimator import ExtendedEstimator
from adhesion_can.physics.estimate import CHANGED, Estimate, Identifiable
from adhesion_can.physics.readings import Role, SpeedSource
from adhesion_can.physics.samples import Samples
from adhesion_can.service.outputs import Health, OutputMessages, Outputs, outputs_of, target_slip
from adhesion_can.service.states import VALUES, Conditions, Status, Values, status_of

REQUIRED = frozenset({Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT})
SETPOINT = "AdhesionSetpoint"
STALE_CYCLES = 3
FAULT_US = 1_000_000
"""FAULT is shown at least this long, so that nobody misses it."""


class Moment(NamedTuple):
    """What the inputs have told until a due time.

    Attributes:
        samples: that became complete since the due time before.
        stale: whether a required input has been silent for three cycles.
        speed: last vehicle speed, m/s; None where it is not available.
        rejected: frames, since start.
        lost: frames, since start.

    """

    samples: Samples
    stale: bool
    speed: float | None
    rejected: int
    lost: int


@dataclass(slots=True)
class Counts:
    """What happened besides frames accepted and rejected.

    Attributes:
        clamped: frames stamped before the last advance.
        foreign: frames of ids that nobody listens to.
        restarts: holes in time that started the service anew.
        samples: formed.
        receive_drops: frames that a live bus lost; set by the loop that runs the core.

    """

    clamped: int = 0
    foreign: int = 0
    restarts: int = 0
    samples: int = 0
    receive_drops: int = 0


class Speaker(ABC):
    """Identifies the adhesion curve and says it in frames; how inputs are taken is a subclass's.

    Args:
        configuration: what is heard and how.
        estimator: None makes the configured one.
        on_setpoint: called with the stamp and the outputs of each setpoint.
        on_samples: called with the samples of each update that had any.

    """

    def __init__(
        self,
        configuration: Configuration,
        estimator: Callable[[], Estimator] | None = None,
        on_setpoint: Callable[[int, Outputs], None] | None = None,
        on_samples: Callable[[Samples], None] | None = None,
    ) -> None:
        configuration.require_identification()
        self.configuration = configuration
        self.receiver = Receiver(configuration.messages)
        self.messages = OutputMessages(configuration.database, configuration.messages)
        self.counts = Counts()
        self.loop_time_p99_us: float | None = None
        self.faults: list[str] = []
        """Why the service was in FAULT, oldest first."""
        self.outputs = Outputs()
        """What was last said."""
        self._make_estimator: Callable[[], Estimator] = estimator or configuration.make_estimator
        self._on_setpoint = on_setpoint
        self._on_samples = on_samples
        self._cycles = self.messages.cycles_us
        heard = {(choice.role, choice.axle) for choice in configuration.choices}
        self._axles = tuple(
            axle
            for role, axle in sorted(heard)
            if role is Role.WHEEL_SPEED and (Role.TRACTIVE_EFFORT, axle) in heard
        )
        self._now_us = 0
        self._fault_until_us = -1
        self._begin()

    def _begin(self) -> None:
        """State of a service that has heard nothing yet."""
        self._due: dict[str, int] = {}
        self._estimator = self._make_estimator()
        self._estimate: Estimate | None = None
        self._source = float(SpeedSource.UNKNOWN)
        self._sample_us: int | None = None
        self._change_us: int | None = None
        self._stale_us: int | None = None
        self._last_values: Outputs | None = None

    @abstractmethod
    def _moment(self, t_us: int) -> Moment:
        """What the inputs have told until a due time; due times come in ascending order."""

    @property
    @abstractmethod
    def dropped_samples(self) -> dict[str, int]:
        """Wheel-speed readings that gave no sample, by reason."""

    @property
    def now_us(self) -> int:
        """Time that the service has been brought to."""
        return self._now_us

    @property
    def next_due_us(self) -> int | None:
        """When the next message is due; None before the first accepted input."""
        return min(self._due.values()) if self._due else None

    @property
    def estimate(self) -> Estimate | None:
        """The present one."""
        return self._estimate

    @property
    def left_out_samples(self) -> dict[str, int]:
        """Samples that the extended model could not be applied to, by reason."""
        estimator = self._estimator
        return dict(estimator.left_out) if isinstance(estimator, ExtendedEstimator) else {}

    @property
    def _restart_us(self) -> float:
        """A hole in time of more than this is not filled with messages, µs."""
        return self.configuration.service.restart_s * 1e6

    def _set_source(self, source: float) -> None:
        derived = float(SpeedSource.DRIVEN_AXLES)
        if (source == derived) is not (self._source == derived):
            # Slips from one kind of speed say nothing about those from the other.
            self._forget_estimate()
        self._source = source

    def _emit(self, until_us: int) -> list[Frame]:
        frames: list[Frame] = []
        while self._due and (t_us := min(self._due.values())) <= until_us:
            moment = self._moment(t_us)
            self._refresh(t_us, moment)
            lost = moment.lost + self.counts.receive_drops
            health = Health(moment.rejected, lost, self.loop_time_p99_us)
            for name, due_us in self._due.items():
                if due_us == t_us:
                    frames += self.messages.compose(name, t_us, self.outputs, health)
                    self._due[name] = t_us + self._cycles[name]
                    if name == SETPOINT and self._on_setpoint:
                        self._on_setpoint(t_us, self.outputs)
        return frames

    def _refresh(self, t_us: int, moment: Moment) -> None:
        """Bring estimate and outputs to a due time."""
        self._update(t_us, moment.samples)
        status = status_of(self._conditions(t_us, stale=moment.stale))
        choice = VALUES[status]
        if choice is Values.CURRENT and self._estimate is not None:
            self.outputs = self._current(self._estimate, status, t_us, moment.speed)
            self._last_values = self.outputs
        elif choice is Values.HELD and self._last_values and self._holding(t_us):
            self.outputs = replace(self._last_values, status=status)
        else:
            self.outputs = Outputs(status)

    def _update(self, t_us: int, samples: Samples) -> None:
        if len(samples):
            self._sample_us = int(samples.t_us[-1])
            self.counts.samples += len(samples)
            if self._on_samples:
                self._on_samples(samples)
        try:
            estimate = self._estimator.update(samples, t_us)
        except (ArithmeticError, ValueError) as error:
            self._discard(t_us, f"the estimator failed: {error}")
            return
        if estimate is not None and not _finite(estimate):
            self._discard(t_us, "the estimate is not finite")
            return
        if estimate is not None and estimate is not self._estimate:
            if estimate.change_probability >= CHANGED:
                self._change_us = t_us
            elif estimate.identifiable.both:
                # The new rail is known: the change is over.
                self._change_us = None
        self._estimate = estimate

    def _second_sender(self, t_us: int) -> None:
        self._fail(t_us, "another sender of our messages on the bus")

    def _fail(self, t_us: int, reason: str) -> None:
        if not self.faults or self.faults[-1] != reason:
            self.faults.append(reason)
        self._fault_until_us = t_us + FAULT_US

    def _discard(self, t_us: int, reason: str) -> None:
        """FAULT, and a fresh estimator: one that failed is in no known state."""
        self._fail(t_us, reason)
        self._forget_estimate()

    def _forget_estimate(self) -> None:
        self._estimator = self._make_estimator()
        self._estimate = None
        self._change_us = None

    def _conditions(self, t_us: int, *, stale: bool) -> Conditions:
        settings = self.configuration.service
        if not stale:
            self._stale_us = None
        elif self._stale_us is None:
            self._stale_us = t_us
        derived = self._source == SpeedSource.DRIVEN_AXLES
        estimate = self._estimate
        silent = self._sample_us is None or t_us - self._sample_us > settings.estimate_s * 1e6
        changing = self._change_us is not None and t_us - self._change_us <= settings.change_s * 1e6
        return Conditions(
            fault=t_us < self._fault_until_us,
            stale=stale,
            no_estimate=estimate is None,
            surface_change=changing and not derived,
            low_excitation=estimate is None or not estimate.identifiable.both or derived or silent,
        )

    def _holding(self, t_us: int) -> bool:
        hold_us = self.configuration.service.hold_s * 1e6
        return self._stale_us is not None and t_us - self._stale_us < hold_us

    def _current(
        self, estimate: Estimate, status: Status, t_us: int, speed: float | None
    ) -> Outputs:
        if self._source == SpeedSource.DRIVEN_AXLES:
            estimate = replace(
                estimate,
                mu_max_std=inf,
                lambda_m_std=inf,
                identifiable=Identifiable(mu_max=False, lambda_m=False),
            )
        configuration = self.configuration
        return outputs_of(
            estimate,
            status,
            t_us,
            max(speed or 0.0, configuration.sampling.v_min),
            target_slip(
                estimate.theta,
                configuration.service.target_share,
                configuration.identifiability.slip_max,
            ),
            self._axles,
        )


def _finite(estimate: Estimate) -> bool:
    numbers = (*estimate.theta, estimate.mu_max, estimate.lambda_m)
    return all(map(isfinite, numbers)) and not any(
        map(isnan, (estimate.mu_max_std, estimate.lambda_m_std))
    )
