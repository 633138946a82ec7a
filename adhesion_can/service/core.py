"""The service without a bus, a clock or a file: frames in, frames out.

`feed` processes a frame, `advance` brings the core to a time; both return the frames that were due.
The same sequence of both gives the same bytes, live and in replay.

A message that is due at t carries what was stamped before t; a frame stamped t comes after it. At
each due time the parts work one after the other:

    FrameInputs -> InputSnapshot -> EstimationLoop -> Estimate
    -> StatusMachine -> Status -> OutputBuilder -> Outputs -> OutputMessages -> frames
"""

from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass
from functools import partial

from adhesion_can.bus.frame import Frame
from adhesion_can.bus.j1939 import IdFilter
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.rejection import Rejection
from adhesion_can.config import Configuration
from adhesion_can.estimation.estimator import Estimator
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.readings import SpeedSource
from adhesion_can.physics.samples import NO_SAMPLES, Samples
from adhesion_can.sampling.column_former import Readings, in_columns
from adhesion_can.service.early_start import NEAR_US, EarlyStart
from adhesion_can.service.estimation_loop import EstimationLoop, EstimatorFailure
from adhesion_can.service.inputs import FrameInputs, InputSnapshot
from adhesion_can.service.output_messages import SETPOINT, Health, OutputMessages
from adhesion_can.service.outputs import OutputBuilder, Outputs
from adhesion_can.service.schedule import Schedule
from adhesion_can.service.states import StatusMachine, UsableLimits


@dataclass(slots=True)
class Counts:
    """Numbers of events besides accepted and rejected frames.

    Attributes:
        clamped: Number of frames stamped before the present time, and moved to it.
        foreign: Number of frames whose id belongs to no input message.
        restarts: Number of holes in time after which the service started again.
        samples: Number of samples formed.
        receive_drops: Number of frames that a live bus lost; set by the loop that runs the core.

    """

    clamped: int = 0
    foreign: int = 0
    restarts: int = 0
    samples: int = 0
    receive_drops: int = 0


class ServiceCore:
    """Identifies the adhesion curve from input frames and answers with setpoint frames.

    Args:
        configuration: Database, roles, vehicle and settings.
        estimator: Maker of a fresh estimator; None makes the configured one.
        on_setpoint: Callback with due time (µs) and outputs of each setpoint message.
        on_samples: Callback with the samples of each due time that has any.
        on_readings: Callback with the readings of accepted frames, in the order of their stamps.

    Raises:
        ConfigError: The roles do not suffice to estimate adhesion, or an id is used twice.
        DatabaseError: The user's output messages lack a signal or a cycle.

    """

    def __init__(
        self,
        configuration: Configuration,
        estimator: Callable[[], Estimator] | None = None,
        on_setpoint: Callable[[int, Outputs], None] | None = None,
        on_samples: Callable[[Samples], None] | None = None,
        on_readings: Callable[[Readings], None] | None = None,
    ) -> None:
        configuration.require_service()
        self.configuration = configuration
        self.receiver = Receiver(configuration.messages)
        self.messages = OutputMessages(configuration.database, configuration.messages)
        self.schedule = Schedule(self.messages.cycles_us)
        self.counts = Counts()
        self.faults: list[str] = []
        """Reasons for FAULT, oldest first, without immediate repetitions."""
        self.outputs = Outputs()
        """Outputs of the latest due time."""
        self.loop_time_p99_us: float | None = None
        """99 % quantile of the time to handle a frame, µs; set by the loop that runs the core."""
        self.speed_derived = False
        """Whether the vehicle speed is derived from the driven axles."""
        self._inputs = FrameInputs(configuration, self.receiver)
        self._estimation = EstimationLoop(estimator or configuration.make_estimator)
        self._early = EarlyStart()
        estimators = configuration.estimators
        self._status = StatusMachine(
            configuration.service,
            UsableLimits(estimators.identifiability.slip_max, estimators.plausibility.largest_mu),
        )
        self._builder = OutputBuilder(configuration)
        self._on_setpoint = on_setpoint
        self._on_samples = on_samples
        self.on_readings = on_readings
        self._dropped: Mapping[str, int] = {}
        self._ready: Frame | None = None
        """Setpoint of the next due time, if nothing else comes before it."""
        self._now_us = 0
        self._has_begun = False
        """Whether anything was ever sent."""
        self._stopped_us: int | None = None
        """Time of the stop, µs; None where it was not stopped, or has started again."""

    def feed(self, frame: Frame) -> list[Frame]:
        """Process one frame; returns the frames due at or before its stamp.

        A frame stamped before the present time is clamped to it and counted.
        """
        if frame.t_us < self._now_us:
            self.counts.clamped += 1
            frame = frame._replace(t_us=self._now_us)
        frames = self.advance(frame.t_us)
        outcome = self.receiver.accept(frame)
        if outcome is None:
            self.counts.foreign += 1
        elif not isinstance(outcome, Rejection):
            if not self.schedule.started:
                self.start(frame.t_us)
                self._inputs.start(frame.t_us)
                frames += self.emit(frame.t_us, self._inputs.snapshot)
            if self.on_readings is not None:
                self.on_readings(in_columns(outcome))
            self._inputs.add(outcome)
            self.use_speed_source(self._inputs.speed_source)
        return frames

    def advance(self, t_us: int) -> list[Frame]:
        """Bring the core to a time, µs; returns the frames due at or before it.

        A time before the present one changes nothing. A hole longer than the configured restart
        time is not filled with messages: the service starts again with the next input.
        """
        return list(self.due_frames(t_us))

    def due_frames(self, t_us: int) -> Iterator[Frame]:
        """Frames of `advance` one by one, each composed when it is asked for; ask for all of them.

        So the first one, the setpoint of all axles, is on the bus before the others are composed;
        where it was composed ahead and nothing came since, before anything is computed.
        """
        if t_us < self._now_us:
            return
        if t_us - self._now_us > self.restart_us:
            self.restart()
        ready = self._take_ready(t_us)
        if ready is not None:
            yield ready
        for frame in self._emit(t_us, self._inputs.snapshot):
            if frame is not ready:
                yield frame

    def work_ahead(self) -> bool:
        """Do work of the next due time before it, for a caller that has nothing to do.

        What is sent does not depend on it, but goes out sooner: where no message is expected any
        more before the due time, the estimate is brought to it.

        Returns:
            Whether there was such work.

        """
        t_us = self.schedule.next_due_us
        if t_us is None or not self.has_work_ahead:
            return False
        samples = self._inputs.collect_ahead(t_us)
        if not self._estimation.is_prepared(samples, t_us):
            self._early.repeat()
            if self._inputs.next_expected_us < t_us:
                self._early.begin(t_us)
            self._estimation.prepare(samples, t_us)
        self._ready = self._compose_ahead(t_us, samples)
        return self._estimation.can_prepare

    def _compose_ahead(self, t_us: int, samples: Samples) -> Frame | None:
        """Setpoint of the next due time, µs, if nothing else comes before it; None: not known."""
        estimate = self._estimation.prepared
        if estimate is None:
            return None
        derived = self.speed_derived
        status = copy(self._status).advance(
            t_us,
            samples,
            estimate,
            is_new=estimate is not self.estimate,
            stale=self._inputs.is_stale(t_us),
            speed_derived=derived,
        )
        outputs = self._builder.prepare(
            status, t_us, estimate, self._inputs.speed, speed_derived=derived
        )
        if outputs is None or not self.schedule.is_due(SETPOINT, t_us):
            return None
        return self.messages.prepare(t_us, outputs)

    def _take_ready(self, t_us: int) -> Frame | None:
        """The setpoint that was composed ahead, where it is due at a time, µs, and nothing came."""
        ready = self._ready
        if ready is None or ready.t_us > t_us:
            return None
        self._ready = None
        holds = ready.t_us == self.schedule.next_due_us and self._inputs.is_collected(ready.t_us)
        return ready if holds else None

    @property
    def has_work_ahead(self) -> bool:
        """Whether `work_ahead` has something to do."""
        t_us = self.schedule.next_due_us
        if t_us is None or not self._estimation.can_prepare or self._inputs.is_collected(t_us):
            return False
        expected_us = self._inputs.next_expected_us
        return expected_us >= t_us or (expected_us >= t_us - NEAR_US and self._early.allows(t_us))

    def stop(self, t_us: int) -> list[Frame]:
        """Bring the core to a time, µs, and take back what was sent; returns the frames.

        The last frame of every message says 'not available', with status INIT. Nothing is due until
        the next input, with which the service starts again. Another stop at the same time says it
        once more; a core that has sent nothing since has nothing to take back.
        """
        frames = self.advance(t_us)
        is_silent = self._stopped_us is not None and self._stopped_us != self._now_us
        if is_silent or not self._has_begun:
            return frames
        self.outputs = Outputs()
        health = partial(self._health, lambda: (self.receiver.rejected, self.receiver.lost))
        for name in self.messages.cycles_us:
            frames += self.messages.compose(name, self._now_us, self.outputs, health)
        # The last estimate can still be asked for.
        self.schedule.stop()
        self._stopped_us = self._now_us
        return frames

    def start(self, t0_us: int) -> None:
        """Start to send, with the first accepted input at T0, µs; after a stop, again."""
        if self._stopped_us is not None:
            self._forget()
            self._stopped_us = None
        self._has_begun = True
        self.schedule.start(t0_us)

    def second_sender(self, t_us: int) -> None:
        """Report that another service sends the output messages: FAULT as long as it does."""
        self._add_fault(max(t_us, self._now_us), "another sender of our messages on the bus")

    @property
    def now_us(self) -> int:
        """Time to which the core has been brought, µs."""
        return self._now_us

    @property
    def ids(self) -> list[IdFilter]:
        """Filters of all input and output messages."""
        return [*self.receiver.ids, *(IdFilter.exact(*frame_id) for frame_id in self.messages.ids)]

    @property
    def next_due_us(self) -> int | None:
        """Time at which the next message is due, µs; None before the first accepted input."""
        return self.schedule.next_due_us

    @property
    def estimate(self) -> Estimate | None:
        """Latest estimate of the curve; None where there is none."""
        return self._estimation.estimate

    @property
    def dropped_samples(self) -> dict[str, int]:
        """Number of wheel-speed readings that gave no sample, by reason."""
        return dict(self._dropped)

    @property
    def left_out_samples(self) -> dict[str, int]:
        """Number of samples to which the extended model could not be applied, by reason."""
        return self._estimation.left_out

    @property
    def restart_us(self) -> float:
        """Longest hole in time that is filled with messages, µs."""
        return self.configuration.service.restart_s * 1e6

    def restart(self) -> None:
        """Start again after a hole in time; a core that has had no input yet stays as it is."""
        if not self.schedule.started:
            return
        self.counts.restarts += 1
        self.schedule.stop()
        self._forget()

    def _forget(self) -> None:
        """Forget all inputs and estimates."""
        self._inputs.restart()
        self._estimation.discard()
        self._status.restart()
        self._builder.restart()
        self._dropped = {}
        self.speed_derived = False

    def use_speed_source(self, source: float) -> None:
        """Set the source of the vehicle speed, a value of `SpeedSource`."""
        derived = source == SpeedSource.DRIVEN_AXLES
        if derived is not self.speed_derived:
            # Slips from one kind of speed are no evidence about those from the other.
            self._discard_estimate()
        self.speed_derived = derived

    def emit(self, until_us: int, snapshot: Callable[[int], InputSnapshot]) -> list[Frame]:
        """Go from due time to due time up to a time (inclusive), and bring the core to it.

        Args:
            until_us: Time up to which messages are sent, µs.
            snapshot: State of the inputs at a due time, which is given in µs.

        Returns:
            Frames in the order of their due times, ascending id on ties.

        """
        return list(self._emit(until_us, snapshot))

    def _emit(self, until_us: int, snapshot: Callable[[int], InputSnapshot]) -> Iterator[Frame]:
        while (t_us := self.schedule.next_due_us) is not None and t_us <= until_us:
            inputs = snapshot(t_us)
            self._update(t_us, inputs)
            health = partial(self._health, inputs.totals)
            for name in self.schedule.pop_due(t_us):
                yield from self.messages.compose(name, t_us, self.outputs, health)
                if name == SETPOINT and self._on_setpoint:
                    self._on_setpoint(t_us, self.outputs)
        self._now_us = until_us

    def _health(self, totals: Callable[[], tuple[int, int]]) -> Health:
        rejected, lost = totals()
        return Health(rejected, lost + self.counts.receive_drops, self.loop_time_p99_us)

    def _update(self, t_us: int, inputs: InputSnapshot) -> None:
        """Bring estimate, status and outputs to a due time."""
        self._dropped = inputs.dropped
        is_new = self._update_estimate(t_us, inputs.samples)
        derived = self.speed_derived
        status = self._status.advance(
            t_us,
            inputs.samples,
            self.estimate,
            is_new=is_new,
            stale=inputs.stale,
            speed_derived=derived,
        )
        self.outputs = self._builder.build(
            status,
            t_us,
            self.estimate,
            inputs.speed,
            speed_derived=derived,
            may_hold=self._status.may_hold(t_us),
        )

    def _update_estimate(self, t_us: int, samples: Samples) -> bool:
        """Bring the estimate to a due time; returns whether it is another one than before."""
        replaces = self._estimation.replaced_samples is not None
        if not replaces:
            self._take_samples(samples)
        try:
            is_new = self._estimation.update(samples, t_us)
            self._early.end(t_us, served=self._estimation.was_prepared)
        except EstimatorFailure as failure:
            self._add_fault(t_us, str(failure))
            self._discard_estimate()
            return False
        if replaces:
            self._take_samples(self._estimation.replaced_samples or NO_SAMPLES)
        return is_new

    def _take_samples(self, samples: Samples) -> None:
        if len(samples):
            self.counts.samples += len(samples)
            if self._on_samples:
                self._on_samples(samples)

    def _add_fault(self, t_us: int, reason: str) -> None:
        self._ready = None
        if not self.faults or self.faults[-1] != reason:
            self.faults.append(reason)
        self._status.add_fault(t_us)

    def _discard_estimate(self) -> None:
        self._estimation.discard()
        self._status.discard_estimate()
