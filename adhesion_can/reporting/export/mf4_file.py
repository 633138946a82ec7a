"""MF4: a channel group a message, on its own time base."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import numpy as np
from asammdf import MDF, Signal, Source
from asammdf.blocks import v4_constants as mdf4
from numpy.typing import NDArray

from adhesion_can.files import OutputFile
from adhesion_can.reporting.export.layout import (
    SECOND,
    Field,
    FieldColumn,
    Frames,
    Group,
    GroupRows,
    Sink,
    count,
    in_order,
)

_VERSION = "4.10"  # what every reader knows
_DEFLATE: Final = 1
_NOT_RISING = (
    "MF4 needs ascending times: frames with earlier stamps were sorted within the blocks that "
    "are written at once; CSV and Parquet keep the order of the recording"
)


class Mf4File(Sink):
    """Writes a group a message; asammdf holds what was written in a temporary file.

    A row that lacks an optional field has the invalidation bit of that channel set. A group for
    each choice of a multiplexer would need no such bits, but it would split a message into parts
    that all repeat the common signals, and choices may be nested.

    Times count from the start that `begin` sets, else from the stamp of the first row. MF4 requires
    ascending times, so the rows of a group that are written at once are sorted by time.

    Args:
        path: Path of the finished file.
        origin: Version, inputs and the like, by name, for the file's comment.
        groups: Groups of a plain table; empty for messages of a bus, which become known as they are
            written.

    """

    def __init__(self, path: Path, origin: Mapping[str, str], groups: Sequence[Group]) -> None:
        self._out = OutputFile(path, random_access=True)
        self._bus = not groups
        self._start_ns: int | None = None
        self._number: dict[str, int] = {}
        self._last_ns: dict[str, int] = {}
        self._runs_back = False
        # Beside the finished file: /tmp may be small, or memory.
        self._mdf = MDF(version=_VERSION, temporary_folder=str(path.resolve().parent))
        self._mdf.header.comment = "\n".join(f"{key}: {text}" for key, text in origin.items())
        empty = np.empty(0, dtype=np.int64)
        for group in groups:
            columns = [FieldColumn(np.empty(0, field.dtype)) for field in group.fields]
            self._append(GroupRows(group, empty, empty, columns), np.empty(0))

    def begin(self, t_ns: int) -> None:
        """Set the time from which the file counts, ns since the epoch; before the first rows."""
        self._start_ns = max(t_ns, 0)  # the format knows none before 1970

    def write(self, rows: Sequence[GroupRows], _frames: Frames | None = None) -> None:
        """Append rows."""
        if not count(rows):
            return
        if self._start_ns is None:
            self.begin(int(in_order(rows)[0]))
        for given in rows:
            if not len(given.t_ns):
                continue
            part = _sort_by_time(given)
            last_ns = self._last_ns.get(part.group.name, int(part.t_ns[0]))
            self._runs_back |= part is not given or int(part.t_ns[0]) < last_ns
            self._last_ns[part.group.name] = max(last_ns, int(part.t_ns[-1]))
            time_s = (part.t_ns - (self._start_ns or 0)) / SECOND
            if part.group.name not in self._number:
                self._append(part, time_s)
            else:
                pairs: list[Any] = [(time_s, None)]
                for field, column in zip(part.group.fields, part.columns, strict=True):
                    values, missing = _stored(field, column)
                    pairs.append((values, missing))
                self._mdf.extend(self._number[part.group.name], pairs)

    def problems(self) -> list[str]:
        """Sentence about times that run back in the recording."""
        return [_NOT_RISING] if self._runs_back else []

    def close(self) -> None:
        """Write the file, which then gets its name."""
        header: Any = self._mdf.header
        header.time_flags = 0  # UTC
        header.abs_time = self._start_ns or 0
        file: Any = self._out.file
        self._mdf.save(file, compression=_DEFLATE)
        self._mdf.close()
        self._out.finish()

    def abandon(self) -> None:
        """Delete what has been written so far."""
        # On a full disk what is still to be written cannot be, and need not; and what led here is
        # the error to be raised.
        with suppress(OSError):
            self._mdf.close()
        self._out.abandon()

    def _append(self, rows: GroupRows, time_s: NDArray[np.float64]) -> None:
        group = rows.group
        source = None
        if self._bus:
            source = Source(group.name, "CAN", group.comment, mdf4.SOURCE_BUS, mdf4.BUS_TYPE_CAN)
        signals = []
        for field, column in zip(group.fields, rows.columns, strict=True):
            values, missing = _stored(field, column)
            signals.append(
                Signal(
                    values,
                    time_s,
                    name=field.name,
                    unit=field.unit,
                    comment=_comment(field),
                    conversion=_conversion(field),
                    invalidation_bits=missing,
                )
            )
        self._number[group.name] = self._mdf.append(
            signals,
            acq_name=group.name,
            acq_source=source,
            comment=group.comment,
            common_timebase=True,
        )


def _sort_by_time(rows: GroupRows) -> GroupRows:
    """The rows in the order of their stamps; those of one stamp stay as they are."""
    if (np.diff(rows.t_ns) >= 0).all():
        return rows
    order = np.argsort(rows.t_ns, kind="stable")
    columns = [column.select(order) for column in rows.columns]
    return rows._replace(t_ns=rows.t_ns[order], columns=columns)


def _stored(field: Field, column: FieldColumn) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """Values as the file stores them, and the mask of the invalid ones; None: all are valid."""
    missing = column.missing
    if field.optional and missing is None:
        missing = np.zeros(len(column.values), dtype=bool)
    values = column.values
    if field.raw is not None:
        if missing is not None:
            values = np.where(missing, field.raw.offset, values)
        raw = np.rint((values - field.raw.offset) / field.raw.scale)
        return raw.astype(field.raw.dtype), missing
    values = values.astype(field.dtype, copy=False)
    if missing is not None and missing.any() and not field.text:
        # For readers that do not know of invalidation bits. A text names its missing rows itself.
        placeholder = float("nan") if values.dtype.kind == "f" else 0
        values = np.where(missing, values.dtype.type(placeholder), values)
    return values, missing


def _conversion(field: Field) -> dict[str, Any] | None:
    if field.raw is not None:
        return {"a": field.raw.scale, "b": field.raw.offset}
    if not _is_enumeration(field):
        return None
    table: dict[str, Any] = {}
    texts = dict(field.names)
    if field.dtype.itemsize == 1 and not field.text:
        # asammdf shows nothing for a value that has no text.
        info = np.iinfo(field.dtype)
        texts = {n: field.names.get(n, str(n)) for n in range(info.min, info.max + 1)}
    for place, (number, text) in enumerate(sorted(texts.items())):
        table |= {f"val_{place}": number, f"text_{place}": text}
    return table


def _is_enumeration(field: Field) -> bool:
    """Whether the names are what the numbers mean, rather than exceptions among numbers.

    Databases name 'error' and 'not available' at the upper end of plain numbers, too.
    """
    if field.text:
        return True
    small = field.dtype.kind in "iu" and field.dtype.itemsize == 1
    return small and field.unit in ("", "-") and bool({0, 1} & field.names.keys())


def _comment(field: Field) -> str:
    if not field.names or _is_enumeration(field):
        return field.comment
    named = ", ".join(f"{number} = {text}" for number, text in sorted(field.names.items()))
    return f"{field.comment} [{named}]".strip()


def open_sink(
    path: Path, origin: Mapping[str, str], groups: Sequence[Group], _decimals: int
) -> Mf4File:
    """Start an MF4 file."""
    return Mf4File(path, origin, groups)
