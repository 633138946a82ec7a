"""Recorded frames to one trace a signal, without forming samples: for work on whole recordings."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.bus.block import Block, Kind, clamped
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.offline.extract_samples import require_known
from adhesion_can.physics.readings import Role, SpeedSource
from adhesion_can.sampling.column_former import Readings
from adhesion_can.sampling.traces import Trace

Signal = tuple[Role, int]
"""A role and its axle, 0 where it has none."""
_NOTHING = (np.empty(0, dtype=np.int64), np.empty(0))


@dataclass(slots=True)
class Heard:
    """Readings of one recording by role and axle: stamps in µs, SI values or NaN.

    Attributes:
        columns: stamps and values of each signal, block after block.
        derived: vehicle speeds that were derived from the driven axles; they are left out.
        trailing: vehicle speeds that came from a trailing axle.
        backwards: frames stamped before the one in front of them, taken at that one's time.
        rejected: frames that failed their checks.

    """

    columns: dict[Signal, list[tuple[NDArray[np.int64], Array]]] = field(default_factory=dict)
    derived: int = 0
    trailing: int = 0
    backwards: int = 0
    rejected: int = 0
    _source: float = np.nan

    def take(self, readings: Readings) -> None:
        """Readings of a block."""
        sources = readings.get((Role.SPEED_SOURCE, 0), _NOTHING)
        for key, (stamps, values) in readings.items():
            told = values
            if key[0] is Role.VEHICLE_SPEED:
                source = self._sources_of(stamps, *sources)
                derived = source == SpeedSource.DRIVEN_AXLES
                self.trailing += int((source == SpeedSource.TRAILING_AXLE).sum())
                self.derived += int(derived.sum())
                told = np.where(derived, np.nan, values)
            self.columns.setdefault(key, []).append((stamps, told))
        if len(sources[1]):
            self._source = float(sources[1][-1])

    def _sources_of(
        self, stamps: NDArray[np.int64], told_us: NDArray[np.int64], told: Array
    ) -> Array:
        """Source of each vehicle speed: told with it, or last before it."""
        if np.array_equal(stamps, told_us):
            return told  # of one message; frames of one stamp keep their own
        known = np.append(self._source, told)
        return np.asarray(known[np.searchsorted(told_us, stamps, side="right")])

    def trace(self, role: Role, axle: int = 0) -> Trace:
        """What was heard of a signal; empty where nothing was."""
        parts = self.columns.get((role, axle), [_NOTHING])
        stamps, values = zip(*parts, strict=True)
        return Trace.of(np.concatenate(stamps), np.concatenate(values))

    def traces(self) -> Mapping[Signal, Trace]:
        """Every signal that was heard."""
        return {key: self.trace(*key) for key in self.columns}


def hear(blocks: Iterable[Block], config: Configuration, where: str) -> Heard:
    """Readings of all accepted frames.

    Args:
        blocks: frames; marks are passed over.
        config: what is heard.
        where: name of the recording, for errors.

    Raises:
        RecordingError: no known frame.

    """
    receiver, heard, frames, now_us = Receiver(config.messages), Heard(), 0, 0
    for block in blocks:
        own = block.select(block.kind <= Kind.ERROR)
        if not len(own):
            continue
        t_us, moved = clamped(own.t_us, now_us)
        heard.backwards += int(moved.sum())
        frames, now_us = frames + len(own), int(t_us[-1])
        heard.take(receiver.accept_block(own, t_us).readings)
    heard.rejected = receiver.rejected
    require_known(receiver, frames, where)
    return heard
