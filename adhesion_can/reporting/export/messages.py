"""Decoded messages as rows of a file of columns, with fields by the database's signals."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from cantools.database.can import Message, Signal
from numpy.typing import NDArray

from adhesion_can.bus.database import CanDatabase
from adhesion_can.bus.decoder import MessageColumns
from adhesion_can.bus.signal_columns import SignalColumn
from adhesion_can.reporting.export.layout import Column, Field, Group, Raw, Rows

_RAW_BITS = 32
_LARGEST_OFFSET = 1 << 40  # in steps; up to there 53 bits lead from a number back to its raw value


class MessageRows:
    """Builds rows from the columns of messages; rejected frames are not among them.

    Args:
        database: Database of the messages.

    """

    def __init__(self, database: CanDatabase) -> None:
        self._times_named = Counter(message.name for message in database.db.messages)
        self._groups: dict[tuple[int, bool], Group] = {}

    def build(self, decoded: Sequence[MessageColumns]) -> list[Rows]:
        """Rows of one block, in the order of the recording."""
        kept = [columns.outcome == 0 for columns in decoded]
        places = [
            columns.rows if keep.all() else columns.rows[keep]
            for columns, keep in zip(decoded, kept, strict=True)
        ]
        rank = _rank(places)
        return [
            self._rows(columns, keep, rank[rows])
            for columns, keep, rows in zip(decoded, kept, places, strict=True)
            if len(rows)
        ]

    def _rows(
        self, columns: MessageColumns, keep: NDArray[np.bool_], position: NDArray[np.int64]
    ) -> Rows:
        group = self._group(columns)
        every = keep.all()
        cells = []
        for field, signal in zip(group.fields, columns.signals.values(), strict=True):
            missing = None if signal.present is None else ~signal.present
            values = signal.values.astype(field.dtype, copy=False)
            if not every:
                values = values[keep]
                missing = None if missing is None else missing[keep]
            cells.append(Column(values, missing))
        return Rows(group, position, columns.t_ns if every else columns.t_ns[keep], cells)

    def _group(self, columns: MessageColumns) -> Group:
        message = columns.message
        key = message.frame_id, message.is_extended_frame
        if key not in self._groups:
            name = message.name
            if self._times_named[name] > 1:
                name = f"{name}@{message.frame_id:X}"
            fields = tuple(_field(message, name, s) for name, s in columns.signals.items())
            comment = " ".join((id_text(*key), message.comment or "")).strip()
            self._groups[key] = Group(name, fields, comment)
        return self._groups[key]


def id_text(number: int, extended: bool) -> str:
    """An id as candump writes it, with 0x."""
    return f"0x{number:08X}" if extended else f"0x{number:03X}"


def _rank(places: Sequence[NDArray[np.int64]]) -> NDArray[np.int64]:
    """Position among all rows, by position in the block."""
    end = max((int(rows[-1]) + 1 for rows in places if len(rows)), default=0)
    held = np.zeros(end, dtype=bool)
    for rows in places:
        held[rows] = True
    return np.cumsum(held) - 1


def _field(message: Message, name: str, column: SignalColumn) -> Field:
    signal = column.signal
    dtype = column.values.dtype
    raw = None
    # A name that stands twice in a message may have two scales.
    if sum(s.name == name for s in message.signals) == 1:
        lowest, highest = _raw_range(signal)
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


def _raw_range(signal: Signal) -> tuple[int, int]:
    lowest = -(1 << (signal.length - 1)) if signal.is_signed else 0
    return lowest, lowest + (1 << signal.length) - 1


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
