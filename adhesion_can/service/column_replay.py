"""Blocks of recorded frames through a core: the same bytes as `ServiceCore.feed`, much sooner.

An optimisation of the reference path in `core`. Whether a frame is accepted and which samples it
completes depends on the frames alone; so a block is received and turned into samples at once, and
the state of the inputs at each due time is looked up by stamps. Only what depends on the estimate
is computed due time by due time, by the core's own `emit`.
"""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block, Kind, clamped
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver_columns import ReceivedBlock
from adhesion_can.config import Configuration
from adhesion_can.physics.readings import REQUIRED, Role, SpeedSource
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.inputs import STALE_CYCLES, InputSnapshot

Stamps = NDArray[np.int64]
_NO_READINGS = (np.empty(0, dtype=np.int64), np.empty(0))


class ColumnReplay:
    """Runs blocks of recorded frames through a core.

    Args:
        core: Fresh core; no other caller may feed it.

    """

    def __init__(self, core: ServiceCore) -> None:
        self._core = core
        self._inputs = ColumnInputs(core.configuration)

    def process(self, block: Block) -> list[Frame]:
        """Process a block; returns the frames due at or before its last stamp.

        Rows stamped before the present time, that of the rows before them, are clamped to it and
        counted. After a hole longer than the configured restart time the service starts again, and
        after a mark that it was stopped.
        """
        if not len(block):
            return []
        core = self._core
        now_us = core.now_us
        # A second sender's mark bears the stamp of its frame; it does not move the time.
        stamps = np.where(block.kind == Kind.SECOND_SENDER, now_us, block.t_us)
        t_us, moved = clamped(stamps, now_us)
        core.counts.clamped += int((moved & (block.kind <= Kind.ERROR)).sum())
        frames: list[Frame] = []
        holes = np.flatnonzero(np.diff(t_us, prepend=now_us) > core.restart_us).tolist()
        stops = np.flatnonzero(block.kind == Kind.STOP).tolist()
        cuts = {0, *holes, *(row + 1 for row in stops), len(block)}
        for first, last in pairwise(sorted(cuts)):
            if first in holes and core.schedule.started:
                core.restart()
                self._inputs.restart()
            rows = slice(first, last)
            frames += self._process_part(block.select(rows), t_us[rows])
            if last - 1 in stops:
                frames += core.stop(core.now_us)
                self._inputs.restart()
        return frames

    def _process_part(self, block: Block, t_us: Stamps) -> list[Frame]:
        """Process rows without a hole between them."""
        core = self._core
        totals = _Totals(core.receiver.rejected, core.receiver.lost)
        received = core.receiver.accept_block(block, t_us)
        core.counts.foreign += received.foreign
        if core.on_readings is not None:
            core.on_readings(received.readings)
        first = min((int(rows[0]) for rows in received.accepted if len(rows)), default=None)
        start_row = -1
        if not core.schedule.started and first is not None:
            start_row, t0_us = first, int(t_us[first])
            core.start(t0_us)
            self._inputs.start(t0_us)
        due = core.schedule.due_times(int(t_us[-1]))
        # Rows received before each due time; the frame that starts the service is received before
        # the very first one as well.
        known = np.searchsorted(t_us, due)
        if start_row >= 0:
            known[0] = start_row + 1
        self._inputs.add(received, due, totals.at(received, known))
        frames: list[Frame] = []
        for event in self._events(block, t_us, received):
            if event.row > start_row:
                frames += core.emit(event.t_us, self._inputs.snapshot)
            event.apply()
        return frames + core.emit(int(t_us[-1]), self._inputs.snapshot)

    def _events(self, block: Block, t_us: Stamps, received: ReceivedBlock) -> list["_Event"]:
        """Events between the due times, in the order of their times."""
        core, events = self._core, []
        for row in np.flatnonzero(block.kind == Kind.SECOND_SENDER).tolist():
            now_us = int(t_us[row])
            stamp = max(int(block.t_us[row]), now_us)
            events.append(_Event(now_us, row, partial(core.second_sender, stamp)))
        stamps, sources = received.readings.get((Role.SPEED_SOURCE, 0), _NO_READINGS)
        available = np.isfinite(sources)
        derived = core.speed_derived
        for stamp, source in zip(
            stamps[available].tolist(), sources[available].tolist(), strict=True
        ):
            if (source == SpeedSource.DRIVEN_AXLES) is not derived:
                derived = not derived
                row = int(np.searchsorted(t_us, stamp, side="right"))
                events.append(_Event(stamp, row, partial(core.use_speed_source, source)))
        return sorted(events, key=lambda event: event.t_us)


class ColumnInputs:
    """Inputs of the service in blocks: the counterpart of `FrameInputs` in columns.

    Args:
        configuration: Roles, messages and settings of the sampling.

    """

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self.restart()

    def restart(self) -> None:
        """Forget all readings."""
        self._former = self._configuration.make_column_former()
        self._rim_speed = self._configuration.make_rim_speed()
        self._snapshots: dict[int, InputSnapshot] = {}
        self._last_us: list[int] = []
        self._speed: float | None = None

    def start(self, t0_us: int) -> None:
        """Supervise the required messages from T0 on."""
        self._last_us = [t0_us] * len(self._configuration.messages)

    def add(self, received: ReceivedBlock, due: Stamps, totals: "_TotalsAtDueTimes") -> None:
        """Add the readings of a block, and build the snapshots of the due times in it.

        Args:
            received: Readings of the block; stamps must not run backwards.
            due: Due times until the end of the block, µs, ascending; shape (n,).
            totals: Numbers of rejected and lost frames at the due times.

        """
        rim_speed, readings = self._rim_speed, received.readings
        self._former.add(readings if rim_speed is None else rim_speed.add_to_columns(readings))
        rows = zip(
            due.tolist(),
            self._former.collect(due),
            self._find_stale(due, received).tolist(),
            self._find_speeds(due, received),
            zip(totals.rejected.tolist(), totals.lost.tolist(), strict=True),
            strict=True,
        )
        self._snapshots = {
            t_us: InputSnapshot(samples, stale, speed, partial(tuple, counts), self._former.dropped)
            for t_us, samples, stale, speed, counts in rows
        }

    def snapshot(self, t_us: int) -> InputSnapshot:
        """State at a due time of the latest block, µs; each can be had once."""
        return self._snapshots.pop(t_us)

    def _find_stale(self, due: Stamps, received: ReceivedBlock) -> NDArray[np.bool_]:
        """Whether a required message had been silent for too long at each due time; shape (n,)."""
        stale = np.zeros(len(due), dtype=np.bool_)
        if not self._last_us:
            return stale
        for number, message in enumerate(self._configuration.messages):
            required = [(s.role, s.axle) for s in message.signals if s.role in REQUIRED]
            if not required:
                continue
            last_us = np.full(len(due), self._last_us[number])
            for key in required:
                stamps, values = received.readings.get(key, _NO_READINGS)
                available = stamps[np.isfinite(values)]
                if len(available):
                    place = np.searchsorted(available, due) - 1
                    latest = np.maximum(last_us, available[place])
                    last_us = np.where(place >= 0, latest, last_us)
                    self._last_us[number] = max(self._last_us[number], int(available[-1]))
            stale |= due - last_us > STALE_CYCLES * (message.cycle_us or 0)
        return stale

    def _find_speeds(self, due: Stamps, received: ReceivedBlock) -> list[float | None]:
        """Latest vehicle speed before each due time, m/s; None where it is not available."""
        stamps, values = received.readings.get((Role.VEHICLE_SPEED, 0), _NO_READINGS)
        new = [None if np.isnan(value) else value for value in values.tolist()]
        speeds = [self._speed, *new]
        self._speed = speeds[-1]
        return [speeds[place] for place in np.searchsorted(stamps, due).tolist()]


class _Event(NamedTuple):
    """Event between due times.

    Attributes:
        t_us: Time of the event, µs; messages due then or earlier are sent before it.
        row: Row of the block that holds the mark, or the first row after the changed speed source.
        apply: Function that carries the event out.

    """

    t_us: int
    row: int
    apply: Callable[[], None]


class _TotalsAtDueTimes(NamedTuple):
    """Numbers of frames since the service began, at each due time.

    Attributes:
        rejected: Number of frames rejected; shape (n,).
        lost: Number of frames lost; shape (n,).

    """

    rejected: NDArray[np.int64]
    lost: NDArray[np.int64]


class _Totals(NamedTuple):
    """Numbers of frames since the service began, before a block.

    Attributes:
        rejected: Number of frames rejected.
        lost: Number of frames lost.

    """

    rejected: int
    lost: int

    def at(self, received: ReceivedBlock, known: NDArray[np.int64]) -> _TotalsAtDueTimes:
        """Numbers after so many rows of the block, for each due time; `known` has shape (n,)."""
        rejections = np.sort(np.concatenate([*received.rejected, np.empty(0, dtype=np.int64)]))
        lost = np.full(len(known), self.lost)
        for rows, counts in received.lost:
            lost += np.concatenate([[0], np.cumsum(counts)])[np.searchsorted(rows, known)]
        return _TotalsAtDueTimes(self.rejected + np.searchsorted(rejections, known), lost)
