"""Several recordings one after another, less frames whose stamps are broken."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.candump import ReadReport
from adhesion_can.recordings.drive_time import USUAL_RESTART_S, DriveTime
from adhesion_can.recordings.formats import is_candump
from adhesion_can.recordings.problems import no_frame_error
from adhesion_can.recordings.recording import Recording

STRAY_US = 60_000_000
"""A stamp this far ahead, taken back by the next one, is a broken stamp and not a hole in time."""


class _StrayDetector:
    """Finds frames with a broken stamp far ahead, which would hold up all that follow.

    Args:
        report: Statistics of the recording, where they are counted.

    """

    def __init__(self, report: ReadReport) -> None:
        self._report = report
        self._last: int | None = None
        self._suspect: int | None = None

    def add(self, t_us: int) -> tuple[bool, bool]:
        """Add the next stamp: whether the suspect before it is valid, and whether this one is."""
        suspect_is_valid = False
        if self._suspect is not None:
            suspect_is_valid = t_us > self._suspect - STRAY_US
            if suspect_is_valid:
                self._last = self._suspect
            else:
                self._count(self._suspect)
            self._suspect = None
        if self._last is not None and t_us - self._last > STRAY_US:
            self._suspect = t_us
            return suspect_is_valid, False
        self._last = t_us
        return suspect_is_valid, True

    def add_steady(self, t_us: NDArray[np.int64]) -> bool:
        """Add stamps with no such leap at all; False, and nothing added, where there is one."""
        last = int(t_us[0]) if self._last is None else self._last
        if self._suspect is not None or (np.diff(t_us, prepend=last) > STRAY_US).any():
            return False
        self._last = int(t_us[-1])
        return True

    def _count(self, t_us: int) -> None:
        self._report.kinds["stray"] += 1
        if self._report.kinds["stray"] == 1:
            self._report.notes.append(
                "dropped frames whose stamp is far ahead of the others, the first at "
                f"{t_us / 1e6:.6f} s"
            )


def _without_strays(blocks: Iterable[Block], report: ReadReport) -> Iterator[Block]:
    detector = _StrayDetector(report)
    suspect: Block | None = None
    for block in blocks:
        if not len(block):
            continue
        if suspect is None and detector.add_steady(block.t_us):
            yield block
            continue
        rows = block if suspect is None else Block.concatenate([suspect, block])
        skip = 0 if suspect is None else 1  # the suspect row was added with its own block
        keep = np.zeros(len(rows), dtype=np.bool_)
        for place, t_us in enumerate(rows.t_us.tolist()[skip:], start=skip):
            suspect_is_valid, keep[place] = detector.add(t_us)
            if place and not keep[place - 1]:
                keep[place - 1] = suspect_is_valid
        suspect = None if keep[-1] else rows.select(slice(len(rows) - 1, None))
        if keep.any():
            yield rows.select(keep)
    if suspect is not None:
        yield suspect


def blocks_in_sequence(
    recordings: Sequence[Recording], restart_s: float = USUAL_RESTART_S
) -> Iterator[Block]:
    """Recordings one after another, in blocks, in the time of the drive.

    Args:
        recordings: Recordings in the order of their times.
        restart_s: Hole beyond which the service starts again, s.

    Raises:
        RecordingError: A recording starts before the one in front of it ended, there is not one
            frame in any of them, or the frames of one are sorted newest first.

    """
    time, is_empty = DriveTime(restart_s), True
    for recording in recordings:
        steady = _without_strays(recording.blocks(), recording.report)
        for block in time.blocks(recording, steady):
            is_empty = False
            yield block
    if recordings and is_empty:
        raise no_frame_error(recordings)


def open_recordings(paths: Sequence[Path]) -> list[Recording]:
    """Recordings of files.

    Args:
        paths: Paths of the files.

    Raises:
        RecordingError: A file is missing, of no known format, or a table of samples.

    """
    for path in paths:
        if not path.exists() or is_candump(path):
            continue
        # Imported here: most commands read recordings alone, and start the faster.
        from adhesion_can.recordings.tables.sample_table import is_table  # noqa: PLC0415

        if is_table(path):
            raise RecordingError(
                str(path), "a table of samples, not a recording", "give it to 'identify'"
            )
    return [Recording(path) for path in paths]
