"""Lines of a trace that look alike, read all at once.

A line whose form is known teaches a layout: where the digits of its stamp, bus, id and payload
stand. The lines that have the same characters everywhere else are read together, as columns. A
layout has one length of payload, so that every line of it is alike up to the payload's end.
"""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.recordings.candump import LAST_US
from adhesion_can.recordings.candump_columns.ascii_numbers import (
    WORD,
    Words,
    decimal,
    hexadecimal,
    keep,
    zeros_outside,
)
from adhesion_can.recordings.candump_columns.line_layouts import Places, gather
from adhesion_can.recordings.candump_columns.text_source import FRONT, Text

_LAST_ID = 0x1FFFFFFF
_LAST_NS = LAST_US * 1000
_ENDS = np.zeros(256, np.bool_)
_ENDS[[*b" \t\r\n"]] = True
"""Characters that may follow a payload."""

Digits = tuple[tuple[int, np.uint64, np.uint64, np.uint64], ...]
"""Words of decimal digits, as (offset, mask, worth of the last digit, blanks): where the number may
be padded with spaces, `blanks` has the lowest bit of its first character, else 0."""
_BITS, _NIBBLES = np.uint64(0x0101010101010101), np.uint64(0x0F)
_4, _8 = np.uint64(4), np.uint64(8)


@dataclass(frozen=True, slots=True)
class Layout:
    """Positions of the parts of a line; offsets count from `FRONT` bytes before the line.

    Attributes:
        kind: Kind of the lines, DATA or FD.
        size: Number of characters up to the end of the payload, or of the line where it `is_last`.
        fixed: Words of a line from its first character on, as (characters, mask) each.
        stamp: Digits of the stamp, worth ns.
        bus: Digits of the number of the bus, worth 1; empty where there is none.
        other: Digits whose value is not used.
        id: Word that ends with the hex digits of the id, as (offset, mask).
        extended: Whether the id has 29 bits.
        payload: Offset of the payload, in hex digits, two and a space for each byte.
        length: Length of the payload, bytes.
        is_last: Whether nothing but white space follows the payload.

    """

    kind: Kind
    size: int
    fixed: tuple[tuple[np.uint64, np.uint64], ...]
    stamp: Digits
    bus: Digits
    other: Digits
    id: tuple[int, np.uint64]
    extended: bool
    payload: int
    length: int
    is_last: bool


def learn_layout(
    match: re.Match[bytes],
    *,
    unit_ns: int,
    length: int,
    kind: Kind,
    extended: bool,
    is_last: bool,
) -> Layout | None:
    """Layout of a line; None where its payload is of another length than it says.

    Args:
        match: Match from the start of a line on, with the groups `whole`, `fraction`, `id`, `data`
            and, where the format has them, `bus` and `number`.
        unit_ns: Unit of the stamp, ns.
        length: Length of the payload as the line says it, bytes.
        kind: Kind of the frame.
        extended: Whether the id has 29 bits.
        is_last: Whether nothing but white space may follow the payload.

    """
    groups = match.re.groupindex
    data = match["data"] or b""
    blank = len(data) - len(data.lstrip())
    first = match.start("data") + blank if length else match.start("data")
    stored, needed = len(data) - blank, max(3 * length - 1, 0)
    if stored < needed or (is_last and stored > needed):
        return None
    size = first + needed if length else match.end("length")
    if is_last:  # white space behind the payload is a part of the line
        size = len(match.string.rstrip(b"\n"))
    line = match.string
    whole = _padded(line, match.span("whole"))
    fraction = len(match["fraction"] or b"")
    stamp = _digits(line, whole, unit_ns)
    if fraction:
        stamp += _digits(line, match.span("fraction"), unit_ns // 10**fraction)
    bus, number = (
        _padded(line, match.span(name)) if name in groups else (0, 0) for name in ("bus", "number")
    )
    free = {place for n in range(length) for place in (first + 3 * n, first + 3 * n + 1)}
    for span in (whole, bus, number, match.span("fraction"), match.span("id")):
        free |= {*range(*span)}
    end, digits = match.end("id"), len(match["id"])
    return Layout(
        kind=kind,
        size=size,
        fixed=_fixed(match.string[:size], free),
        stamp=stamp,
        bus=_digits(line, bus),
        other=_digits(line, number),
        id=(FRONT + end - 8, keep(8 - digits, digits)),
        extended=extended,
        payload=FRONT + first,
        length=length,
        is_last=is_last,
    )


def _padded(line: bytes, span: tuple[int, int]) -> tuple[int, int]:
    """Span of a number of a line with the spaces that pad it, as far as they fit a word."""
    start, end = span
    front = line[:start]
    stripped = front.rstrip(b" ")
    first = len(stripped) + 1 if stripped else 0  # a space stands between two fields
    return (min(start, max(first, end - 8)), end) if first < start else span


def _digits(line: bytes, span: tuple[int, int], worth: int = 1) -> Digits:
    """Words of the digits of a span, eight at a time from its end on."""
    start, end = span
    is_padded = line[start : start + 1] == b" "
    words = []
    while end > start:
        count = min(end - start, 8)
        blanks = np.uint64(1 << 8 * (8 - count) if is_padded else 0)
        words.append((FRONT + end - 8, keep(8 - count, count), np.uint64(worth), blanks))
        end -= 8
        worth *= 10**8
    return tuple(words)


def _fixed(head: bytes, free: set[int]) -> tuple[tuple[np.uint64, np.uint64], ...]:
    words = []
    for first in range(0, len(head), 8):
        places = [n for n in range(first, min(first + 8, len(head))) if n not in free]
        mask = sum(0xFF << 8 * (place - first) for place in places)
        characters = sum(head[place] << 8 * (place - first) for place in places)
        words.append((np.uint64(characters), np.uint64(mask)))
    return tuple(words)


def match_lines(
    layout: Layout, text: Text, starts: Places, ends: Places, start_ns: int
) -> tuple[Places, Block] | None:
    """Indices of the lines that fit a layout in every character, and their frames.

    The `channel` of the frames has the numbers of their buses, 1 where the format has none.

    Args:
        layout: Layout of the lines.
        text: Characters of the chunk.
        starts: Positions of the lines in `text`, shape (n,).
        ends: Positions past the last character of each line, its line feed left out, shape (n,).
        start_ns: Time from which the stamps count, from 0 to `LAST_US`, ns.

    """
    rows = np.flatnonzero(_ended(layout, text, starts, ends))
    if not len(rows):
        return None
    words = -(-layout.size // 8)
    lines = gather(text, starts[rows] - FRONT, FRONT + 8 * words)
    alike = _fits(layout, lines)
    if not alike.all():
        rows, lines = rows[alike], lines[alike]
        if not len(rows):
            return None
    lines = np.require(lines, requirements=("C", "O"))
    t_ns, wrong = _numbers(lines, layout.stamp)
    bus, wrong_bus = _numbers(lines, layout.bus)
    wrong |= wrong_bus
    wrong |= _numbers(lines, layout.other)[1]
    offset, mask = layout.id
    word = _word(lines, offset).copy()
    zeros_outside(word, mask)
    octets, wrong_id = hexadecimal(word.reshape(-1, 1))
    wrong |= wrong_id[:, 0]
    key = octets.view(">u4")[:, 0].astype(np.uint32)
    payload, wrong_payload = _payload(layout, lines)
    wrong |= wrong_payload
    good = (wrong == 0) & (key <= _LAST_ID) & (t_ns <= np.uint64(_LAST_NS - start_ns))
    if layout.extended:
        key |= np.uint32(EXTENDED)
    count = len(rows)
    block = Block(
        t_ns=t_ns.view(np.int64) + start_ns,
        key=key,
        kind=np.full(count, layout.kind, np.uint8),
        length=np.full(count, layout.length, np.uint8),
        channel=bus.astype(np.uint16) if layout.bus else np.ones(count, np.uint16),
        words=payload,
        channels=(),
    )
    return (rows, block) if good.all() else (rows[good], block.select(good))


def _ended(layout: Layout, text: Text, starts: Places, ends: Places) -> NDArray[np.bool_]:
    """Whether a line is long enough and its payload has an end there, shape (n,)."""
    sizes = ends - starts
    if layout.is_last:
        return np.asarray(sizes == layout.size)
    stops = starts + layout.size
    ended = (sizes >= layout.size) & _ENDS[text[np.minimum(stops, len(text) - 1)]]
    ended |= sizes == layout.size
    return ended


def _fits(layout: Layout, lines: NDArray[np.void]) -> NDArray[np.bool_]:
    differs = np.zeros(len(lines), WORD)
    for number, (characters, mask) in enumerate(layout.fixed):
        if mask:
            differs |= (_word(lines, FRONT + 8 * number) ^ characters) & mask
    return np.asarray(differs == 0)


def _word(lines: NDArray[np.void], offset: int) -> Words:
    """Word of every line at an offset, a view."""
    kind = np.dtype(
        {"names": ["word"], "formats": [WORD], "offsets": [offset], "itemsize": lines.itemsize}
    )
    return lines.view(kind)["word"]


def _numbers(lines: NDArray[np.void], digits: Digits) -> tuple[Words, Words]:
    """Numbers, and words that are not 0 where a character is no digit, shapes (n,)."""
    total, wrong = np.zeros(len(lines), np.uint64), np.zeros(len(lines), WORD)
    for offset, mask, worth, blanks in digits:
        word = _word(lines, offset).copy()
        if blanks:
            wrong |= _fill_blanks(word, mask, blanks)
        number, bad = decimal(word, np.full(1, mask))
        number *= worth
        total += number
        wrong |= bad
    return total, wrong


def _fill_blanks(words: Words, mask: np.uint64, first: np.uint64) -> Words:
    """Put the digit 0 for the spaces that pad numbers, in place; not 0 where they are no padding.

    Args:
        words: Characters, shape (n,).
        mask: Bytes that hold the number.
        first: Lowest bit of the first of them.

    """
    blank = ~(words >> _4) & _BITS & mask  # the bit that a space has not, and a digit has
    wrong = words & (blank * _NIBBLES)
    wrong |= blank & ~((blank << _8) | first)  # a space behind a digit
    wrong |= blank >> np.uint64(56)  # no digit at all
    words |= blank << _4
    return wrong


def _payload(layout: Layout, lines: NDArray[np.void]) -> tuple[Words, Words]:
    """Payloads as words, shape (n, w), and words that are not 0 where one is wrong, shape (n,)."""
    count, length = len(lines), layout.length
    pairs = np.full((count, 16 if length <= 8 else 128), ord("0"), np.uint8)
    if length:
        octets = lines.view(np.uint8).reshape(count, -1)[:, layout.payload :]
        pairs[:, : 2 * length : 2] = octets[:, : 3 * length : 3]
        pairs[:, 1 : 2 * length : 2] = octets[:, 1 : 3 * length : 3]
    payload, wrong = hexadecimal(pairs.view(WORD))
    return payload.view(WORD).astype(np.uint64), np.bitwise_or.reduce(wrong, axis=1)
