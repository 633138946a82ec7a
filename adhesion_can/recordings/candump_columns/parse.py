"""candump text in columns: chunks of whole lines in, `Block`s out.

Lines in the form of `candump -L` are read many at a time (`line_layouts`). Every other line is read
by `candump.parse_line`, one by one. Both ways give the same for any bytes whatever.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block, Kind, to_micros
from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.candump import ReadReport, add_difference, read_line, stamp_ns
from adhesion_can.recordings.candump_columns.ascii_numbers import WORD, Words
from adhesion_can.recordings.candump_columns.line_layouts import (
    Layout,
    MatchedLines,
    Places,
    find_layout,
    match_lines,
)
from adhesion_can.recordings.candump_columns.text_source import FRONT, LINE_LIMIT, Chunk, Text

_FEW = 24  # lines that are read one by one sooner than all at once
_LAYOUTS = 16  # of one chunk; past them its lines are read one by one
_NOTHING = 0xFF  # kind of a line that gives no row
_NO_NAME = 0xFFFF  # channel of a line whose characters there are no name
_FREED = 1 << 24  # bytes of an array that is allocated and freed at once; see `read_chunks`
_SPACE = re.compile(rb"\s")
_NAMES = {
    Kind.DATA: "frame",
    Kind.FD: "fd",
    Kind.REMOTE: "remote",
    Kind.ERROR: "error",
    Kind.ADVANCE: "mark",
    Kind.SECOND_SENDER: "mark",
    Kind.STOP: "mark",
}


class SkippedLine(NamedTuple):
    """A line that gave no row.

    Attributes:
        row: Number of the line in the chunk, from 0 on.
        kind: Kind of the line, as `candump.parse_line` names it.
        is_whole: Whether the line has its line end.

    """

    row: int
    kind: str
    is_whole: bool


@dataclass(frozen=True, slots=True)
class ParsedChunk:
    """Rows of a chunk of text.

    Attributes:
        block: Rows of the chunk, with channels of its own.
        lines: Number of lines of the chunk.
        skipped: Lines that gave no row, in their order.
        layouts: Layouts of the lines, the most frequent first: a hint for the next chunk.

    """

    block: Block
    lines: int
    skipped: list[SkippedLine]
    layouts: tuple[Layout, ...]


def parse_chunk(chunk: Chunk, layouts: tuple[Layout, ...] = ()) -> ParsedChunk:
    """Parse a chunk of lines.

    Args:
        chunk: Whole lines.
        layouts: Layouts to try first; they save time and do not change the result.

    """
    return _ChunkParser(chunk, layouts).result()


class _ChunkParser:
    """Parser of one chunk: its columns while they are filled."""

    def __init__(self, chunk: Chunk, layouts: tuple[Layout, ...]) -> None:
        self._text = chunk.text
        self._starts, self._ends = find_lines(chunk.text, chunk.stop)
        self._lines = count = len(self._ends)
        self._t_ns = np.empty(count, np.int64)
        self._key = np.empty(count, np.uint32)
        self._kind = np.full(count, _NOTHING, np.uint8)
        self._length = np.empty(count, np.uint8)
        self._channel = np.zeros(count, np.uint16)
        self._words = np.empty((count, 1), np.uint64)
        self._names: dict[str, int] = {}
        self._layouts = list(layouts)
        self._used: Counter[Layout] = Counter()
        self._singles: list[tuple[int, Frame | Mark, int]] = []
        self._skipped: list[SkippedLine] = []

    def result(self) -> ParsedChunk:
        self._read()
        self._put_singles()
        block = Block(
            t_ns=self._t_ns,
            key=self._key,
            kind=self._kind,
            length=self._length,
            channel=self._channel,
            words=self._words,
            channels=tuple(self._names),
        )
        if self._skipped:
            block = block.select(self._kind != _NOTHING)
        layouts = tuple(layout for layout, _ in self._used.most_common())
        return ParsedChunk(block, self._lines, self._skipped, layouts)

    def _read(self) -> None:
        """Read lines by the known layouts, then by layouts found in them, then one by one."""
        left = np.arange(self._lines)
        for layout in self._layouts:
            if len(left) < _FEW:
                break
            left = self._read_alike(layout, left)
        while len(left) >= _FEW and len(self._layouts) < _LAYOUTS:
            layout_here = find_layout(self._line(left[0]))
            if layout_here is None or layout_here in self._layouts:
                self._read_single(int(left[0]))
                left = left[1:]
            else:
                self._layouts.append(layout_here)
                left = self._read_alike(layout_here, left)
        for row in left.tolist():
            self._read_single(row)

    def _line(self, row: int) -> bytes:
        return self._text[self._starts[row] : self._starts[row + 1]].tobytes()

    def _read_alike(self, layout: Layout, rows: Places) -> Places:
        """Read the lines that fit a layout; give the rows that do not."""
        first, stop = int(rows[0]), int(rows[-1]) + 1
        dense = len(rows) == stop - first
        chosen: slice | Places = slice(first, stop) if dense else rows
        found = match_lines(layout, self._text, self._starts[chosen], self._ends[chosen])
        if found is None:
            return rows
        channel = self._channels(layout, found)
        known = channel != _NO_NAME
        if not known.all():
            found, channel = found.select(known), channel[known]
        self._used[layout] += len(channel)
        if found.rows is None:
            self._put(chosen, found, layout.kind, channel)
            return rows[:0]
        self._put(rows[found.rows], found, layout.kind, channel)
        return np.delete(rows, found.rows)

    def _put(
        self,
        rows: slice | Places,
        found: MatchedLines | Block,
        kind: int | NDArray[np.uint8],
        channel: NDArray[np.uint16],
    ) -> None:
        width = 8 if (found.length > 8).any() else 1
        missing = width - self._words.shape[1]
        if missing > 0:
            self._words = np.pad(self._words, ((0, 0), (0, missing)))
        self._t_ns[rows] = found.t_ns
        self._key[rows] = found.key
        self._kind[rows] = kind
        self._length[rows] = found.length
        self._channel[rows] = channel
        self._words[rows, :width] = found.words[:, :width]

    def _channels(self, layout: Layout, found: MatchedLines) -> NDArray[np.uint16]:
        """Places of the lines' buses in `_names`, `_NO_NAME` where that is none, shape (n,)."""
        channel = np.zeros(found.names.shape[1], np.uint16)
        if not layout.name:
            return channel
        todo = np.ones(len(channel), np.bool_)
        while todo.any():
            name = found.names[:, todo.argmax()]
            same = found.names[0] == name[0]
            for words, word in zip(found.names[1:], name[1:], strict=True):
                same &= words == word
            np.putmask(channel, same, self._channel_number(_spelled(name, layout.letters)))
            np.greater(todo, same, out=todo)
        return channel

    def _channel_number(self, name: bytes) -> int:
        if _SPACE.search(name):
            return _NO_NAME
        number = self._names.setdefault(name.decode("latin-1"), len(self._names))
        _require_few(self._names)
        return number

    def _read_single(self, row: int) -> None:
        line = self._line(row)
        item = read_line(line)
        if isinstance(item, str):
            self._skipped.append(SkippedLine(row, item, line.endswith(b"\n")))
        else:
            self._singles.append((row, item, stamp_ns(line, item.t_us)))

    def _put_singles(self) -> None:
        if not self._singles:
            return
        rows, items, t_ns = zip(*self._singles, strict=True)
        frames = (item for item in items if isinstance(item, Frame))
        self._names |= {
            name: number
            for number, name in enumerate(
                dict.fromkeys((*self._names, *(f.channel for f in frames)))
            )
        }
        _require_few(self._names)
        block = Block.from_frames(items, tuple(self._names))
        block = replace(block, t_ns=np.array(t_ns, np.int64))
        self._put(np.array(rows), block, block.kind, block.channel)


def find_lines(text: Text, stop: int) -> tuple[Places, Places]:
    """Where lines start, shape (n + 1,), the last one past them, and where they end, shape (n,).

    A line's own end, the line feed, is left out of it; a line longer than the limit is several.
    """
    ends = _line_feeds(text[:stop])
    is_cut = stop > FRONT and text[stop - 1] != ord("\n")
    if is_cut:
        ends = np.append(ends, stop)
    starts = np.empty(len(ends) + 1, np.int64)
    starts[0] = FRONT
    np.add(ends, 1, out=starts[1:])
    starts[-1] = stop
    if len(ends) and np.diff(starts).max() > LINE_LIMIT:
        pieces = [np.arange(a, b, LINE_LIMIT) for a, b in pairwise(starts)]
        starts = np.append(np.concatenate(pieces), stop)
        ends = starts[1:] - (text[starts[1:] - 1] == ord("\n"))
    return starts, ends


def _line_feeds(text: Text) -> Places:
    """Places of line feeds, shape (n,)."""
    found = np.zeros(-(-len(text) // 8) * 8, np.bool_)
    np.equal(text, ord("\n"), out=found[: len(text)])
    # Words that hold one are found first: a walk over bytes that few of are true is slower.
    words = found.view(WORD)
    places = np.flatnonzero(words != 0)
    held = words[places]
    if (held & (held - np.uint64(1))).any():
        return np.flatnonzero(found)  # lines of less than 8 characters
    # A word is 256 ** k: times this it has k in its highest byte.
    held *= np.uint64(0x0001020304050607)
    held >>= np.uint64(56)
    places *= 8
    places += held.view(np.int64)
    return places


def _spelled(words: Words, letters: int) -> bytes:
    """A name from its first eight characters and its last eight, where there are more."""
    first, *more = (int(word).to_bytes(8, "little") for word in words)
    return first[:letters] + b"".join(last[16 - letters :] for last in more)


def _require_few(names: dict[str, int]) -> None:
    if len(names) >= _NO_NAME:
        raise RecordingError(
            "candump text",
            f"{_NO_NAME} names of buses and more",
            "remove the lines that are not frames",
        )


class ChunkSequence:
    """State passed from one chunk to the next: names, line numbers and the clock.

    Args:
        report: Statistics, filled with the chunks.
        differences: Whether stamps are differences, to be summed.

    """

    def __init__(self, report: ReadReport, *, differences: bool) -> None:
        self._report = report
        self._differences = differences
        self._names: dict[str, int] = {}
        self._lines = self._clock_us = self._last_us = 0

    def follow(self, parsed: ParsedChunk) -> Block:
        """The next chunk's rows as they stand in the recording."""
        for row, line_kind, is_whole in parsed.skipped:
            self._report.skip(line_kind, self._lines + row + 1, is_whole=is_whole)
        self._lines += parsed.lines
        block = self._renamed(parsed.block)
        frames = block.kind < Kind.ADVANCE
        if self._differences:
            block = self._summed(block, frames)
        for kind, name in _NAMES.items():
            if count := np.count_nonzero(block.kind == kind):
                self._report.kinds[name] += int(count)
        self._count_backwards(block.t_ns if frames.all() else block.t_ns[frames])
        return block

    def _renamed(self, block: Block) -> Block:
        """Channels of the block in their places among those of the recording."""
        new = [name for name in block.channels if name not in self._names]
        if len(new) > 1:  # in the order of the file, however the chunk was read
            place = {name: number for number, name in enumerate(block.channels)}
            frames = block.kind < Kind.ADVANCE
            new.sort(key=lambda name: int(((block.channel == place[name]) & frames).argmax()))
        for name in new if self._names else new or [""]:  # marks alone have a bus without a name
            self._names[name] = len(self._names)
        _require_few(self._names)
        channels = tuple(self._names)
        if block.channels == channels[: len(block.channels)]:
            return replace(block, channels=channels)
        numbers = np.array([self._names[name] for name in block.channels], np.uint16)
        channel = numbers[block.channel]
        channel[block.kind >= Kind.ADVANCE] = 0
        return replace(block, channel=channel, channels=channels)

    def _summed(self, block: Block, frames: NDArray[np.bool_]) -> Block:
        """Stamps of frames as sums of the differences that were read."""
        steps = to_micros(block.t_ns[frames])
        sums = accumulate(steps.tolist(), add_difference, initial=self._clock_us)
        clock = np.fromiter(sums, np.int64, len(steps) + 1)
        self._clock_us = int(clock[-1])
        t_ns = block.t_ns.copy()
        t_ns[frames] = clock[1:] * 1000
        return replace(block, t_ns=t_ns)

    def _count_backwards(self, t_ns: NDArray[np.int64]) -> None:
        if not len(t_ns):
            return
        # Stamps in µs can only fall where those in ns do.
        falls = np.flatnonzero(t_ns[1:] < t_ns[:-1])
        if len(falls):
            fallen = to_micros(t_ns[falls + 1]) < to_micros(t_ns[falls])
            self._report.backwards += int(fallen.sum())
        first, last = to_micros(t_ns[[0, -1]]).tolist()
        self._report.backwards += first < self._last_us
        self._last_us = last


def read_chunks(
    chunks: Iterable[Chunk], report: ReadReport, *, differences: bool
) -> Iterator[tuple[Block, int]]:
    """Blocks of the chunks of a file, in order, each with the chunk's position.

    Args:
        chunks: Chunks of one file, in order.
        report: Statistics, filled as blocks are given.
        differences: Whether stamps are differences, to be summed.

    """
    # glibc keeps freed memory up to twice the largest array freed so far, and gives back the rest.
    # Without this one, whose pages are never touched, the kernel clears those of every column anew,
    # which takes as long as all the reading.
    np.empty(_FREED, np.uint8)
    sequence = ChunkSequence(report, differences=differences)
    layouts: tuple[Layout, ...] = ()
    for chunk in chunks:
        parsed = parse_chunk(chunk, layouts)
        layouts = parsed.layouts
        block = sequence.follow(parsed)
        if len(block):
            yield block, chunk.position
