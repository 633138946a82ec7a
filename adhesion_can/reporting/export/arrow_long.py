"""Arrow in the long form: a row for each value of a signal, as a file or as a stream for pipes."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from adhesion_can.files import OutputFile
from adhesion_can.reporting.export.arrow_fields import (
    TEXT,
    TIME_NS,
    TIME_S,
    arrow_column,
    arrow_texts,
)
from adhesion_can.reporting.export.layout import (
    SECOND,
    FieldColumn,
    Frames,
    Group,
    GroupRows,
    Sink,
    in_order,
)

_TEXTS = ("channel", "message", "signal", "unit")
_EXACT = 1 << 53
"""Largest integer up to which floats hold every integer."""


class ArrowLong(Sink):
    """Writes rows (time, bus, message, signal, value, unit), in the order of the recording.

    A stream has one schema, and which messages will come is not known at its start. So the schema
    is the same for every database: a value is a float, and names are codes of dictionaries, which
    grow as messages turn up.

    Args:
        path: Path of the finished file; None: to stdout.
        origin: Version, inputs and the like, by name, for the schema's metadata.
        as_file: Whether the file is one for random access, else a stream.

    """

    def __init__(self, path: Path | None, origin: Mapping[str, str], *, as_file: bool) -> None:
        self._as_file = as_file
        texts = [pa.field(name, TEXT, nullable=False) for name in _TEXTS]
        value = pa.field("value", pa.float64(), nullable=False)
        columns = [TIME_S, TIME_NS, *texts[:-1], value, texts[-1]]
        self._schema = pa.schema(columns, metadata=dict(origin))
        self._names = {name: _Names() for name in _TEXTS}
        self._rounded = 0
        self._out = None if path is None else OutputFile(path, random_access=as_file)
        # Not closed here where it is stdout.
        file = sys.stdout.buffer if self._out is None else self._out.file
        self._stream = pa.ipc.new_stream(file, self._schema, options=_options())

    def write(self, rows: Sequence[GroupRows], _frames: Frames | None = None) -> None:
        """Append rows."""
        held = [part for part in rows if len(part.t_ns)]
        if not held:
            return
        t_ns = in_order(held)
        here = [_present(part) for part in held]
        # Number of values in front of each row.
        sizes = np.zeros(len(t_ns) + 1, dtype=np.int64)
        for part, mask in zip(held, here, strict=True):
            sizes[part.position + 1] = mask.sum(axis=1)
        first = np.cumsum(sizes)
        total = int(first[-1])
        codes = {name: np.empty(total, dtype=np.int32) for name in _TEXTS}
        values = np.empty(total)
        for part, mask in zip(held, here, strict=True):
            place = (first[part.position][:, None] + np.cumsum(mask, axis=1) - 1)[mask]
            for name, column in zip(_TEXTS, self._codes(part.group), strict=True):
                codes[name][place] = np.broadcast_to(column, mask.shape)[mask]
            values[place] = self._values(part)[mask]
        repeated = np.repeat(t_ns, np.diff(first))
        texts = [self._names[name].array(codes[name]) for name in _TEXTS]
        arrays = [arrow_column(repeated / SECOND), arrow_column(repeated), *texts[:-1]]
        batch = pa.record_batch([*arrays, arrow_column(values), texts[-1]], schema=self._schema)
        self._stream.write_batch(batch)

    def problems(self) -> list[str]:
        """Sentence about integers that a float does not hold."""
        if not self._rounded:
            return []
        exact = "the other formats have them exactly"
        return [f"{self._rounded} integers beyond 2^53 are rounded to floats; {exact}"]

    def close(self) -> None:
        """Finish the stream; a file then gets its name."""
        self._stream.close()
        if self._out is None:
            sys.stdout.buffer.flush()
            return
        if self._as_file:
            aside = self._out.set_aside()
            try:
                with aside.read_again() as part:
                    self._write_file(part, self._out.file)
            finally:
                aside.remove()
        self._out.finish()

    def abandon(self) -> None:
        """Delete what has been written so far."""
        if self._out is not None:
            self._out.abandon()

    def _codes(self, group: Group) -> list[NDArray[np.int32]]:
        """Codes of a group's fields for each of the texts, shape (k,) or (1,)."""
        fields = group.fields
        texts: list[list[str]] = [
            [group.channel],
            [group.name],
            [field.name for field in fields],
            [field.unit for field in fields],
        ]
        return [
            np.array([self._names[kind].code(text) for text in column], dtype=np.int32)
            for kind, column in zip(_TEXTS, texts, strict=True)
        ]

    def _values(self, rows: GroupRows) -> NDArray[np.float64]:
        """Values as floats, shape (n, k); integers that get rounded are counted."""
        values = np.empty((len(rows.t_ns), len(rows.columns)))
        for place, column in enumerate(rows.columns):
            values[:, place] = column.values
            if column.values.dtype.kind in "iu" and column.values.itemsize == 8:
                self._rounded += _count_beyond(column)
        return values

    def _write_file(self, part: BinaryIO, whole: BinaryIO) -> None:
        """Write the stream once more, with dictionaries that hold for all of it from the start."""
        finished = {name: self._names[name].texts() for name in _TEXTS}
        with (
            pa.ipc.open_stream(part) as stream,
            pa.ipc.new_file(whole, self._schema, options=_options()) as file,
        ):
            for batch in stream:
                arrays = [
                    pa.DictionaryArray.from_arrays(batch.column(name).indices, finished[name])
                    if name in finished
                    else batch.column(name)
                    for name in self._schema.names
                ]
                file.write_batch(pa.record_batch(arrays, schema=self._schema))


class _Names:
    """Texts by code, in the order in which they turn up."""

    def __init__(self) -> None:
        self._code: dict[str, int] = {}
        self._texts: Any = arrow_texts([])

    def code(self, text: str) -> int:
        return self._code.setdefault(text, len(self._code))

    def texts(self) -> Any:
        # The same array as long as nothing is new: it is then not written again.
        if len(self._texts) < len(self._code):
            self._texts = arrow_texts(list(self._code))
        return self._texts

    def array(self, codes: NDArray[np.int32]) -> Any:
        return pa.DictionaryArray.from_arrays(arrow_column(codes), self.texts())


def _present(rows: GroupRows) -> NDArray[np.bool_]:
    """Which rows have which of their fields, shape (n, k)."""
    mask = np.ones((len(rows.t_ns), len(rows.columns)), dtype=np.bool_)
    for place, column in enumerate(rows.columns):
        if column.missing is not None:
            mask[:, place] = ~column.missing
    return mask


def _count_beyond(column: FieldColumn) -> int:
    """Number of integers that a float may not hold."""
    values = column.values if column.missing is None else column.values[~column.missing]
    beyond = values > _EXACT
    if values.dtype.kind == "i":
        beyond |= values < -_EXACT
    return int(np.count_nonzero(beyond))


def _options() -> Any:
    return pa.ipc.IpcWriteOptions(compression=pa.Codec("zstd", compression_level=1))


def open_sink(
    path: Path, origin: Mapping[str, str], _groups: Sequence[Group], _decimals: int
) -> ArrowLong:
    """Start a file, or a stream where its name ends in .arrows, '-' for stdout."""
    stdout = str(path) == "-"
    return ArrowLong(None if stdout else path, origin, as_file=path.suffix.lower() == ".arrow")
