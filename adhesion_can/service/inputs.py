"""Inputs of the service, read frame by frame, and their state at a due time."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.physics.readings import REQUIRED, Reading, Role, SpeedSource
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.former import SampleFormer
from adhesion_can.sampling.rim_speed import REFERENCE_AXLE

OVERDUE_CYCLES = 1.5
"""Number of cycles after which a message is not waited for, by the stamps of the others."""
STALE_CYCLES = 3
"""Number of cycles after which a silent required input is stale."""


class InputSnapshot(NamedTuple):
    """State of the inputs at a due time: everything stamped before it.

    Attributes:
        samples: Samples that became complete since the due time before.
        stale: Whether a required input has been silent for more than `STALE_CYCLES` cycles.
        speed: Latest vehicle speed, m/s; None where it is not available.
        totals: Function that counts the frames rejected and, by their counters, lost since the
            service began; few messages carry it.
        dropped: Number of wheel-speed readings that gave no sample since the last start, by reason.

    """

    samples: Samples
    stale: bool
    speed: float | None
    totals: Callable[[], tuple[int, int]]
    dropped: Mapping[str, int]


@dataclass(slots=True)
class _MessageTimeout:
    """Supervision of a message.

    Attributes:
        cycle_us: Cycle of the message, µs; 0 where it is unknown.
        last_us: Stamp of the latest available value of a required signal, µs; T0 before the first.
        seen_us: Stamp of the latest frame, µs; T0 before the first.

    """

    cycle_us: int
    last_us: int
    seen_us: int


class _Ahead(NamedTuple):
    """Samples collected ahead of a due time.

    Attributes:
        t_us: Due time, µs.
        former: Former that has collected them.
        samples: The samples.
        is_current: Whether no reading came since.

    """

    t_us: int
    former: SampleFormer
    samples: Samples
    is_current: bool = True

    def after(self, readings: Iterable[Reading]) -> "_Ahead | None":
        """The same after further readings, which its former gets; None where it cannot help."""
        if self.former.gave_up:
            return None
        for reading in readings:
            if not self.former.is_continued_by(reading):
                return None
            self.former.add(reading)
        return self._replace(is_current=False)

    def brought_up_to_date(self) -> "_Ahead | None":
        """The same where the readings since then complete no sample; else None."""
        if self.is_current:
            return self
        if not self.former.waits(self.t_us) and len(self.former.collect(self.t_us)):
            return None
        return self._replace(is_current=True)


class FrameInputs:
    """Inputs of the service, reading after reading.

    Args:
        configuration: Roles, messages and settings of the sampling.
        receiver: Receiver that accepted the readings, for its numbers of rejected and lost frames.

    """

    def __init__(self, configuration: Configuration, receiver: Receiver) -> None:
        self._configuration = configuration
        self._receiver = receiver
        self.restart()

    def restart(self) -> None:
        """Forget all readings."""
        self._former = self._configuration.make_former()
        self._rim_speed = self._configuration.make_rim_speed()
        self._timeouts: dict[tuple[Role, int], _MessageTimeout] = {}
        self._messages: list[_MessageTimeout] = []
        self._supervised: list[_MessageTimeout] = []
        """Those of `_messages` that carry a required signal."""
        self._ahead: _Ahead | None = None
        self._replaced: SampleFormer | None = None
        self.speed: float | None = None
        """Latest vehicle speed, m/s; None where it is not available."""
        self.speed_source = float(SpeedSource.UNKNOWN)
        """Latest source of the vehicle speed, a value of `SpeedSource`."""

    def start(self, t0_us: int) -> None:
        """Supervise the required messages from T0 on."""
        for message in self._configuration.messages:
            timeout = _MessageTimeout(message.cycle_us or 0, t0_us, t0_us)
            self._timeouts.update({(s.role, s.axle): timeout for s in message.signals})
            self._messages.append(timeout)
            if any(s.role in REQUIRED for s in message.signals):
                self._supervised.append(timeout)
        if self._rim_speed is not None:
            self._timeouts[Role.VEHICLE_SPEED, 0] = self._timeouts[Role.WHEEL_SPEED, REFERENCE_AXLE]

    def add(self, readings: Iterable[Reading]) -> None:
        """Add the readings of an accepted frame; stamps must not run backwards."""
        if self._rim_speed is not None:
            readings = self._rim_speed.add_to(readings)
        if self._ahead is not None:
            readings = list(readings)
            self._ahead = self._ahead.after(readings)
        for reading in readings:
            role, value = reading.role, reading.value
            message = self._timeouts[role, reading.axle]
            message.seen_us = reading.t_us
            if value is not None and role in REQUIRED:
                message.last_us = reading.t_us
            if role is Role.VEHICLE_SPEED and self._rim_speed is None:
                self.speed = value
            elif role is Role.SPEED_SOURCE and value is not None:
                self.speed_source = value
            self._former.add(reading)

    def snapshot(self, t_us: int) -> InputSnapshot:
        """State at a due time, µs; due times come in ascending order."""
        ahead = self._find_ahead(t_us)
        if ahead is not None:
            # Taking the old one apart takes a while: that is left to the next idle time.
            self._replaced = self._former
            self._former, samples = ahead.former, ahead.samples
        else:
            samples = self._former.collect(t_us)
        self._ahead = None
        return InputSnapshot(
            samples=samples,
            stale=self.is_stale(t_us),
            speed=self.speed,
            totals=self._count_frames,
            dropped=self._former.dropped,
        )

    def is_stale(self, t_us: int) -> bool:
        """Whether a required input is silent for over `STALE_CYCLES` cycles at a time, µs."""
        return any(
            t_us - timeout.last_us > STALE_CYCLES * timeout.cycle_us for timeout in self._supervised
        )

    def _count_frames(self) -> tuple[int, int]:
        return self._receiver.rejected, self._receiver.lost

    @property
    def next_expected_us(self) -> float:
        """Stamp of the next message that is expected, µs; one that is overdue is not."""
        latest_us = max([message.seen_us for message in self._messages], default=0)
        next_us = inf
        # A loop, since it runs after every frame.
        for message in self._messages:
            expected_us = message.seen_us + message.cycle_us
            overdue_us = latest_us - message.seen_us
            if expected_us < next_us and overdue_us < OVERDUE_CYCLES * message.cycle_us:
                next_us = expected_us
        return next_us

    def is_collected(self, t_us: int) -> bool:
        """Whether the samples of a due time, µs, are collected, and nothing came since."""
        ahead = self._ahead
        return ahead is not None and ahead.t_us == t_us and ahead.is_current

    def _find_ahead(self, t_us: int) -> _Ahead | None:
        """What was collected ahead for a due time, µs, where it holds."""
        ahead = self._ahead
        return ahead.brought_up_to_date() if ahead is not None and ahead.t_us == t_us else None

    def collect_ahead(self, t_us: int) -> Samples:
        """Samples of a due time, µs, if nothing else comes before it.

        Then `snapshot` gives the same object; after another reading it collects again.
        """
        ahead = self._find_ahead(t_us)
        if ahead is None:
            self._replaced = None
            former = self._former.copy()
            ahead = _Ahead(t_us, former, former.collect(t_us))
        self._ahead = ahead
        return ahead.samples
