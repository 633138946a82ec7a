"""Decoded messages as rows of a file of columns, with fields by the database's signals."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from cantools.database.can import Message, Signal
from numpy.typing import NDArray

from adhesion_can.bus.block import Block
from adhesion_can.bus.database import CanDatabase
from adhesion_can.bus.decoder import MessageColumns
from adhesion_can.bus.signal_columns import SignalColumn
from adhesion_can.reporting.export.layout import Field, FieldColumn, Frames, Group, GroupRows, Raw

_RAW_BITS = 32
_LARGEST_OFFSET = 1 << 40  # in steps; up to there 53 bits lead from a number back to its raw value

_Rows = slice | NDArray[np.int64]
_Part = tuple[MessageColumns, _Rows, str]  # of a message: rows that are kept, and their bus


class MessageRows:
    """Builds rows from the columns of messages; rejected frames are not among them.

    Args:
        database: Database of the messages.
        by_channel: Whether the frames of each bus are rows of a group of their own.

    """

    def __init__(self, database: CanDatabase, *, by_channel: bool = False) -> None:
        self._by_channel = by_channel
        self._times_named = Counter(message.name for message in database.db.messages)
        self._groups: dict[tuple[int, bool, str], Group] = {}

    def build(
        self, decoded: Sequence[MessageColumns], block: Block
    ) -> tuple[list[GroupRows], Frames]:
        """Rows of one block, in the order of the recording, and the frames behind them."""
        parts = list(self._parts(decoded, block))
        rank, place = _order([columns.rows[keep] for columns, keep, _ in parts])
        rows = [
            self._rows(columns, keep, channel, rank[columns.rows[keep]])
            for columns, keep, channel in parts
        ]
        return rows, Frames(block, place)

    def _parts(self, decoded: Sequence[MessageColumns], block: Block) -> Iterator[_Part]:
        """The frames of each message, and bus where these are kept apart, that are not rejected."""
        for columns in decoded:
            kept = columns.outcome == 0
            if not kept.any():
                continue
            keep: _Rows = slice(None) if kept.all() else np.flatnonzero(kept)
            if not self._by_channel or len(block.channels) == 1:
                yield columns, keep, block.channels[0] if self._by_channel else ""
                continue
            channel = block.channel[columns.rows]
            for number in np.flatnonzero(np.bincount(channel[keep])).tolist():
                here = channel == number
                if not here.all():
                    keep = np.flatnonzero(here & kept)
                yield columns, keep, block.channels[number]

    def _rows(
        self, columns: MessageColumns, keep: _Rows, channel: str, position: NDArray[np.int64]
    ) -> GroupRows:
        group = self._group(columns, channel)
        cells = []
        for field, signal in zip(group.fields, columns.signals.values(), strict=True):
            missing = None if signal.present is None else ~signal.present[keep]
            cells.append(FieldColumn(signal.values[keep].astype(field.dtype, copy=False), missing))
        return GroupRows(group, position, columns.t_ns[keep], cells)

    def _group(self, columns: MessageColumns, channel: str) -> Group:
        message = columns.message
        key = message.frame_id, message.is_extended_frame, channel
        if key not in self._groups:
            name = message.name
            if self._times_named[name] > 1:
                name = f"{name}@{message.frame_id:X}"
            fields = tuple(_field(message, name, s) for name, s in columns.signals.items())
            number = id_text(message.frame_id, message.is_extended_frame)
            comment = " ".join((number, message.comment or "")).strip()
            self._groups[key] = Group(name, fields, comment, channel)
        return self._groups[key]


def id_text(number: int, extended: bool) -> str:
    """An id as candump writes it, with 0x."""
    return f"0x{number:08X}" if extended else f"0x{number:03X}"


def _order(
    places: Sequence[NDArray[np.int64]],
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Position among all rows, by row of the block; and the row of the block of each position."""
    end = max((int(rows[-1]) + 1 for rows in places if len(rows)), default=0)
    held = np.zeros(end, dtype=bool)
    for rows in places:
        held[rows] = True
    return np.cumsum(held) - 1, np.flatnonzero(held)


def _field(message: Message, name: str, column: SignalColumn) -> Field:
    signal = column.signal
    dtype = column.values.dtype
    raw = None
    # A name that stands twice in a message may have two scales.
    if sum(s.name == name for s in message.signals) == 1:
        lowest = -(1 << (signal.length - 1)) if signal.is_signed else 0
        highest = lowest + (1 << signal.length) - 1
        if dtype.kind in "iu":
            scale, offset = int(signal.scale), int(signal.offset)
            dtype = _smallest(lowest * scale + offset, highest * scale + offset)
        elif _is_scaled(signal):
            raw = Raw(_smallest(lowest, highest), float(signal.scale), float(signal.offset))
    names: dict[float, str] = {}
    for number, text in (signal.conversion.choices or {}).items():
        value: Any = signal.conversion.raw_to_scaled(number, decode_choices=False)
        names[value] = str(text)
    return Field(
        name,
        dtype,
        unit=signal.unit or "",
        comment=signal.comment or "",
        names=names,
        optional=column.present is not None,
        raw=raw,
    )


def _smallest(first: int, last: int) -> np.dtype[np.int64]:
    """Smallest integers that hold two numbers and those between."""
    low, high = min(first, last), max(first, last)
    names = ("u1", "u2", "u4", "u8") if low >= 0 else ("i1", "i2", "i4", "i8")
    for name in names:
        info = np.iinfo(name)
        if info.min <= low and high <= info.max:
            return np.dtype(name)
    raise OverflowError(f"{low}..{high} fits no integers of 64 bits")


def _is_scaled(signal: Signal) -> bool:
    """Whether the raw value comes back from the number for sure."""
    scale, offset = abs(float(signal.scale)), abs(float(signal.offset))
    if signal.conversion.is_float or signal.length > _RAW_BITS or not 0 < scale < float("inf"):
        return False
    return offset / scale < _LARGEST_OFFSET
