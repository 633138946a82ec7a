"""Columns of a Parquet file (extra 'parquet')."""

from pathlib import Path

import numpy as np

from adhesion_can.errors import TableError
from adhesion_can.extras import install_extra
from adhesion_can.recordings.tables.columns import Column, Columns
from adhesion_can.recordings.tables.headings import name_columns

ALWAYS_READ, MOST_CELLS = 2_000_000, 100
"""Cells that are read whatever the file's size, and further ones for each of its bytes."""


def read_parquet(path: Path) -> Columns:
    """Columns of a file; what is neither number nor text is a column of texts.

    Raises:
        TableError: The file cannot be read, or pyarrow is missing.

    """
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError as error:
        raise TableError(str(path), "Parquet needs pyarrow", install_extra("parquet")) from error
    try:
        about = parquet.read_metadata(path)
        _require_room(path, about.num_rows * about.num_columns)
        table = parquet.read_table(path)
    except (OSError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:150]
        raise TableError(
            str(path), f"not readable as Parquet ({reason})", "check the file"
        ) from error
    kinds = pa.types
    values: dict[str, Column] = {}
    units: dict[str, str] = {}
    named = name_columns(table.column_names)
    for (name, unit), column in zip(named, table.columns, strict=True):
        if name in values:
            what, fix = f"two columns have the name {name!r}", "rename one of them"
            raise TableError(str(path), what, fix)
        if unit:
            units[name] = unit
        numeric = any(
            is_a(column.type) for is_a in (kinds.is_integer, kinds.is_floating, kinds.is_boolean)
        )
        cells = column.to_pylist()
        values[name] = (
            np.array([np.nan if v is None else float(v) for v in cells])
            if numeric
            else tuple("" if v is None else str(v) for v in cells)
        )
    return Columns(values, units)


def _require_room(path: Path, cells: int) -> None:
    """Raise a TableError where a small file holds very many cells, which may all be one."""
    if cells > ALWAYS_READ + MOST_CELLS * path.stat().st_size:
        what = f"{cells} cells in a file of {path.stat().st_size} bytes"
        raise TableError(str(path), what, "remove columns that do not change, or split the file")
