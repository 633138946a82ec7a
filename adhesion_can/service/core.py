"""The service without a bus, a clock or a file: frames in, frames out.

`feed` takes a frame, `advance` says what time it is; both return the frames that were due. The
same sequence of both gives the same bytes, live and in replay.

A message is due at T0 + k · cycle, k = 0, 1, .., with T0 the stamp of the first accepted input. It
carries what was stamped before its due time: a frame stamped at it comes after it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, isfinite, isnan

from adhesion_can.bus.e2e import Rejection
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.identification.estimator import Estimator
from adhesion_can.identification.extended import ExtendedEstimator
from adhesion_can.physics.data import (
    CHANGED,
    Estimate,
    Identifiable,
    Reading,
    Role,
    Samples,
    SpeedSource,
)
from adhesion_can.service.outputs import Health, OutputMessages, Outputs, outputs_of, target_slip
from adhesion_can.service.states import VALUES, Conditions, Status, Values, status_of

REQUIRED = frozenset({Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT})
SETPOINT = "AdhesionSetpoint"
STALE_CYCLES = 3
FAULT_US = 1_000_000
"""FAULT is shown at least this long, so that nobody misses it."""


@dataclass(slots=True)
class _Input:
    """Whether a required message still speaks."""

    timeout_us: int
    heard_us: int


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


class ServiceCore:
    """Identifies the adhesion curve from frames and says it in frames.

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
        self._due: dict[str, int] = {}
        self._fault_until_us = -1
        self._begin()

    def _begin(self) -> None:
        """State of a service that has heard nothing yet."""
        configuration = self.configuration
        self._due = {}
        self._estimator = self._make_estimator()
        self._estimate: Estimate | None = None
        self._former = configuration.make_former()
        self._inputs: dict[tuple[Role, int], _Input] = {}
        self._watches: list[_Input] = []
        self._speed: float | None = None
        self._source = float(SpeedSource.UNKNOWN)
        self._sample_us: int | None = None
        self._change_us: int | None = None
        self._stale_us: int | None = None
        self._last_values: Outputs | None = None

    @property
    def now_us(self) -> int:
        """Time that the core has been brought to."""
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
    def dropped_samples(self) -> dict[str, int]:
        """Wheel-speed readings that gave no sample, by reason."""
        return dict(self._former.dropped)

    @property
    def left_out_samples(self) -> dict[str, int]:
        """Samples that the extended model could not be applied to, by reason."""
        estimator = self._estimator
        return dict(estimator.left_out) if isinstance(estimator, ExtendedEstimator) else {}

    def feed(self, frame: Frame) -> list[Frame]:
        """Take one frame; returns what was due at or before its stamp.

        A frame stamped before the present time is clamped to it and counted.
        """
        if frame.t_us < self._now_us:
            self.counts.clamped += 1
            frame = frame._replace(t_us=self._now_us)
        due = self.advance(frame.t_us)
        outcome = self.receiver.accept(frame)
        if outcome is None:
            self.counts.foreign += 1
        elif not isinstance(outcome, Rejection):
            if not self._due:
                self._start(frame.t_us)
                due += self._emit(frame.t_us)
            for reading in outcome:
                self._take(reading)
        return due

    def advance(self, t_us: int) -> list[Frame]:
        """Bring the core to a time; returns what was due at or before it.

        A time before the present one changes nothing. A hole longer than the configured restart
        time is not filled with messages: the service starts anew with the next input.
        """
        if t_us < self._now_us:
            return []
        hole_us = t_us - self._now_us
        if self._due and hole_us > self.configuration.service.restart_s * 1e6:
            self.counts.restarts += 1
            self._begin()
        frames = self._emit(t_us)
        self._now_us = t_us
        return frames

    def second_sender(self, t_us: int) -> None:
        """Another service sends our messages on this bus: FAULT as long as it does."""
        t_us = max(t_us, self._now_us)
        self._fail(t_us, "another sender of our messages on the bus")

    def _start(self, t0_us: int) -> None:
        self._due = dict.fromkeys(self._cycles, t0_us)
        for message in self.configuration.messages:
            timeout = STALE_CYCLES * (message.cycle_us or 0)
            watch = _Input(timeout, t0_us)
            for signal in message.signals:
                if signal.role in REQUIRED:
                    self._inputs[signal.role, signal.axle] = watch
        self._watches = list({id(watch): watch for watch in self._inputs.values()}.values())

    def _take(self, reading: Reading) -> None:
        if reading.value is not None and reading.role in REQUIRED:
            self._inputs[reading.role, reading.axle].heard_us = reading.t_us
        if reading.role is Role.VEHICLE_SPEED:
            self._speed = reading.value
        elif reading.role is Role.SPEED_SOURCE and reading.value is not None:
            self._set_source(reading.value)
        self._former.add(reading)

    def _set_source(self, source: float) -> None:
        derived = float(SpeedSource.DRIVEN_AXLES)
        if (source == derived) is not (self._source == derived):
            # Slips from one kind of speed say nothing about those from the other.
            self._forget_estimate()
        self._source = source

    def _emit(self, until_us: int) -> list[Frame]:
        frames: list[Frame] = []
        while self._due and (t_us := min(self._due.values())) <= until_us:
            self._refresh(t_us)
            health = Health(
                self.receiver.rejected,
                self.receiver.lost + self.counts.receive_drops,
                self.loop_time_p99_us,
            )
            for name, due_us in self._due.items():
                if due_us == t_us:
                    frames += self.messages.compose(name, t_us, self.outputs, health)
                    self._due[name] = t_us + self._cycles[name]
                    if name == SETPOINT and self._on_setpoint:
                        self._on_setpoint(t_us, self.outputs)
        return frames

    def _refresh(self, t_us: int) -> None:
        """Bring estimate and outputs to a due time."""
        self._update(t_us)
        status = status_of(self._conditions(t_us))
        choice = VALUES[status]
        if choice is Values.CURRENT and self._estimate is not None:
            self.outputs = self._last_values = self._current(self._estimate, status, t_us)
        elif choice is Values.HELD and self._last_values and self._holding(t_us):
            self.outputs = replace(self._last_values, status=status)
        else:
            self.outputs = Outputs(status)

    def _update(self, t_us: int) -> None:
        samples = self._former.collect(t_us)
        columns = Samples.of(samples)
        if samples:
            self._sample_us = samples[-1].t_us
            self.counts.samples += len(samples)
            if self._on_samples:
                self._on_samples(columns)
        try:
            estimate = self._estimator.update(columns, t_us)
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

    def _conditions(self, t_us: int) -> Conditions:
        settings = self.configuration.service
        stale = any(t_us - watch.heard_us > watch.timeout_us for watch in self._watches)
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

    def _current(self, estimate: Estimate, status: Status, t_us: int) -> Outputs:
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
            max(self._speed or 0.0, configuration.sampling.v_min),
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
