"""A recording as the source of `monitor`, at a multiple of its own speed."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from math import inf, isinf
from pathlib import Path

import numpy as np

from adhesion_can.bus.block import EXTENDED, Block
from adhesion_can.bus.database import OUTPUT_MESSAGES, database_with
from adhesion_can.bus.frame import Frame
from adhesion_can.cli.monitor_source import LOOKED_AT, TURN_S
from adhesion_can.cli.reading import reading
from adhesion_can.config import Configuration
from adhesion_can.monitoring.snapshot import Origin, Transport
from adhesion_can.offline.stamps import in_seconds
from adhesion_can.recordings.problems import no_frame_error
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import with_answers

SLOWEST, FASTEST = 0.125, 64.0
"""Limits of the speed; twice the fastest is as fast as it goes."""
WARM_UP_S = 10.0
"""Time before the one jumped to from which recorded frames are read, s, for rates and faults."""
LEARNING_S = 60.0
"""The same where the service runs here, which needs time to learn the curve, s."""
SHOWN_BEHIND_S = 1.0
"""Time that is to be read before it is said that it is being read, s."""


@dataclass(frozen=True, slots=True)
class Extent:
    """What is known of a recording before it is played.

    Attributes:
        first_us: First stamp, µs.
        last_us: Latest stamp, µs.
        has_service: Whether it holds setpoints of a service.
        restart_s: Hole beyond which the service starts again, s.

    """

    first_us: int
    last_us: int
    has_service: bool
    restart_s: float

    @property
    def duration_s(self) -> float:
        """Time from the first to the last frame, s."""
        return (self.last_us - self.first_us) / 1e6


def survey(paths: Sequence[Path], configuration: Configuration) -> Extent:
    """Read recordings through once, in columns.

    Raises:
        RecordingError: There is no frame, a recording cannot be read, or its stamps are no seconds.

    """
    database = database_with(OUTPUT_MESSAGES, configuration.database)
    message = database.message(OUTPUT_MESSAGES[0])
    key = message.frame_id | (EXTENDED if message.is_extended_frame else 0)
    first_us: int | None = None
    last_us = 0
    has_service = False
    recordings, restart_s = open_recordings(paths), configuration.service.restart_s
    with reading("reading", recordings) as watched:
        blocks = watched(blocks_in_sequence(recordings, restart_s))
        for block in in_seconds(blocks, configuration.messages, ", ".join(map(str, paths))):
            t_us = block.t_us
            first_us = int(t_us[0]) if first_us is None else first_us
            last_us = max(last_us, int(t_us.max()))
            has_service = has_service or bool(np.any(block.key[block.is_data] == key))
    if first_us is None:
        raise no_frame_error(recordings)
    return Extent(first_us, last_us, has_service, restart_s)


class LogSource:
    """Frames of recordings, at a multiple of their own speed.

    Args:
        paths: Paths of the recordings, in the order of their times.
        extent: What is known of them.
        make_core: Maker of a service that runs here; None: the recorded one is shown.
        from_s: Start, s after the first frame.
        speed: Speed, multiple of their own; inf: as fast as it goes.
        clock: Monotonic clock, s.

    """

    def __init__(
        self,
        paths: Sequence[Path],
        extent: Extent,
        make_core: Callable[[], ServiceCore] | None,
        *,
        from_s: float = 0.0,
        speed: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.origin = Origin.RECORDED if make_core is None else Origin.ESTIMATED_HERE
        self.made_here = frozenset() if make_core is None else make_core().messages.ids
        self.speed = speed
        self.paused = False
        self.generation = 0
        self._paths = paths
        self._extent = extent
        self._make_core = make_core
        self._clock = clock
        self._turned_s = clock()
        self._frames: Iterator[Frame] = iter(())
        self._blocks: Iterator[Block] = iter(())
        self._lead_us = extent.first_us
        self._is_seeking = True
        self._next: Frame | None = None
        self._now_us = self._due_us = extent.first_us
        self._open(from_s)

    @property
    def now_us(self) -> int:
        """Time in the recording, µs."""
        return self._now_us

    @property
    def begin_us(self) -> int:
        """Time that was asked for last, µs; frames before it are given for what led to it."""
        return self._begin_us

    @property
    def position_s(self) -> float:
        """Time in the recording, s after its first frame."""
        return (self._now_us - self._extent.first_us) / 1e6

    @property
    def is_at_end(self) -> bool:
        """Whether every frame has been given."""
        return self._next is None and not self._is_seeking

    @property
    def is_catching_up(self) -> bool:
        """Whether frames before the time that was asked for are still to be read."""
        return not self.is_at_end and self._now_us < self._due_us

    def take(self) -> Iterable[Frame]:
        """Frames that are due since the last call, as many as a turn has time for."""
        now_s = self._clock()
        elapsed_s, self._turned_s = now_s - self._turned_s, now_s
        if not self.paused and not self.is_catching_up:
            share = 0.0 if isinf(self.speed) else elapsed_s * self.speed
            end_us = self._extent.last_us
            due_us = end_us if isinf(self.speed) else self._due_us + round(share * 1e6)
            self._due_us = min(due_us, end_us)
        return self._until(self._due_us, now_s + TURN_S)

    def take_all(self, until_us: int) -> Iterator[Frame]:
        """Frames up to a time, µs, however long it takes; the time stops at the latest stamp."""
        self._due_us = min(until_us, self._extent.last_us)
        return self._until(self._due_us, inf)

    def _until(self, due_us: int, until_s: float) -> Iterator[Frame]:
        if not self._seek(until_s):
            return
        count = 0
        while self._next is not None and self._next.t_us <= due_us:
            frame = self._next
            self._next = next(self._frames, None)
            self._now_us = max(self._now_us, frame.t_us)
            yield frame
            count += 1
            if count % LOOKED_AT == 0 and self._clock() >= until_s:
                if isinf(self.speed):
                    self._due_us = self._now_us
                return
        self._now_us = max(self._now_us, due_us)

    def step(self, duration_s: float) -> None:
        """Make a part due, while it is paused."""
        self._due_us = min(self._now_us + round(duration_s * 1e6), self._extent.last_us)

    def faster(self, factor: float) -> None:
        """Multiply the speed, within its limits."""
        wanted = min(self.speed, 2.0 * FASTEST) * factor
        self.speed = inf if wanted > FASTEST else max(wanted, SLOWEST)

    def jump(self, to_s: float) -> None:
        """Go on at another time, s after the first frame."""
        self.generation += 1
        self._open(min(max(to_s, 0.0), self._extent.duration_s))

    def transport(self) -> Transport:
        """How the frames come."""
        until_s = (self._due_us - self._extent.first_us) / 1e6
        is_behind = self._due_us - self._now_us > SHOWN_BEHIND_S * 1e6
        return Transport(
            name=", ".join(path.name for path in self._paths),
            origin=self.origin,
            is_live=False,
            paused=self.paused,
            speed=self.speed,
            position_s=self.position_s,
            duration_s=self._extent.duration_s,
            is_at_end=self.is_at_end,
            catching_up_s=until_s if self.is_catching_up and is_behind else None,
        )

    def close(self) -> None:
        """Nothing is open beyond what is read."""
        self._frames, self._blocks = iter(()), iter(())

    def _open(self, from_s: float) -> None:
        """Start before a time, s after the first frame, so that all is known when it is reached."""
        self._begin_us = begin_us = self._extent.first_us + round(from_s * 1e6)
        lead_s = WARM_UP_S if self._make_core is None else LEARNING_S
        self._lead_us = begin_us - round(lead_s * 1e6)
        self._blocks = blocks_in_sequence(open_recordings(self._paths), self._extent.restart_s)
        self._is_seeking = True
        self._next = None
        self._now_us = self._extent.first_us
        self._due_us = begin_us
        self._turned_s = self._clock()

    def _seek(self, until_s: float) -> bool:
        """Pass over the blocks before the time that was asked for; whether that is done."""
        while self._is_seeking:
            block = next(self._blocks, None)
            if block is None:
                self._play(())
            elif len(part := _part_from(block, self._lead_us)):
                self._play([part])
            else:
                self._now_us = int(block.t_us[-1])
                if self._clock() >= until_s:
                    return False
        return True

    def _play(self, first: Iterable[Block]) -> None:
        """Give the frames of these blocks, and of those that follow."""
        rest = (_part_from(block, self._lead_us) for block in self._blocks)
        items = (item for part in chain(first, rest) for item in part.items())
        if self._make_core is None:
            self._frames = (item for item in items if isinstance(item, Frame))
        else:
            self._frames = with_answers(items, self._make_core())
        self._next = next(self._frames, None)
        self._now_us = self._extent.last_us if self._next is None else self._next.t_us
        self._is_seeking = False


def _part_from(block: Block, begin_us: int) -> Block:
    t_us = block.t_us
    return block if t_us[0] >= begin_us else block.select(np.flatnonzero(t_us >= begin_us))
