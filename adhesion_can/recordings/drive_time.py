"""Time of a drive: the stamps of recordings in one sequence that runs forward.

A clock that is set back while recording, a timer that wraps and a log that is appended to an older
one give stamps below those in front of them for good. There a new stretch starts: its stamps are
moved behind the others by more than `restart_s`, so that everything starts again as after a hole.
Single frames that are late stay where they are.
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block
from adhesion_can.errors import RecordingError
from adhesion_can.plurals import counted
from adhesion_can.recordings.candump import ReadReport
from adhesion_can.recordings.recording import Recording

BACK_NS = 100_000_000
"""Step back that late frames do not make, ns."""
LASTS, LASTS_AT_END = 200, 5
"""Frames below the stamps in front of them that make a new stretch whatever follows, and at the end
of a file."""
SEEN = 20
"""Frames behind a step whose messages are compared with those before it."""
SHOWN = 3
"""Most steps that are reported one by one."""
USUAL_RESTART_S = 60.0
"""Hole beyond which a drive starts again where nobody configures it, s."""


def hole_us(restart_s: float) -> int:
    """Time between the stretches of a recording, µs: a hole that is none."""
    return round((restart_s + 1.0) * 1e6)


class DriveTime:
    """Maps the stamps of one recording after the other.

    Args:
        restart_s: Hole beyond which the service starts again, s.

    """

    def __init__(self, restart_s: float) -> None:
        self._hole_ns = hole_us(restart_s) * 1000
        self._latest_ns: int | None = None
        self._first: Recording | None = None

    def blocks(self, recording: Recording, blocks: Iterable[Block]) -> Iterator[Block]:
        """Blocks of the next recording in the time of the drive.

        Args:
            recording: The recording, whose report lists the steps afterwards.
            blocks: Its blocks.

        Raises:
            RecordingError: It starts before the one in front of it ended, or its frames are sorted
                newest first.

        """
        stretches = _Stretches(recording, self._hole_ns, self._offset_of(recording))
        self._first = self._first or recording
        is_first = True
        for block in stretches.blocks(blocks):
            begins_ns = int(block.t_ns[0])
            if is_first and self._latest_ns is not None and begins_ns < self._latest_ns:
                raise RecordingError(
                    str(recording.path),
                    "starts before the previous recording ends",
                    "name the recordings in the order of their times, or replay them one by one",
                )
            is_first = False
            self._latest_ns = max(int(block.t_ns.max()), self._latest_ns or 0)
            yield block

    def by_head(self, recording: Recording, blocks: Iterable[Block]) -> Iterator[Block]:
        """Blocks of the next recording with the stamps that its file has.

        Those of files that count from a date in their heads count from that of the first one.
        """
        offset_ns = self._offset_of(recording)
        self._first = self._first or recording
        for block in blocks:
            yield block.stamped(block.t_ns + offset_ns) if offset_ns else block

    def _offset_of(self, recording: Recording) -> int:
        """What the dates in the heads of two recordings add to the stamps of the later one, ns."""
        if self._first is None:
            return 0
        began_us, first_us = recording.head_date_us, self._first.head_date_us
        return 0 if began_us is None or first_us is None else (began_us - first_us) * 1000


class _Step(NamedTuple):
    """Start of a new stretch.

    Attributes:
        row: Row at which it starts.
        is_sure: Whether it does; else the rows behind it will show.

    """

    row: int
    is_sure: bool


class _Stretches:
    """Stretches of one recording.

    Args:
        recording: The recording.
        hole_ns: Time between two stretches, ns.
        offset_ns: What is added to the stamps of the first one, ns.

    """

    def __init__(self, recording: Recording, hole_ns: int, offset_ns: int) -> None:
        self._recording, self._hole_ns, self._offset_ns = recording, hole_ns, offset_ns
        self._rows = 0
        self._latest_ns: int | None = None
        self._before: Block | None = None
        self._waiting: Block | None = None
        self._steps: list[str] = []

    def blocks(self, blocks: Iterable[Block]) -> Iterator[Block]:
        """Blocks with the stamps moved."""
        for block in blocks:
            if len(block):
                yield from self._parts(block, is_end=False)
        if self._waiting is not None:
            yield from self._parts(None, is_end=True)
        self._tell()

    def _parts(self, block: Block | None, *, is_end: bool) -> Iterator[Block]:
        """Rows that are done, up to those of which only the next block shows what they are."""
        held = [rows for rows in (self._waiting, block) if rows is not None]
        rows = held[0] if len(held) == 1 else Block.concatenate(held)
        self._waiting = None
        if self._latest_ns is None:
            self._begin(int(rows.t_ns[0]))
        while len(rows):
            t_ns = rows.t_ns + self._offset_ns
            step = self._find_step(rows, t_ns, is_end=is_end)
            end = len(rows) if step is None else step.row
            if end:
                yield self._done(rows.select(slice(end)), t_ns[:end])
            if step is None:
                return
            rows = rows.select(slice(end, None))
            if not step.is_sure:
                self._waiting = rows
                return
            self._step(int(t_ns[end]))

    def _begin(self, first_ns: int) -> None:
        """Stamps below 0 are moved: they have no place in a drive."""
        if first_ns + self._offset_ns < 0:
            self._offset_ns = -first_ns
            self._recording.report.remarks.append(
                f"stamps start at {first_ns / 1e9:.3f} s and are shifted to 0"
            )

    def _done(self, rows: Block, t_ns: NDArray[np.int64]) -> Block:
        """Rows with their stamps of the drive, which are given."""
        self._rows += len(rows)
        highest_ns = int(t_ns.max())
        self._latest_ns = (
            highest_ns if self._latest_ns is None else max(highest_ns, self._latest_ns)
        )
        self._before = rows.stamped(t_ns)
        return self._before

    def _find_step(self, rows: Block, t_ns: NDArray[np.int64], *, is_end: bool) -> "_Step | None":
        """Where a new stretch starts; None where none does."""
        latest_ns = int(t_ns[0]) if self._latest_ns is None else self._latest_ns
        highest = np.maximum.accumulate(np.concatenate([[latest_ns], t_ns]))[:-1]
        is_back = t_ns < highest - BACK_NS
        if not is_back.any():
            return None
        begins = is_back & ~np.concatenate([[False], is_back[:-1]])
        for row in np.flatnonzero(begins).tolist():
            run = t_ns[row : row + LASTS]
            above = np.flatnonzero(run >= highest[row])
            if len(above):  # late frames end with a leap to where the others are, a clock does not
                end = int(above[0])
                lasts = run[end] - run[end - 1] < (highest[row] - run[0]) / 2
            elif len(run) < LASTS and not is_end:
                return _Step(row, is_sure=False)
            else:
                lasts = len(run) >= LASTS_AT_END
            if lasts and self._falls(rows, t_ns, row):
                return _Step(row, is_sure=True)
        return None

    def _falls(self, rows: Block, t_ns: NDArray[np.int64], start: int) -> bool:
        """Whether messages run back, and not one bus whose frames came in later than another's."""
        known: dict[tuple[str, int], int] = {}
        parts = [(rows.select(slice(0, start)), t_ns[:start])]
        if self._before is not None:
            parts.insert(0, (self._before, self._before.t_ns))
        for part, stamps in parts:
            for name, t in zip(_names(part), stamps.tolist(), strict=True):
                known[name] = max(t, known.get(name, t))
        behind = rows.select(slice(start, start + SEEN))
        met = [
            t < known[name]
            for name, t in zip(_names(behind), t_ns[start : start + SEEN].tolist(), strict=True)
            if name in known
        ]
        if 2 * sum(met) <= len(met):
            return False
        if 2 * np.count_nonzero(np.diff(behind.t_ns) < 0) > len(behind):
            raise RecordingError(
                str(self._recording.path),
                "its frames are sorted newest first",
                "reverse the lines, for example with 'tac'",
            )
        return True

    def _step(self, at_ns: int) -> None:
        """Start a new stretch with a row that would be at a time of the drive, ns."""
        latest_ns = self._latest_ns or 0
        self._offset_ns += latest_ns + self._hole_ns - at_ns
        self._latest_ns = latest_ns + self._hole_ns
        self._steps.append(f"by {(latest_ns - at_ns) / 1e9:.3f} s at frame {self._rows + 1}")

    def _tell(self) -> None:
        report: ReadReport = self._recording.report
        if not self._steps:
            return
        report.backwards = max(report.backwards - len(self._steps), 0)
        shown = ", ".join(self._steps[:SHOWN]) + (", .." if len(self._steps) > SHOWN else "")
        times = counted(len(self._steps), "time")
        report.remarks.append(
            f"the clock steps back {times} ({shown}); each step starts a new part"
        )


def _names(rows: Block) -> list[tuple[str, int]]:
    """Bus and id of each row."""
    names = rows.channels or ("",)
    return [
        (names[channel], key)
        for channel, key in zip(rows.channel.tolist(), rows.key.tolist(), strict=True)
    ]
