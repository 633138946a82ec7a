"""Text of frames in columns: chunks of whole lines in, `Block`s out.

Lines that look alike are read many at a time (`matching`), all others one by one by their form.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block, Kind
from adhesion_can.bus.frame import Frame, Mark
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.candump import ReadReport
from adhesion_can.recordings.frame_rows import FrameCounter, NumberedBuses
from adhesion_can.recordings.text_columns.ascii_numbers import WORD, Words
from adhesion_can.recordings.text_columns.form import Form
from adhesion_can.recordings.text_columns.line_layouts import Layout
from adhesion_can.recordings.text_columns.matching import MatchedLines, Places, match_lines
from adhesion_can.recordings.text_columns.text_source import FRONT, LINE_LIMIT, Chunk, Text

_FEW = 24  # lines that are read one by one sooner than all at once
_LAYOUTS = 64  # of one chunk; past them its lines are read one by one
_NOTHING = 0xFF  # kind of a line that gives no row
_NO_NAME = 0xFFFF  # channel of a line whose characters there are no name
_FREED = 1 << 24  # bytes of an array that is allocated and freed at once; see `read_text`
_CR, _LF = ord("\r"), ord("\n")


def read_text(
    chunks: Iterable[Chunk], form: Form, report: ReadReport
) -> Iterator[tuple[Block, int]]:
    """Blocks of the chunks of a file, in order, each with the chunk's position.

    Args:
        chunks: Chunks of one file, in order.
        form: Form of its lines.
        report: Statistics, filled as blocks are given.

    """
    # glibc keeps freed memory up to twice the largest array freed so far, and gives back the rest.
    # Without this one, whose pages are never touched, the kernel clears those of every column anew,
    # which takes as long as all the reading.
    np.empty(_FREED, np.uint8)
    parser, counter = ChunkParser(form, report), FrameCounter(report, form.least_first_us)
    for chunk in chunks:
        block = form.stamped(parser.parse(chunk))
        if len(block):
            counter.add(block)
            yield block, chunk.position
    form.tell(report)


class ChunkParser:
    """Parser of one chunk after the other.

    Args:
        form: Form of the lines.
        report: Statistics, in which lines without a frame are counted.

    """

    def __init__(self, form: Form, report: ReadReport) -> None:
        self._form, self._report = form, report
        self._names: list[str] = []
        self._numbers: dict[str, int] = {}
        self._buses = NumberedBuses(self._names.__getitem__)
        self._layouts: list[Layout] = []
        self._lines = 0

    def parse(self, chunk: Chunk) -> Block:
        """Rows of the next chunk."""
        if self._form.ends_at_cr:
            _end_lines_at_cr(chunk.text[FRONT : chunk.stop])
        lines = _Lines(chunk)
        left, single = np.arange(lines.count), []
        used: Counter[Layout] = Counter()
        layouts = self._layouts
        tried = 0
        while len(left) >= _FEW and tried < _LAYOUTS:
            if tried == len(layouts):
                row = int(left[0])
                learnt = self._form.find_layout(lines.line(row))
                if learnt is None or learnt in layouts:
                    single.append(row)
                    left = left[1:]
                    continue
                layouts.append(learnt)
            layout = layouts[tried]
            tried += 1
            unlike = self._read_alike(lines, layout, left)
            if len(unlike) < len(left):
                used[layout] = len(left) - len(unlike)
            left = unlike
        # Those that fit most lines are tried first in the next chunk.
        self._layouts = [layout for layout, _ in used.most_common()]
        self._read_single(lines, [*single, *left.tolist()])
        self._lines += lines.count
        return self._buses.named(lines.block())

    def _read_alike(self, lines: "_Lines", layout: Layout, rows: Places) -> Places:
        """Read the lines that fit a layout; give the rows that do not."""
        first, stop = int(rows[0]), int(rows[-1]) + 1
        chosen: slice | Places = slice(first, stop) if len(rows) == stop - first else rows
        matched = match_lines(layout, lines.text, lines.starts[chosen], lines.ends[chosen])
        if matched is None:
            return rows
        channel = self._channels(layout, matched)
        known = channel != _NO_NAME
        if not known.all():
            matched, channel = matched.select(known), channel[known]
        if matched.rows is None:
            lines.put(chosen, matched, layout.kind, channel)
            return rows[:0]
        lines.put(rows[matched.rows], matched, layout.kind, channel)
        return np.delete(rows, matched.rows)

    def _channels(self, layout: Layout, matched: MatchedLines) -> NDArray[np.uint16]:
        """Numbers of the lines' buses, `_NO_NAME` where their characters are none, shape (n,)."""
        channel = np.zeros(len(matched.t_ns), np.uint16)
        if layout.kind >= Kind.ADVANCE:
            return channel
        if not layout.name:
            channel[:] = self._channel_number(b"")
            return channel
        todo = np.ones(len(channel), np.bool_)
        while todo.any():
            name = matched.names[:, todo.argmax()]
            same = matched.names[0] == name[0]
            for words, word in zip(matched.names[1:], name[1:], strict=True):
                same &= words == word
            np.putmask(channel, same, self._channel_number(_spelled(name, layout.letters)))
            np.greater(todo, same, out=todo)
        return channel

    def _channel_number(self, text: bytes) -> int:
        name = self._form.bus_name(text)
        return _NO_NAME if name is None else self._number(name)

    def _number(self, name: str) -> int:
        number = self._numbers.setdefault(name, len(self._names))
        if number == len(self._names):
            self._names.append(name)
        if len(self._names) >= _NO_NAME:
            raise RecordingError(
                "text of frames",
                f"{_NO_NAME} names of buses and more",
                "remove the lines that are not frames",
            )
        return number

    def _read_single(self, lines: "_Lines", rows: list[int]) -> None:
        """Read lines one by one, and count those without a frame."""
        places: list[int] = []
        items: list[Frame | Mark] = []
        stamps: list[int] = []
        texts = list(map(lines.line, rows))
        for row, text, (item, t_ns) in zip(rows, texts, self._form.read(texts), strict=True):
            if isinstance(item, Frame | Mark):
                places.append(row)
                items.append(item)
                stamps.append(t_ns)
            elif item is not None:
                number = self._lines + row + 1
                self._report.skip(item, number, is_whole=text.endswith(b"\n"))
        if items:
            block = Block.from_frames(items).stamped(np.array(stamps, np.int64))
            frames = (item for item in items if isinstance(item, Frame))
            numbers = [self._number(name) for name in dict.fromkeys(f.channel for f in frames)]
            channel = np.array(numbers or [0], np.uint16)[block.channel]
            lines.put(np.array(places), block, block.kind, channel)


class _Lines:
    """Lines of a chunk, and the columns that they fill.

    Args:
        chunk: Whole lines.

    """

    def __init__(self, chunk: Chunk) -> None:
        self.text = chunk.text
        self.starts, self.ends = find_lines(chunk.text, chunk.stop)
        self.count = count = len(self.ends)
        self._t_ns = np.empty(count, np.int64)
        self._key = np.empty(count, np.uint32)
        self._kind = np.full(count, _NOTHING, np.uint8)
        self._length = np.empty(count, np.uint8)
        self._channel = np.zeros(count, np.uint16)
        self._words = np.empty((count, 1), np.uint64)

    def line(self, row: int) -> bytes:
        """Characters of a line, with its end."""
        return self.text[self.starts[row] : self.starts[row + 1]].tobytes()

    def put(
        self,
        rows: slice | Places,
        matched: MatchedLines | Block,
        kind: int | NDArray[np.uint8],
        channel: NDArray[np.uint16],
    ) -> None:
        """Fill rows, whose `channel` is the numbers of their buses."""
        width = 8 if (matched.length > 8).any() else 1
        missing = width - self._words.shape[1]
        if missing > 0:
            self._words = np.pad(self._words, ((0, 0), (0, missing)))
        self._t_ns[rows] = matched.t_ns
        self._key[rows] = matched.key
        self._kind[rows] = kind
        self._length[rows] = matched.length
        self._channel[rows] = channel
        self._words[rows, :width] = matched.words[:, :width]

    def block(self) -> Block:
        """The rows that were filled; their `channel` has the numbers of buses."""
        block = Block(
            t_ns=self._t_ns,
            key=self._key,
            kind=self._kind,
            length=self._length,
            channel=self._channel,
            words=self._words,
            channels=(),
        )
        filled = self._kind != _NOTHING
        return block if filled.all() else block.select(filled)


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
    is_feed = np.zeros(-(-len(text) // 8) * 8, np.bool_)
    np.equal(text, ord("\n"), out=is_feed[: len(text)])
    # Words that hold one are found first: a walk over bytes that few of are true is slower.
    words = is_feed.view(WORD)
    places = np.flatnonzero(words != 0)
    held = words[places]
    if (held & (held - np.uint64(1))).any():
        return np.flatnonzero(is_feed)  # lines of less than 8 characters
    # A word is 256 ** k: times this it has k in its highest byte.
    held *= np.uint64(0x0001020304050607)
    held >>= np.uint64(56)
    places *= 8
    places += held.view(np.int64)
    return places


def _end_lines_at_cr(text: Text) -> None:
    """Make a CR that no LF follows the end of a line, as Python's text files do; in place."""
    places = np.flatnonzero(text == _CR)
    if len(places):
        following = text[np.minimum(places + 1, len(text) - 1)]
        text[places[following != _LF]] = _LF


def _spelled(words: Words, letters: int) -> bytes:
    """A name of `letters` characters from its words, the last one first."""
    return b"".join(int(word).to_bytes(8, "little") for word in words[::-1])[-letters:]
