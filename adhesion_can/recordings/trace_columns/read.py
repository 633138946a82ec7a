"""A text trace (.asc, .trc) to blocks."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Protocol

import can
import numpy as np

from adhesion_can.bus.block import Block
from adhesion_can.bus.frame import Frame
from adhesion_can.recordings.candump import ReadReport
from adhesion_can.recordings.candump_columns.line_layouts import Places
from adhesion_can.recordings.candump_columns.parse import find_lines
from adhesion_can.recordings.candump_columns.text_source import FRONT, Chunk, Text
from adhesion_can.recordings.frame_rows import FrameCounter, NumberedBuses, bus_from_1
from adhesion_can.recordings.trace_columns.asc import AscForm
from adhesion_can.recordings.trace_columns.line_layouts import Layout, match_lines
from adhesion_can.recordings.trace_columns.odd_lines import OddLine, to_frame
from adhesion_can.recordings.trace_columns.trc import TrcForm

_FEW = 24  # lines that are read one by one sooner than all at once
_LAYOUTS = 64  # of one chunk; past them its lines are read one by one
_CR, _LF = ord("\r"), ord("\n")

FORMS: dict[str, type[AscForm] | type[TrcForm]] = {".asc": AscForm, ".trc": TrcForm}
"""Forms of the lines by the suffix of a format."""


class Form(Protocol):
    """Form of the lines of a file: `AscForm`, `TrcForm`."""

    first_bus: int
    start_ns: int

    def find_layout(self, line: bytes) -> Layout | None: ...  # noqa: D102
    def read(self, lines: Sequence[bytes]) -> list[OddLine]: ...  # noqa: D102
    def kind_without_frame(self, line: bytes) -> str | None: ...  # noqa: D102
    def tell(self, report: ReadReport) -> None: ...  # noqa: D102


def read_trace(
    chunks: Iterable[Chunk], form: Form, report: ReadReport
) -> Iterator[tuple[Block, int]]:
    """Blocks of the chunks of a file, in order, each with the chunk's position.

    Args:
        chunks: Chunks of one file, in order.
        form: Form of its lines.
        report: Statistics, filled as blocks are given.

    """
    buses, counter = NumberedBuses(bus_from_1), FrameCounter(report)
    parser = _ChunkParser(form, report)
    for chunk in chunks:
        rows = parser.parse(chunk)
        if len(rows):
            block = buses.named(rows)
            counter.add(block)
            yield block, chunk.position
    form.tell(report)


class _ChunkParser:
    """Parser of one chunk after the other.

    Args:
        form: Form of the lines.
        report: Statistics, in which lines without a frame are counted.

    """

    def __init__(self, form: Form, report: ReadReport) -> None:
        self._form, self._report = form, report
        self._layouts: list[Layout] = []
        self._lines = 0

    def parse(self, chunk: Chunk) -> Block:
        """Frames of the next chunk, whose `channel` has the numbers of their buses."""
        text = chunk.text
        _end_lines_at_cr(text[FRONT : chunk.stop])
        starts, ends = find_lines(text, chunk.stop)
        left = np.arange(len(ends))
        odd: list[int] = []
        parts: list[tuple[Places, Block]] = []
        used: Counter[Layout] = Counter()
        layouts = self._layouts
        tried = 0
        while len(left) >= _FEW and tried < _LAYOUTS:
            if tried == len(layouts):
                row = int(left[0])
                layout = self._form.find_layout(_line(text, starts, row))
                if layout is None or layout in layouts:
                    odd.append(row)
                    left = left[1:]
                    continue
                layouts.append(layout)
            layout = layouts[tried]
            tried += 1
            found = match_lines(layout, text, starts[left], ends[left], self._form.start_ns)
            if found:
                places, block = found
                used[layout] += len(places)
                parts.append((left[places], block))
                left = np.delete(left, places)
        self._layouts = [layout for layout, _ in used.most_common()]
        odd += left.tolist()
        parts += self._odd(sorted(odd), text, starts)
        self._lines += len(ends)
        return _in_order(parts)

    def _odd(self, rows: list[int], text: Text, starts: Places) -> list[tuple[Places, Block]]:
        """Frames of lines that no layout fits; the others are counted."""
        lines = [_line(text, starts, row) for row in rows]
        places: list[int] = []
        frames: list[Frame] = []
        buses: list[int] = []
        stamps: list[int] = []
        for row, line, (found, t_ns) in zip(rows, lines, self._form.read(lines), strict=True):
            kind: str | None = "malformed"
            if isinstance(found, can.Message):
                try:
                    frame, bus = to_frame(found, self._form.first_bus)
                except (ValueError, OverflowError):
                    pass
                else:
                    places.append(row)
                    frames.append(frame)
                    buses.append(bus)
                    stamps.append(frame.t_us * 1000 if t_ns is None else t_ns)
                    continue
            elif found is None:
                kind = self._form.kind_without_frame(line)
            if kind:
                is_whole = line.endswith(b"\n")
                self._report.skip(kind, self._lines + row + 1, is_whole=is_whole)
        if not frames:
            return []
        block = Block.from_frames(frames)
        block = Block(
            t_ns=np.array(stamps, np.int64),
            key=block.key,
            kind=block.kind,
            length=block.length,
            channel=np.array(buses, np.uint16),
            words=block.words,
            channels=(),
        )
        return [(np.array(places), block)]


def _line(text: Text, starts: Places, row: int) -> bytes:
    return text[starts[row] : starts[row + 1]].tobytes()


def _end_lines_at_cr(text: Text) -> None:
    """Make a CR that no LF follows the end of a line, as Python's text files do; in place."""
    places = np.flatnonzero(text == _CR)
    if len(places):
        following = text[np.minimum(places + 1, len(text) - 1)]
        text[places[following != _LF]] = _LF


def _in_order(parts: list[tuple[Places, Block]]) -> Block:
    if not parts:
        return Block.from_frames([])
    block = Block.concatenate([block for _, block in parts])
    if len(parts) == 1:
        return block
    return block.select(np.argsort(np.concatenate([rows for rows, _ in parts]), kind="stable"))
