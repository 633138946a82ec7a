"""Lines of candump text that look alike, read all at once.

A `Layout` holds the positions of the parts of a line: the digits of the stamp, the length of the
name of the bus, and so on. All the lines of a chunk that fit one are read together, as columns; a
line that differs in any character is left to `candump.parse_line`.
"""

import re
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.bus.frame import MARKS, Mark
from adhesion_can.recordings.candump import FD_LENGTHS, LAST_US
from adhesion_can.recordings.candump_columns.ascii_numbers import (
    WORD,
    Words,
    decimal,
    hexadecimal,
    keep,
    zeros_outside,
)
from adhesion_can.recordings.candump_columns.text_source import FRONT, Text

Places = NDArray[np.int64]

_HEAD = 64  # bytes of a line looked at in front of its payload, FRONT bytes before it included
_LAST_NS = np.uint64(LAST_US * 1000)

_FRAME = re.compile(
    rb"\((\d{1,10})\.(\d{1,9})\) (\S{1,16}) ([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(#[0-9A-Fa-f])?"
    rb"[0-9A-Fa-f]{0,128}( [RT])?(\r?)\n?"
)
_MARK = re.compile(rb"<(\d{1,10})\.(\d{6})> ([a-z-]{1,16}) 000#(\r?)\n?")


@dataclass(frozen=True, slots=True)
class Layout:
    """Positions of the parts of a line; offsets count from `FRONT` bytes before the line.

    Attributes:
        kind: Kind of the lines.
        size: Number of characters in front of the payload.
        fixed: Words whose characters are the same in every line, as (offset, characters, mask).
        stamp: Words of decimal digits, as (offset, mask, ns of the last digit).
        name: Words that together hold the name of the bus, as (offset, mask).
        letters: Number of characters of the name.
        digits: Number of hex digits of the id; 0 in a mark.
        hexes: Words of hex digits (the id, and the flags of CAN FD), as (offset, mask).
        tail: Characters behind the payload; ' R' means ' T' too.

    """

    kind: Kind
    size: int
    fixed: tuple[tuple[int, np.uint64, np.uint64], ...]
    stamp: tuple[tuple[int, np.uint64, np.uint64], ...]
    name: tuple[tuple[int, np.uint64], ...] = ()
    letters: int = 0
    digits: int = 0
    hexes: tuple[tuple[int, np.uint64], ...] = ()
    tail: bytes = b""


@dataclass(frozen=True, slots=True)
class MatchedLines:
    """Columns of the lines that fit a layout.

    Attributes:
        rows: Indices of the lines that fit, shape (n,); None for all of them.
        t_ns: Time stamps, ns, shape (n,).
        key: Arbitration ids, with `EXTENDED` where they have 29 bits; 0 for marks; shape (n,).
        length: Lengths of the payloads, bytes, shape (n,).
        words: Payloads as 64-bit words, shape (n, w).
        names: Characters of the names of the buses as words, shape (k, n); k = 0 for marks.

    """

    rows: Places | None
    t_ns: NDArray[np.int64]
    key: NDArray[np.uint32]
    length: NDArray[np.uint8]
    words: Words
    names: Words

    def select(self, chosen: NDArray[np.bool_]) -> "MatchedLines":
        """The lines that a mask selects."""
        places = np.flatnonzero(chosen)
        return MatchedLines(
            rows=places if self.rows is None else self.rows[places],
            t_ns=self.t_ns[places],
            key=self.key[places],
            length=self.length[places],
            words=self.words[places],
            names=self.names[:, places],
        )


def find_layout(line: bytes) -> Layout | None:
    """Layout of a line; None where only `parse_line` can read it."""
    if match := _FRAME.fullmatch(line):
        return _frame_layout(match)
    if (match := _MARK.fullmatch(line)) and match[3].decode() in MARKS:
        return _mark_layout(match)
    return None


def _frame_layout(match: re.Match[bytes]) -> Layout:
    name_at, letters = match.start(3), len(match[3])
    id_end, digits = match.end(4), len(match[4])
    size = id_end + 1 + len(match[5] or b"")
    free = _digit_places(match) | {*range(name_at, name_at + letters)}
    free |= {*range(id_end - digits, id_end)}
    hexes = [(_ending(id_end), keep(8 - digits, digits))]
    if match[5]:
        free.add(size - 1)
        hexes.append((_ending(size), keep(7, 1)))
    name = [(FRONT + name_at, keep(0, min(letters, 8)))]
    if letters > 8:
        name.append((_ending(name_at + letters), keep(0, 8)))
    return Layout(
        kind=Kind.FD if match[5] else Kind.DATA,
        size=size,
        fixed=_fixed(match[0][:size], free),
        stamp=_stamp(match),
        name=tuple(name),
        letters=letters,
        digits=digits,
        hexes=tuple(hexes),
        tail=(b" R" if match[6] else b"") + match[7],
    )


def _mark_layout(match: re.Match[bytes]) -> Layout:
    (kind,) = Block.from_frames([Mark(0, match[3].decode())]).kind.tolist()
    head = match[0].rstrip()
    return Layout(
        kind=Kind(kind),
        size=len(head),
        fixed=_fixed(head, _digit_places(match)),
        stamp=_stamp(match),
        tail=match[4],
    )


def _ending(end: int) -> int:
    """Offset of the word whose last character stands in front of `end`."""
    return FRONT + end - 8


def _digit_places(match: re.Match[bytes]) -> set[int]:
    return {*range(*match.span(1)), *range(*match.span(2))}


def _stamp(match: re.Match[bytes]) -> tuple[tuple[int, np.uint64, np.uint64], ...]:
    """The words of a stamp: the seconds in words that end with them, the fraction from the left."""
    seconds, fraction = len(match[1]), len(match[2])
    second = 10**9
    low = min(seconds, 8)
    words = [(_ending(match.end(1)), keep(8 - low, low), np.uint64(second))]
    if seconds > 8:
        high = seconds - 8
        words.append((_ending(1 + high), keep(8 - high, high), np.uint64(10**8 * second)))
    words.append((FRONT + match.start(2), keep(0, min(fraction, 8)), np.uint64(10)))
    if fraction > 8:
        words.append((_ending(match.end(2)), keep(7, 1), np.uint64(1)))
    return tuple(words)


def _fixed(head: bytes, free: set[int]) -> tuple[tuple[int, np.uint64, np.uint64], ...]:
    """As few words as hold every character of a line's head that is not free."""
    words = []
    places = sorted({*range(len(head))} - free)
    while places:
        first = min(places[0], _HEAD - FRONT - 8)
        inside = [place for place in places if place < first + 8]
        characters, mask = bytearray(8), bytearray(8)
        for place in inside:
            characters[place - first], mask[place - first] = head[place], 0xFF
        word, kept = (np.uint64(int.from_bytes(part, "little")) for part in (characters, mask))
        words.append((FRONT + first, word, kept))
        places = places[len(inside) :]
    return tuple(words)


def match_lines(layout: Layout, text: Text, starts: Places, ends: Places) -> MatchedLines | None:
    """The lines that fit a layout in every character.

    Args:
        layout: Layout of the lines.
        text: Characters of the chunk.
        starts: Positions of the lines in `text`, shape (n,).
        ends: Positions past the last character of each line, its line end left out, shape (n,).

    """
    heads = gather(text, starts - FRONT, _HEAD)
    alike = _fits(layout, heads)
    rows = None
    if not alike.all():
        rows = np.flatnonzero(alike)
        if not len(rows):
            return None
        heads, starts, ends = heads[rows], starts[rows], ends[rows]
    t_ns, wrong = _stamps(layout, heads)
    good = wrong == 0
    good &= t_ns <= _LAST_NS
    if layout.tail:
        good &= _ends_with(layout.tail, text, ends)
    key, right = _keys(layout, heads)
    good &= right
    sizes = ends - starts
    sizes -= layout.size + len(layout.tail)
    length, words, right = _payloads(layout, text, starts + layout.size, sizes)
    good &= right
    found = MatchedLines(
        rows=rows,
        t_ns=t_ns.view(np.int64),
        key=key,
        length=length,
        words=words,
        names=_words_at(heads, layout.name),
    )
    return found if good.all() else found.select(good)


def gather(text: Text, places: Places, size: int) -> NDArray[np.void]:
    """`size` bytes from each place on, shape (n,); a view where the places are evenly spaced."""
    gaps = np.diff(places)
    if len(gaps) and (gaps == gaps[0]).all():
        return np.ndarray((len(places),), f"V{size}", text, int(places[0]), (int(gaps[0]),))
    everywhere = np.ndarray((len(text) - size + 1,), f"V{size}", text, 0, (1,))
    return everywhere[places]


def _words_of(rows: NDArray[np.void]) -> Words:
    """All words of gathered bytes, in memory of their own, shape (n, w)."""
    return np.require(rows, requirements=("C", "O")).view(WORD).reshape(len(rows), -1)


def _word(heads: NDArray[np.void], offset: int) -> Words:
    return heads.view(_at(offset))["word"]


@cache
def _at(offset: int) -> np.dtype[np.void]:
    return np.dtype({"names": ["word"], "formats": [WORD], "offsets": [offset], "itemsize": _HEAD})


def _words_at(heads: NDArray[np.void], places: tuple[tuple[int, np.uint64], ...]) -> Words:
    """Words of every head at some offsets, as masks leave them, shape (k, n)."""
    words = np.empty((len(places), len(heads)), WORD)
    for column, (offset, kept) in enumerate(places):
        np.bitwise_and(_word(heads, offset), kept, out=words[column])
    return words


def _fits(layout: Layout, heads: NDArray[np.void]) -> NDArray[np.bool_]:
    """Whether a line has the fixed characters of the layout, shape (n,)."""
    differs = np.zeros(len(heads), WORD)
    word = np.empty(len(heads), WORD)
    for offset, characters, mask in layout.fixed:
        word[:] = _word(heads, offset)
        word ^= characters
        word &= mask
        differs |= word
    return np.asarray(differs == 0)


def _stamps(layout: Layout, heads: NDArray[np.void]) -> tuple[Words, Words]:
    """Stamps in ns, and words that are not 0 where a character is no digit, shapes (n,)."""
    words = np.empty((len(layout.stamp), len(heads)), WORD)
    for row, (offset, _, _) in zip(words, layout.stamp, strict=True):
        row[:] = _word(heads, offset)
    kept = np.array([[mask] for _, mask, _ in layout.stamp], WORD)
    numbers, wrong = decimal(words, kept)
    numbers *= np.array([[unit] for _, _, unit in layout.stamp], WORD)
    return numbers.sum(0), np.bitwise_or.reduce(wrong)


def _keys(layout: Layout, heads: NDArray[np.void]) -> tuple[NDArray[np.uint32], NDArray[np.bool_]]:
    """Keys, and whether the id is one of a data frame, shapes (n,)."""
    if not layout.hexes:
        return np.zeros(len(heads), np.uint32), np.ones(len(heads), np.bool_)
    words = np.empty((len(layout.hexes), len(heads)), WORD)
    for row, (offset, mask) in zip(words, layout.hexes, strict=True):
        row[:] = _word(heads, offset)
        zeros_outside(row, mask)
    octets, wrong = hexadecimal(words)
    key = octets[0].view(">u4").astype(np.uint32)
    extended = layout.digits == 8
    right = np.bitwise_or.reduce(wrong) == 0
    right &= key <= (0x1FFFFFFF if extended else 0x7FF)  # past it stand the flags of error frames
    if extended:
        key |= np.uint32(EXTENDED)
    return key, right


def _payloads(
    layout: Layout, text: Text, places: Places, sizes: Places
) -> tuple[NDArray[np.uint8], Words, NDArray[np.bool_]]:
    """Lengths in bytes, payloads as words, and whether each is valid: (n,), (n, w), (n,)."""
    allowed = _sizes(layout.kind)
    bounded = sizes.clip(-1, len(allowed) - 1)
    right = allowed[bounded]
    length = bounded.astype(np.uint8)
    length >>= 1
    if layout.kind >= Kind.ADVANCE:
        return length, np.zeros((len(places), 1), np.uint64), right
    width = -(-max(int(bounded.max()), 16) // 16) * 2
    width = min(width, 2 if layout.kind is Kind.DATA else 16)
    characters = _words_of(gather(text, places, 8 * width))
    if not (bounded == 8 * width).all():
        zeros_outside(characters, _words_of(_kept(width)[bounded]))
    octets, wrong = hexadecimal(characters)
    if wrong.any():
        right &= ~wrong.any(axis=1)
    words = octets.view(WORD)
    return length, words if width == 2 else np.pad(words, ((0, 0), (0, 8 - width // 2))), right


@cache
def _sizes(kind: Kind) -> NDArray[np.bool_]:
    """Whether a payload can have 0, 1, .. characters, shape (130,); the last entry is False."""
    allowed = np.zeros(130, np.bool_)
    octets = {Kind.DATA: range(9), Kind.FD: FD_LENGTHS}.get(kind, (0,))
    allowed[[2 * count for count in octets]] = True
    return allowed


@cache
def _kept(width: int) -> NDArray[np.void]:
    """Masks of the first 0, 1, .. characters of payloads in `width` words, shape (130,)."""
    places = np.arange(8 * width)
    masks = np.where(places < np.arange(130)[:, None], np.uint8(0xFF), np.uint8(0))
    return masks.view(f"V{8 * width}")[:, 0]


def _ends_with(tail: bytes, text: Text, ends: Places) -> NDArray[np.bool_]:
    (words,) = _words_of(gather(text, ends - 8, 8)).T
    words &= keep(8 - len(tail), len(tail))
    spelled = (tail, tail.replace(b"R", b"T"))
    first, second = (int.from_bytes(way.rjust(8, b"\0"), "little") for way in spelled)
    return np.asarray((words == np.uint64(first)) | (words == np.uint64(second)))
