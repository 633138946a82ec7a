"""Recorded frames to one trace a signal, without forming samples: for work on whole recordings."""

from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.identification.traces import Trace
from adhesion_can.physics.data import Reading, Role, SpeedSource
from adhesion_can.service.extract import require_known

Signal = tuple[Role, int]
"""A role and its axle, 0 where it has none."""


@dataclass(slots=True)
class Heard:
    """Readings of one recording by role and axle: stamps in µs, SI values or NaN.

    Attributes:
        columns: stamps and values of each signal.
        derived: vehicle speeds that were derived from the driven axles; they are left out.
        trailing: vehicle speeds that came from a trailing axle.
        backwards: frames stamped before the one in front of them, taken at that one's time.
        rejected: frames that failed their checks.

    """

    columns: dict[Signal, tuple["array[int]", "array[float]"]] = field(default_factory=dict)
    derived: int = 0
    trailing: int = 0
    backwards: int = 0
    rejected: int = 0
    _source: float | None = None

    def take(self, readings: Iterable[Reading]) -> None:
        """Readings of one frame."""
        rows = list(readings)
        for reading in rows:
            if reading.role is Role.SPEED_SOURCE:
                self._source = reading.value
        for reading in rows:
            value = np.nan if reading.value is None else reading.value
            if reading.role is Role.VEHICLE_SPEED:
                self.trailing += self._source == SpeedSource.TRAILING_AXLE
                if self._source == SpeedSource.DRIVEN_AXLES:
                    self.derived += 1
                    value = np.nan
            key = reading.role, reading.axle
            stamps, values = self.columns.setdefault(key, (array("q"), array("d")))
            stamps.append(reading.t_us)
            values.append(value)

    def trace(self, role: Role, axle: int = 0) -> Trace:
        """What was heard of a signal; empty where nothing was."""
        return _trace(*self.columns.get((role, axle), ((), ())))

    def traces(self) -> Mapping[Signal, Trace]:
        """Every signal that was heard."""
        return {key: _trace(*columns) for key, columns in self.columns.items()}


def _trace(t_us: Sequence[int], values: Sequence[float]) -> Trace:
    return Trace.of(np.array(t_us, dtype=np.int64), np.array(values, dtype=np.float64))


def hear(items: Iterable[Frame | Mark], config: Configuration, where: str) -> Heard:
    """Readings of all accepted frames.

    Args:
        items: frames; marks are passed over.
        config: what is heard.
        where: name of the recording, for errors.

    Raises:
        RecordingError: no known frame.

    """
    receiver, heard, frames, now = Receiver(config.messages), Heard(), 0, 0
    for item in items:
        if not isinstance(item, Frame):
            continue
        frames += 1
        heard.backwards += item.t_us < now
        now = max(now, item.t_us)
        outcome = receiver.accept(item._replace(t_us=now))
        if isinstance(outcome, list):
            heard.take(outcome)
    heard.rejected = receiver.rejected
    require_known(receiver, frames, where)
    return heard
