"""Parquet and Arrow files of one message each."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from adhesion_can.reporting.export.arrow_fields import TIME_NS, TIME_S, arrow_column, arrow_field
from adhesion_can.reporting.export.layout import SECOND, FieldColumn, Group, GroupRows
from adhesion_can.reporting.export.message_folder import MessageFolder

_CELLS = 1 << 20
"""Number of cells of a row group, which is held in memory."""

_LEVEL = 1
"""Level of zstd: 3 takes half as long again and saves a tenth."""


class ArrowMessageFile:
    """A Parquet or Arrow file with the rows of one message.

    Args:
        file: File.
        group: Message.
        origin: Version, inputs and the like, by name, for the file's metadata.
        suffix: '.parquet' or '.arrow'.

    """

    def __init__(
        self, file: BinaryIO, group: Group, origin: Mapping[str, str], suffix: str
    ) -> None:
        about = {"message": group.name, "channel": group.channel, "comment": group.comment}
        columns = [arrow_field(field.name, field) for field in group.fields]
        self._group = group
        self._schema = pa.schema([TIME_S, TIME_NS, *columns], metadata={**origin, **about})
        self._writer = (_arrow if suffix == ".arrow" else _parquet)(file, self._schema)
        self._rows: list[GroupRows] = []
        self.held = 0

    def write(self, rows: GroupRows) -> None:
        """Append rows."""
        self._rows.append(rows)
        self.held += len(rows.t_ns) * len(self._schema)
        if self.held >= _CELLS:
            self.flush()

    def flush(self) -> None:
        """Write what is held."""
        rows, self._rows, self.held = self._rows, [], 0
        if rows:
            t_ns = np.concatenate([part.t_ns for part in rows])
            arrays = [arrow_column(t_ns / SECOND), arrow_column(t_ns)]
            for place in range(len(self._group.fields)):
                values, missing = _joined([part.columns[place] for part in rows])
                arrays.append(arrow_column(values, missing))
            self._writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))

    def close(self) -> None:
        """Write what is left; the file stays open."""
        try:
            self.flush()
        finally:
            self._writer.close()


def _joined(columns: list[FieldColumn]) -> FieldColumn:
    values = np.concatenate([column.values for column in columns])
    if all(column.missing is None for column in columns):
        return FieldColumn(values)
    masks = [
        np.zeros(len(column.values), dtype=bool) if column.missing is None else column.missing
        for column in columns
    ]
    return FieldColumn(values, np.concatenate(masks))


def _parquet(file: BinaryIO, schema: Any) -> Any:
    # Dictionaries of scaled values take twice the time of all the rest, and save nothing that
    # bytes split by their place do not.
    encoding = {
        field.name: "BYTE_STREAM_SPLIT" for field in schema if pa.types.is_floating(field.type)
    }
    return parquet.ParquetWriter(
        file,
        schema,
        compression="zstd",
        compression_level=_LEVEL,
        use_dictionary=False,
        column_encoding={**encoding, "time_ns": "DELTA_BINARY_PACKED"},
    )


def _arrow(file: BinaryIO, schema: Any) -> Any:
    options = pa.ipc.IpcWriteOptions(compression=pa.Codec("zstd", compression_level=_LEVEL))
    return pa.ipc.new_file(file, schema, options=options)


def open_folder(path: Path, suffix: str, origin: Mapping[str, str]) -> MessageFolder:
    """Start a folder of Parquet or Arrow files."""
    return MessageFolder(
        path, suffix, lambda file, group: ArrowMessageFile(file, group, origin, suffix), origin
    )
