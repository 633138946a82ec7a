"""Lines of a chunk that fit a layout, read all at once, as columns.

A line that differs in any character is left to a reader of single lines.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import EXTENDED, Kind
from adhesion_can.recordings.candump import FD_LENGTHS, LAST_US
from adhesion_can.recordings.text_columns.ascii_numbers import (
    WORD,
    Words,
    decimal,
    fill_blanks,
    hexadecimal,
    keep,
    zeros_outside,
)
from adhesion_can.recordings.text_columns.line_layouts import Layout
from adhesion_can.recordings.text_columns.text_source import FRONT, Text

Places = NDArray[np.int64]

_MOST_DIGITS = 2 * max(FD_LENGTHS)
_BLANKS = np.zeros(256, np.bool_)
_BLANKS[[*b" \t\r\n"]] = True
"""Characters that may follow a payload of a known length."""


@dataclass(frozen=True, slots=True)
class MatchedLines:
    """Columns of the lines that fit a layout.

    Attributes:
        rows: Indices of the lines that fit, shape (n,); None for all of them.
        t_ns: Time stamps, ns, shape (n,).
        key: Arbitration ids, with `EXTENDED` where they have 29 bits; 0 for marks; shape (n,).
        length: Lengths of the payloads, bytes, shape (n,).
        words: Payloads as 64-bit words, shape (n, w).
        names: Characters of the names of the buses as words, shape (k, n), in the order of
            `Layout.name`.

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


def match_lines(layout: Layout, text: Text, starts: Places, ends: Places) -> MatchedLines | None:
    """The lines that fit a layout in every character.

    Args:
        layout: Layout of the lines.
        text: Characters of the chunk.
        starts: Positions of the lines in `text`, shape (n,).
        ends: Positions past the last character of each line, its line feed left out, shape (n,).

    """
    rows = None
    # Those that are long enough first: only their characters lie within the text.
    alike = _ended(layout, text, starts, ends)
    if not alike.all():
        rows = np.flatnonzero(alike)
        if not len(rows):
            return None
        starts, ends = starts[rows], ends[rows]
    lines = gather(text, starts - FRONT, layout.reach)
    alike = _fits(layout, lines)
    if not alike.all():
        places = np.flatnonzero(alike)
        if not len(places):
            return None
        rows = places if rows is None else rows[places]
        lines, starts, ends = lines[places], starts[places], ends[places]
    t_ns, good = _stamps(layout, lines)
    key, right = _keys(layout, lines)
    good &= right
    if layout.length is None:
        length, words, right = _payloads(layout, text, starts, ends)
    else:
        length, words, right = _spaced_payloads(layout.payload, layout.length, lines)
    good &= right
    matched = MatchedLines(rows, t_ns, key, length, words, _names(layout, lines))
    return matched if good.all() else matched.select(good)


def _ended(layout: Layout, text: Text, starts: Places, ends: Places) -> NDArray[np.bool_]:
    """Whether a line is long enough and has an end of its payload that is allowed, shape (n,)."""
    rest = ends - starts
    rest -= layout.size + len(layout.tail)
    if layout.length is None:
        ended = rest >= 0
        if layout.tail:
            ended &= _ends_with(layout.tail, text, ends)
        return np.asarray(ended)
    ended = rest == 0
    if not layout.is_last:
        following = text[np.minimum(starts + layout.size, len(text) - 1)]
        ended |= (rest > 0) & _BLANKS[following]
    return np.asarray(ended)


def _ends_with(tail: bytes, text: Text, ends: Places) -> NDArray[np.bool_]:
    (words,) = _words_of(gather(text, ends - 8, 8)).T
    words &= keep(8 - len(tail), len(tail))
    spelled = (tail, tail.replace(b"R", b"T"))
    first, second = (int.from_bytes(way.rjust(8, b"\0"), "little") for way in spelled)
    return np.asarray((words == np.uint64(first)) | (words == np.uint64(second)))


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


def _word(lines: NDArray[np.void], offset: int) -> Words:
    return lines.view(_at(offset, lines.itemsize))["word"]


@cache
def _at(offset: int, size: int) -> np.dtype[np.void]:
    return np.dtype({"names": ["word"], "formats": [WORD], "offsets": [offset], "itemsize": size})


def _fits(layout: Layout, lines: NDArray[np.void]) -> NDArray[np.bool_]:
    """Whether a line has the fixed characters of the layout, shape (n,)."""
    differs = np.zeros(len(lines), WORD)
    word = np.empty(len(lines), WORD)
    for offset, characters, mask in layout.fixed:
        word[:] = _word(lines, offset)
        word ^= characters
        word &= mask
        differs |= word
    return np.asarray(differs == 0)


def _names(layout: Layout, lines: NDArray[np.void]) -> Words:
    """Words of the names of the buses, shape (k, n)."""
    words = np.empty((len(layout.name), len(lines)), WORD)
    for row, (offset, mask) in zip(words, layout.name, strict=True):
        np.bitwise_and(_word(lines, offset), mask, out=row)
    return words


def _stamps(layout: Layout, lines: NDArray[np.void]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Stamps in ns, and whether all numbers are some and the stamps in range, shapes (n,)."""
    numbers = layout.numbers
    words = np.empty((len(numbers), len(lines)), WORD)
    padding = np.zeros(len(lines), WORD)
    for row, digits in zip(words, numbers, strict=True):
        row[:] = _word(lines, digits.offset)
        if digits.blanks:
            padding |= fill_blanks(row, digits.mask, digits.blanks)
    values, wrong = decimal(words, np.array([[digits.mask] for digits in numbers], WORD))
    values *= np.array([[digits.worth] for digits in numbers], WORD)
    t_ns = values.sum(0)
    good = np.bitwise_or.reduce(wrong) == 0
    good &= padding == 0
    good &= t_ns <= np.uint64(LAST_US * 1000 - layout.start_ns)
    since = t_ns.view(np.int64)
    since += layout.start_ns
    return since, good


def _keys(layout: Layout, lines: NDArray[np.void]) -> tuple[NDArray[np.uint32], NDArray[np.bool_]]:
    """Keys, and whether the id is one of the layout, shapes (n,)."""
    words = np.empty((len(layout.hexes), len(lines)), WORD)
    for row, (offset, mask) in zip(words, layout.hexes, strict=True):
        row[:] = _word(lines, offset)
        zeros_outside(row, mask)
    octets, wrong = hexadecimal(words)
    key = octets[0].view(">u4").astype(np.uint32)
    right = np.bitwise_or.reduce(wrong) == 0
    right &= key <= layout.last_id
    if layout.is_extended:
        key |= np.uint32(EXTENDED)
    return key, right


def _payloads(
    layout: Layout, text: Text, starts: Places, ends: Places
) -> tuple[NDArray[np.uint8], Words, NDArray[np.bool_]]:
    """Lengths in bytes, payloads as words, and whether each is valid: (n,), (n, w), (n,).

    The payloads reach to the ends of their lines.
    """
    digits = ends - starts
    digits -= layout.payload + len(layout.tail)
    np.minimum(digits, _MOST_DIGITS + 1, out=digits)
    right = _digit_counts(layout.kind)[digits]
    length = digits.astype(np.uint8)
    length >>= 1
    most = 2 if layout.kind is Kind.DATA else _MOST_DIGITS // 8
    width = min(-(-max(int(digits.max()), 16) // 16) * 2, most)
    characters = _words_of(gather(text, starts + layout.payload, 8 * width))
    if not (digits == 8 * width).all():
        zeros_outside(characters, _words_of(_kept(width)[digits]))
    octets, wrong = hexadecimal(characters)
    if wrong.any():
        right &= ~wrong.any(axis=1)
    words = octets.view(WORD)
    return length, words if width == 2 else np.pad(words, ((0, 0), (0, 8 - width // 2))), right


def _spaced_payloads(
    payload: int, length: int, lines: NDArray[np.void]
) -> tuple[NDArray[np.uint8], Words, NDArray[np.bool_]]:
    """The same of payloads of one length, with a character between two bytes."""
    count = len(lines)
    digits = np.full((count, 16 if length <= 8 else _MOST_DIGITS), ord("0"), np.uint8)
    octets = np.ascontiguousarray(lines).view(np.uint8).reshape(count, -1)[:, FRONT + payload :]
    digits[:, : 2 * length : 2] = octets[:, : 3 * length : 3]
    digits[:, 1 : 2 * length : 2] = octets[:, 1 : 3 * length : 3]
    words, wrong = hexadecimal(digits.view(WORD))
    right = np.asarray(~wrong.any(axis=1))
    return np.full(count, length, np.uint8), words.view(WORD), right


@cache
def _digit_counts(kind: Kind) -> NDArray[np.bool_]:
    """Whether a payload can have 0, 1, .. digits, shape (130,); the last entry is False."""
    allowed = np.zeros(_MOST_DIGITS + 2, np.bool_)
    octets = {Kind.DATA: range(9), Kind.FD: FD_LENGTHS}.get(kind, (0,))
    allowed[[2 * count for count in octets]] = True
    return allowed


@cache
def _kept(width: int) -> NDArray[np.void]:
    """Masks of the first 0, 1, .. characters of payloads in `width` words, shape (130,)."""
    places = np.arange(8 * width)
    kept = places < np.arange(_MOST_DIGITS + 2)[:, None]
    return np.where(kept, np.uint8(0xFF), np.uint8(0)).view(f"V{8 * width}")[:, 0]
