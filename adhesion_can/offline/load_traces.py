"""Traces of a recording: the readings of each signal over its whole time, without samples."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.bus.block import Block, Kind, clamped
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.offline.recording_fit import SeenIds, require_fit
from adhesion_can.offline.stamps import in_seconds
from adhesion_can.physics.readings import REQUIRED, Role, SpeedSource
from adhesion_can.sampling.column_former import Readings
from adhesion_can.sampling.traces import Trace

Signal = tuple[Role, int]
"""A role and its axle number, 0 for roles without axle."""
_NO_READINGS = (np.empty(0, dtype=np.int64), np.empty(0))


@dataclass(slots=True)
class LoadedTraces:
    """Readings of one recording by role and axle, with what was wrong with its frames.

    Attributes:
        columns: Stamps, µs, and SI values (NaN: not available) of each signal, block after block.
        derived: Number of vehicle speeds derived from the driven axles; they are left out.
        trailing: Number of vehicle speeds measured at a trailing axle.
        backwards: Number of frames stamped before the one in front of them, moved to its stamp.
        rejected: Number of frames that failed their checks.
        stuck: Sentences about messages of which readings were left out, since they were stuck.

    """

    columns: dict[Signal, list[tuple[NDArray[np.int64], Array]]] = field(default_factory=dict)
    derived: int = 0
    trailing: int = 0
    backwards: int = 0
    rejected: int = 0
    stuck: list[str] = field(default_factory=list)
    _source: float = np.nan

    def add(self, readings: Readings) -> None:
        """Add the readings of a block."""
        sources = readings.get((Role.SPEED_SOURCE, 0), _NO_READINGS)
        for key, (stamps, values) in readings.items():
            usable = values
            if key[0] is Role.VEHICLE_SPEED:
                source = self._find_sources(stamps, *sources)
                derived = source == SpeedSource.DRIVEN_AXLES
                self.trailing += int((source == SpeedSource.TRAILING_AXLE).sum())
                self.derived += int(derived.sum())
                usable = np.where(derived, np.nan, values)
            self.columns.setdefault(key, []).append((stamps, usable))
        if len(sources[1]):
            self._source = float(sources[1][-1])

    def _find_sources(
        self, stamps: NDArray[np.int64], source_us: NDArray[np.int64], sources: Array
    ) -> Array:
        """Source of each vehicle speed: of the same frame, or the latest one before it."""
        if np.array_equal(stamps, source_us):
            return sources  # of one message; frames of one stamp keep their own
        known = np.append(self._source, sources)
        return np.asarray(known[np.searchsorted(source_us, stamps, side="right")])

    def trace(self, role: Role, axle: int = 0) -> Trace:
        """Trace of a signal; empty where the recording has no reading of it."""
        parts = self.columns.get((role, axle), [_NO_READINGS])
        stamps, values = zip(*parts, strict=True)
        return Trace.from_readings(np.concatenate(stamps), np.concatenate(values))

    def traces(self) -> Mapping[Signal, Trace]:
        """Traces of all signals that the recording has readings of."""
        return {key: self.trace(*key) for key in self.columns}


def load_traces(
    blocks: Iterable[Block],
    config: Configuration,
    where: str,
    needed: Collection[Role] = REQUIRED,
    *,
    partly: bool = False,
) -> LoadedTraces:
    """Load the readings of all accepted frames.

    Args:
        blocks: Frames of the recording; marks are ignored.
        config: Messages and roles to receive.
        where: Name of the recording, for errors.
        needed: Roles without whose readings the recording is not one of the configured bus.
        partly: Whether it may lack some of them, unless it is of another bus.

    Raises:
        RecordingError: The recording is not one of the configured bus.

    """
    receiver, loaded, frames, now_us = Receiver(config.messages), LoadedTraces(), 0, 0
    seen = SeenIds()
    for block in in_seconds(blocks, config.messages, where):
        frame_block = block.select(block.kind <= Kind.ERROR)
        if not len(frame_block):
            continue
        seen.add(frame_block)
        t_us, moved = clamped(frame_block.t_us, now_us)
        loaded.backwards += int(moved.sum())
        frames, now_us = frames + len(frame_block), int(t_us[-1])
        loaded.add(receiver.accept_block(frame_block, t_us).readings)
    loaded.rejected = receiver.rejected
    loaded.stuck = receiver.stuck_sentences
    require_fit(receiver, frames, seen, config, where, needed=needed, partly=partly)
    return loaded
