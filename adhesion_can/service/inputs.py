"""Inputs of the service, read frame by frame, and their state at a due time."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.physics.readings import Reading, Role, SpeedSource
from adhesion_can.physics.samples import Samples

REQUIRED = frozenset({Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT})
"""Roles without which no sample can be formed."""
STALE_CYCLES = 3
"""Number of cycles after which a silent required input is stale."""


class InputSnapshot(NamedTuple):
    """State of the inputs at a due time: everything stamped before it.

    Attributes:
        samples: Samples that became complete since the due time before.
        stale: Whether a required input has been silent for more than `STALE_CYCLES` cycles.
        speed: Latest vehicle speed, m/s; None where it is not available.
        rejected: Number of frames rejected since the service began.
        lost: Number of frames lost since the service began, by their counters.
        dropped: Number of wheel-speed readings that gave no sample since the last start, by reason.

    """

    samples: Samples
    stale: bool
    speed: float | None
    rejected: int
    lost: int
    dropped: Mapping[str, int]


@dataclass(slots=True)
class _MessageTimeout:
    """Supervision of a message that carries a required signal.

    Attributes:
        timeout_us: Longest silence that is not stale, µs.
        last_us: Stamp of the latest available value, µs; T0 before the first one.

    """

    timeout_us: int
    last_us: int


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
        self._timeouts: dict[tuple[Role, int], _MessageTimeout] = {}
        self._supervised: list[_MessageTimeout] = []
        self._speed: float | None = None
        self.speed_source = float(SpeedSource.UNKNOWN)
        """Latest source of the vehicle speed, a value of `SpeedSource`."""

    def start(self, t0_us: int) -> None:
        """Supervise the required messages from T0 on."""
        for message in self._configuration.messages:
            timeout = _MessageTimeout(STALE_CYCLES * (message.cycle_us or 0), t0_us)
            required = [s for s in message.signals if s.role in REQUIRED]
            self._timeouts.update({(s.role, s.axle): timeout for s in required})
            if required:
                self._supervised.append(timeout)

    def add(self, readings: Iterable[Reading]) -> None:
        """Add the readings of an accepted frame; stamps must not run backwards."""
        for reading in readings:
            role, value = reading.role, reading.value
            if value is not None and role in REQUIRED:
                self._timeouts[role, reading.axle].last_us = reading.t_us
            if role is Role.VEHICLE_SPEED:
                self._speed = value
            elif role is Role.SPEED_SOURCE and value is not None:
                self.speed_source = value
            self._former.add(reading)

    def snapshot(self, t_us: int) -> InputSnapshot:
        """State at a due time, µs; due times come in ascending order."""
        return InputSnapshot(
            samples=Samples.from_rows(self._former.collect(t_us)),
            stale=any(t_us - message.last_us > message.timeout_us for message in self._supervised),
            speed=self._speed,
            rejected=self._receiver.rejected,
            lost=self._receiver.lost,
            dropped=self._former.dropped,
        )
