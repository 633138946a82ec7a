"""Rows of a data set, by an own way of reading it."""

from pathlib import Path

import pyarrow.parquet as pq

TIMES = "_seconds"


def rows(out, table="units"):
    """Rows of a table by file's name, without the times that the work took."""
    found = {}
    for file in sorted(Path(out, table).rglob("*.parquet")):
        content = pq.ParquetFile(file).read().to_pylist()
        found[file.name] = [
            {name: value for name, value in row.items() if not name.endswith(TIMES)}
            for row in content
        ]
    return found


def units(out):
    """Rows of `units` by the name of the recording."""
    return {Path(row["path"]).name: row for (row,) in rows(out).values()}
