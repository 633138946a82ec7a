"""Parquet: the table of the CSV with types, units and provenance."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow import parquet

from adhesion_can.files import Temporary
from adhesion_can.reporting.export.arrow_fields import (
    TEXT,
    TIME_NS,
    TIME_S,
    arrow_column,
    arrow_field,
    arrow_texts,
)
from adhesion_can.reporting.export.growing_table import GrowingTable
from adhesion_can.reporting.export.layout import (
    SECOND,
    Field,
    FieldColumn,
    Group,
    GroupRows,
    count,
    in_order,
)

_CELLS = 1 << 24
"""Number of cells of a row group, which is held in memory."""

_ROWS = 1 << 20
"""Largest number of rows of a row group."""


class ParquetFormat:
    """How Parquet writes a table.

    Args:
        by_message: Whether rows belong to messages: a column holds the message's name, and the
            columns of signals are named 'Message.Signal'.
        origin: Version, inputs and the like, by name, for the file's metadata.

    """

    def __init__(self, by_message: bool, origin: Mapping[str, str]) -> None:
        self.by_message = by_message
        self.origin = dict(origin)

    def open(self, file: BinaryIO, groups: Sequence[Group]) -> "ParquetPartFile":
        """Start a file with the columns of some groups."""
        return ParquetPartFile(file, groups, self)

    def join(
        self, parts: Sequence[tuple[Temporary, int]], file: BinaryIO, groups: Sequence[Group]
    ) -> None:
        """Write one file of several: the columns that a part lacks are null in it."""
        schema = self.schema(groups)
        with _writer(file, schema) as writer:
            for part, _ in parts:
                with part.read_again() as held, parquet.ParquetFile(held) as source:
                    for number in range(source.num_row_groups):
                        table = source.read_row_group(number)
                        writer.write_table(_widened(table, schema))

    def schema(self, groups: Sequence[Group]) -> Any:
        """Arrow's schema of a table."""
        fields = [TIME_S]
        if self.by_message:
            fields += [TIME_NS, pa.field("message", TEXT, nullable=False)]
        for group in groups:
            prefix = f"{group.name}." if self.by_message else ""
            fields += [arrow_field(prefix + field.name, field) for field in group.fields]
        return pa.schema(fields, metadata=self.origin)


class ParquetPartFile:
    """A Parquet file of a fixed set of columns."""

    def __init__(
        self, file: BinaryIO, groups: Sequence[Group], table_format: ParquetFormat
    ) -> None:
        self._groups = groups
        self._format = table_format
        self._schema = table_format.schema(groups)
        self._number = {group.name: number for number, group in enumerate(groups)}
        self._names = arrow_texts([group.name for group in groups])
        self._limit = max(1024, min(_ROWS, _CELLS // len(self._schema)))
        self._held: list[Any] = []
        self._held_rows = 0
        self._writer = _writer(file, self._schema)

    def write(self, rows: Sequence[GroupRows]) -> None:
        """Append rows."""
        total, first = count(rows), 0
        while first < total:
            end = min(total, first + self._limit - self._held_rows)
            slab = rows if end - first == total else [part.between(first, end) for part in rows]
            self._held.append(self._table(slab, end - first))
            self._held_rows += end - first
            first = end
            if self._held_rows >= self._limit:
                self._flush()

    def close(self) -> None:
        """Write what is left; the file stays open."""
        try:
            self._flush()
        finally:
            self._writer.close()

    def _flush(self) -> None:
        held, self._held, self._held_rows = self._held, [], 0
        if held:
            self._writer.write_table(pa.concat_tables(held), row_group_size=self._limit)

    def _table(self, rows: Sequence[GroupRows], size: int) -> Any:
        t_ns = in_order(rows)
        columns = [arrow_column(t_ns / SECOND)]
        by_group = {part.group.name: part for part in rows if len(part.t_ns)}
        if self._format.by_message:
            message = np.empty(size, dtype=np.int32)
            for name, part in by_group.items():
                message[part.position] = self._number[name]
            columns.append(arrow_column(t_ns))
            columns.append(pa.DictionaryArray.from_arrays(arrow_column(message), self._names))
        for group in self._groups:
            columns += _arrays(group, by_group.get(group.name), size)
        return pa.Table.from_arrays(columns, schema=self._schema)


def _writer(file: BinaryIO, schema: Any) -> Any:
    # Stamps do not repeat as the values of signals do.
    values = [name for name in schema.names if name not in ("time_s", "time_ns")]
    deltas = {"time_ns": "DELTA_BINARY_PACKED"} if "time_ns" in schema.names else None
    return parquet.ParquetWriter(file, schema, use_dictionary=values, column_encoding=deltas)


def _arrays(group: Group, rows: GroupRows | None, size: int) -> Iterator[Any]:
    if rows is None:
        for field in group.fields:
            yield pa.nulls(size, arrow_field(field.name, field).type)
        return
    absent = None
    if len(rows.t_ns) < size:
        absent = np.ones(size, dtype=bool)
        absent[rows.position] = False
    for field, column in zip(group.fields, rows.columns, strict=True):
        values, missing = _scatter(field, column, rows.position, absent)
        if field.text:
            # Rows of other groups hold 0 here. They are masked, so any valid code will do.
            numbers = sorted(field.names)
            codes = np.searchsorted(numbers, values).astype(np.int32).clip(0, len(numbers) - 1)
            names = pa.array([field.names[number] for number in numbers], pa.string())
            yield pa.DictionaryArray.from_arrays(arrow_column(codes, missing), names)
        else:
            yield arrow_column(values, missing)


def _scatter(
    field: Field,
    column: FieldColumn,
    position: NDArray[np.int64],
    absent: NDArray[np.bool_] | None,
) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """A group's column over the rows of all groups, and where it is missing."""
    values = column.values.astype(field.dtype, copy=False)
    if absent is None:
        return values, column.missing
    scattered = np.zeros(len(absent), dtype=field.dtype)
    scattered[position] = values
    missing = absent
    if column.missing is not None:
        missing = absent.copy()
        missing[position] = column.missing
    return scattered, missing


def _widened(table: Any, schema: Any) -> Any:
    for field in list(schema)[table.num_columns :]:
        table = table.append_column(field, pa.nulls(len(table), field.type))
    return table.cast(schema)


def open_sink(
    path: Path, origin: Mapping[str, str], groups: Sequence[Group], _decimals: int
) -> GrowingTable:
    """Start a Parquet file."""
    return GrowingTable(path, ParquetFormat(not groups, origin), groups)
