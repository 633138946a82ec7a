"""The service without a bus, a clock or a file: frames in, frames out.

`feed` takes a frame, `advance` says what time it is; both return the frames that were due. The
same sequence of both gives the same bytes, live and in replay.
"""

from dataclasses import dataclass

from adhesion_can.bus.e2e import Rejection
from adhesion_can.bus.frame import Frame
from adhesion_can.physics.readings import Reading, Role
from adhesion_can.physics.samples import Samples
from adhesion_can.service.speaker import REQUIRED, STALE_CYCLES, Moment, Speaker


@dataclass(slots=True)
class _Input:
    """Whether a required message still speaks."""

    timeout_us: int
    heard_us: int


class ServiceCore(Speaker):
    """The service that takes its inputs frame by frame, as a bus gives them."""

    def _begin(self) -> None:
        super()._begin()
        self._former = self.configuration.make_former()
        self._inputs: dict[tuple[Role, int], _Input] = {}
        self._watches: list[_Input] = []
        self._speed: float | None = None

    @property
    def dropped_samples(self) -> dict[str, int]:
        """Wheel-speed readings that gave no sample, by reason."""
        return dict(self._former.dropped)

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
        if self._due and t_us - self._now_us > self._restart_us:
            self.counts.restarts += 1
            self._begin()
        frames = self._emit(t_us)
        self._now_us = t_us
        return frames

    def second_sender(self, t_us: int) -> None:
        """Another service sends our messages on this bus: FAULT as long as it does."""
        self._second_sender(max(t_us, self._now_us))

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

    def _moment(self, t_us: int) -> Moment:
        return Moment(
            samples=Samples.of(self._former.collect(t_us)),
            stale=any(t_us - watch.heard_us > watch.timeout_us for watch in self._watches),
            speed=self._speed,
            rejected=self.receiver.rejected,
            lost=self.receiver.lost,
        )
