"""Layouts of lines of text that look alike, learnt from one of them.

A line whose form is known teaches a layout: where the digits of its stamp, the name of its bus, its
id and its payload stand. Every other character is the same in all lines of the layout, which are
read together (`matching`).
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from adhesion_can.bus.block import Kind
from adhesion_can.bus.frame import MOST_ID
from adhesion_can.recordings.text_columns.ascii_numbers import keep
from adhesion_can.recordings.text_columns.text_source import FRONT


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
        length: Length of the payload, bytes, with a character between two of them; None where they
            stand side by side and reach to the end of the line.
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
    length: int | None
    is_last: bool
    tail: bytes

    @property
    def reach(self) -> int:
        """Number of bytes from `FRONT` bytes before a line on that hold its first `size` ones."""
        return FRONT + -(-self.size // 8) * 8


def learn_layout(
    match: re.Match[bytes],
    *,
    kind: Kind,
    unit_ns: int,
    is_extended: bool,
    start_ns: int = 0,
    last_id: int = MOST_ID,
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
