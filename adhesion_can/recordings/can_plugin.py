"""candump text for python-can: a reader that no line can stop, as a plug-in of `can.LogReader`.

python-can's own reader of candump text ends with an exception at the first line that is not as it
expects. This one gives it the lines that it can read, and passes over the others. python-can lets
no plug-in take a suffix that it reads itself, so that `.log` stays with its own reader: the plug-in
has `.candump`.
"""

import logging
import re
from collections.abc import Iterator
from itertools import chain, islice
from typing import Any, BinaryIO, cast

import can
from can.io.generic import BinaryIOMessageReader
from can.typechecking import StringPathLike

from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.recordings.candump import (
    HEAD_LINES,
    ReadReport,
    format_frame,
    frame_kind,
    parse_line,
    read_candump,
    times_are_differences,
)

_log = logging.getLogger(__name__)
_LINE_LIMIT = 1 << 16
_PLAIN = re.compile(
    rb"\(\d+\.\d+\) [!-~]+ [0-9A-Fa-f]+#(?:#[0-9])?(?:[Rr]\d*|(?:[0-9A-Fa-f]{2})*)"
    rb"(?: [RTrt])?\s*$"
)


class CandumpReader(BinaryIOMessageReader):
    """Messages of candump text: of a file without faults those of `can.CanutilsLogReader`.

    Besides it reads the columns of `candump -ta` and the like. A line of any other form is passed
    over, counted in `report`, and reported at the end by one warning of this module's logger.

    Args:
        file: Path, or file that is open for reading bytes.
        kwargs: Arguments of other readers, which have no effect.

    """

    def __init__(self, file: StringPathLike | BinaryIO, **kwargs: Any) -> None:  # noqa: ARG002
        super().__init__(file, mode="rb")
        self.report = ReadReport()
        """Statistics, filled while the messages are read."""

    def __iter__(self) -> Iterator[can.Message]:
        lines = self._readable(iter(lambda: self.file.readline(_LINE_LIMIT), b""))
        # python-can's reader goes over the lines of what it takes for a file, and closes it.
        yield from can.CanutilsLogReader(cast("str", lines))
        self.stop()
        report = self.report
        if report.passed_over:
            places = ", ".join(map(str, report.bad_lines))
            name = getattr(self.file, "name", "candump text")
            _log.warning("%s: skipped %d lines (%s)", name, report.passed_over, places)

    def _readable(self, lines: Iterator[bytes]) -> Iterator[str]:
        """Lines as python-can's reader takes them; others of frames are written again for it."""
        head = list(islice(lines, HEAD_LINES))
        whole = chain(head, lines)
        if times_are_differences(head):
            frames = read_candump(whole, self.report)
            yield from (format_frame(frame) for frame in frames if isinstance(frame, Frame))
            return
        for number, line in enumerate(whole, start=1):
            item = parse_line(line)
            text = "" if isinstance(item, str | Mark) else _as_log(line, item)
            if isinstance(item, Mark):
                self.report.kinds["mark"] += 1
            elif isinstance(item, str) or len(text.split()) not in (3, 4):
                kind = item if isinstance(item, str) else "malformed"
                self.report.skip(kind, number, is_whole=line.endswith(b"\n"))
            else:
                self.report.kinds[frame_kind(item)] += 1
                yield text


def _as_log(line: bytes, frame: Frame) -> str:
    """Line as python-can reads it, with all its digits and flags, else written again."""
    return line.decode("ascii") if _PLAIN.match(line) else format_frame(frame)
