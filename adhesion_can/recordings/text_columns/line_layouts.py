"""Lines of text that look alike, read all at once.

A line whose form is known teaches a layout: where the digits of its stamp, the name of its bus, its
id and its payload stand. All the lines of a chunk that have the same characters everywhere else are
read together, as columns. A line that differs in any other character is left to a reader of single
lines.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

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
from adhesion_can.recordings.text_columns.text_source import FRONT, Text

Places = NDArray[np.int64]

LAST_ID = 0x1FFFFFFF
_MOST_DIGITS = 2 * max(FD_LENGTHS)
_BLANKS = np.zeros(256, np.bool_)
_BLANKS[[*b" \t\r\n"]] = True
"""Characters that may follow a payload of a known length."""


class Digits(NamedTuple):
    """Decimal digits in a word of every line.

    Attributes:
        offset: Offset of the word.
        mask: Bytes that hold digits.
        worth: Worth of the last digit in the stamp, ns; 0 where the number is not used.
        blanks: Lowest bit of the first digit where the number may be padded with spaces, else 0.

    """

    offset: int
    mask: np.uint64
    worth: np.uint64
    blanks: np.uint64


@dataclass(frozen=True, slots=True)
class Layout:
    """Positions of the parts of a line; offsets count from `FRONT` bytes before the line.

    Attributes:
        kind: Kind of the lines.
        size: Number of characters up to which the lines are alike: to the payload where its length
            is open, else to its end, or to that of the line where it `is_last`.
        fixed: Words whose characters are the same in every line, as (offset, characters, mask).
        numbers: Decimal numbers, those of the stamp and others.
        start_ns: Time from which the stamp counts, ns.
        name: Words that together hold the name of the bus, the last one first, as (offset, mask).
        letters: Number of characters of the name; 0 where the lines have none.
        hexes: Words of hex digits, the id first, as (offset, mask).
        last_id: Highest id.
        is_extended: Whether the id has 29 bits.
        payload: Number of characters in front of the payload.
        step: Number of characters from one byte of the payload to the next, two of them digits.
        length: Length of the payload, bytes; None where it reaches to the end of the line.
        is_last: Whether nothing follows a payload of a known length.
        tail: Characters behind a payload of open length; ' R' means ' T' too.

    """

    kind: Kind
    size: int
    fixed: tuple[tuple[int, np.uint64, np.uint64], ...]
    numbers: tuple[Digits, ...]
    start_ns: int
    name: tuple[tuple[int, np.uint64], ...]
    letters: int
    hexes: tuple[tuple[int, np.uint64], ...]
    last_id: int
    is_extended: bool
    payload: int
    step: int
    length: int | None
    is_last: bool
    tail: bytes

    @property
    def reach(self) -> int:
        """Number of bytes from `FRONT` bytes before a line on that hold its first `size` ones."""
        return FRONT + -(-self.size // 8) * 8


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


# --- learning a layout ---------------------------------------------------------------------------


def learn_layout(
    match: re.Match[bytes],
    *,
    kind: Kind,
    unit_ns: int,
    is_extended: bool,
    start_ns: int = 0,
    last_id: int = LAST_ID,
    length: int | None = None,
    is_last: bool = False,
) -> Layout | None:
    """Layout of a line; None where its payload is of another length than it says.

    Args:
        match: Match from the start of the line on, with the groups `whole`, `fraction`, `id`,
            `data` and, where the format has them, `bus`, `number`, `flag` (a hex digit), `length`
            and `tail`.
        kind: Kind of the row.
        unit_ns: Unit of the stamp, ns.
        is_extended: Whether the id has 29 bits.
        start_ns: Time from which the stamp counts, ns, at most `LAST_US`.
        last_id: Highest id.
        length: Length of the payload as the line says it, bytes, with a character between two of
            its bytes; None where they stand side by side and reach to the end of the line.
        is_last: Whether nothing but white space may follow a payload of a known length.

    """
    line = match.string
    data = match["data"] or b""
    blank = len(data) - len(data.lstrip()) if length else 0
    payload = match.start("data") + blank
    size, free = payload, set[int]()
    if length is not None:
        needed, stored = max(3 * length - 1, 0), len(data) - blank
        if stored < needed or (is_last and stored > needed):
            return None
        size = payload + needed if length else match.end("length")
        if is_last:  # white space behind the payload is a part of the line
            size = len(line.rstrip(b"\n"))
        free = {payload + 3 * n + digit for n in range(length) for digit in (0, 1)}
    whole, bus, number = (_padded(line, _span(match, name)) for name in ("whole", "bus", "number"))
    fraction, identifier, flag = (_span(match, name) for name in ("fraction", "id", "flag"))
    for span in (whole, fraction, bus, number, identifier, flag):
        free |= {*range(*span)}
    stamp = _digits(line, whole, unit_ns)
    stamp += _digits(line, fraction, unit_ns // 10 ** (fraction[1] - fraction[0]))
    return Layout(
        kind=kind,
        size=size,
        fixed=_fixed(line[:size], free),
        numbers=(*stamp, *_digits(line, number, 0)),
        start_ns=start_ns,
        name=tuple(_words_of_span(bus)),
        letters=bus[1] - bus[0],
        hexes=(*_words_of_span(identifier), *_words_of_span(flag)),
        last_id=last_id,
        is_extended=is_extended,
        payload=payload,
        step=2 if length is None else 3,
        length=length,
        is_last=is_last,
        tail=match["tail"].replace(b"T", b"R") if length is None else b"",
    )


def _span(match: re.Match[bytes], name: str) -> tuple[int, int]:
    """Span of a group; an empty one where the form or the line has none."""
    return match.span(name) if match.re.groupindex.get(name) and match[name] else (0, 0)


def _padded(line: bytes, span: tuple[int, int]) -> tuple[int, int]:
    """Span of a number of a line with the spaces that pad it, as far as they fit a word."""
    start, end = span
    front = line[:start]
    stripped = front.rstrip(b" ")
    first = len(stripped) + 1 if stripped else 0  # a space stands between two fields
    return (min(start, max(first, end - 8)), end) if first < start else span


def _words_of_span(span: tuple[int, int]) -> Iterable[tuple[int, np.uint64]]:
    """Words of a span's characters, eight at a time from its end on, as (offset, mask)."""
    start, end = span
    while end > start:
        count = min(end - start, 8)
        yield FRONT + end - 8, keep(8 - count, count)
        end -= 8


def _digits(line: bytes, span: tuple[int, int], worth: int) -> list[Digits]:
    """Words of the digits of a span, whose last one has a worth."""
    is_padded = line[span[0] : span[0] + 1] == b" "
    words = []
    for offset, mask in _words_of_span(span):
        lowest = mask & ~(mask << np.uint64(1))
        words.append(Digits(offset, mask, np.uint64(worth), lowest if is_padded else np.uint64(0)))
        worth *= 10**8
    return words


def _fixed(head: bytes, free: set[int]) -> tuple[tuple[int, np.uint64, np.uint64], ...]:
    """As few words as hold every character of a line's head that is not free."""
    words = []
    places = sorted({*range(len(head))} - free)
    last = -(-len(head) // 8) * 8 - 8
    while places:
        first = min(places[0], last)
        inside = [place for place in places if place < first + 8]
        characters, mask = bytearray(8), bytearray(8)
        for place in inside:
            characters[place - first], mask[place - first] = head[place], 0xFF
        word, kept = (np.uint64(int.from_bytes(part, "little")) for part in (characters, mask))
        words.append((FRONT + first, word, kept))
        places = places[len(inside) :]
    return tuple(words)


# --- reading the lines of a layout ---------------------------------------------------------------


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
    length, words, right = _payloads(layout, text, starts, ends)
    good &= right
    found = MatchedLines(rows, t_ns, key, length, words, _names(layout, lines))
    return found if good.all() else found.select(good)


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
    """Lengths in bytes and payloads as words, shapes (n,), (n, w), and whether each is valid.

    The last one has the shape (1,) where all of them are.
    """
    if layout.length is None:
        digits = ends - starts
        digits -= layout.payload + len(layout.tail)
        np.minimum(digits, _MOST_DIGITS + 1, out=digits)
    else:
        digits = np.array([2 * layout.length])
    right = _digit_counts(layout.kind)[digits]
    length = np.broadcast_to((digits >> 1).astype(np.uint8), len(starts))
    most = 2 if layout.kind is Kind.DATA else _MOST_DIGITS // 8
    width = min(-(-max(int(digits.max()), 16) // 16) * 2, most)
    gathered = gather(text, starts + layout.payload, 4 * width * layout.step)
    if layout.step == 2:
        characters = _words_of(gathered)
    else:
        octets = np.require(gathered, requirements=("C", "O")).view(np.uint8)
        pairs = octets.reshape(-1, layout.step)[:, :2]
        characters = pairs.reshape(-1, 8 * width).view(WORD)
    if not (digits == 8 * width).all():
        zeros_outside(characters, _words_of(_kept(width)[digits]))
    octets, wrong = hexadecimal(characters)
    if wrong.any():
        right = right & ~wrong.any(axis=1)
    words = octets.view(WORD)
    return length, words if width == 2 else np.pad(words, ((0, 0), (0, 8 - width // 2))), right


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
