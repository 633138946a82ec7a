"""Columns of Arrow and Parquet: types, units, comments and the names of values."""

import json
from typing import Any

import pyarrow as pa

from adhesion_can.reporting.export.layout import Field

TEXT = pa.dictionary(pa.int32(), pa.string())
"""Type of a text that repeats."""

TIME_S = pa.field(
    "time_s",
    pa.float64(),
    nullable=False,
    metadata={b"unit": b"s", b"comment": b"on the recording's clock"},
)
TIME_NS = pa.field(
    "time_ns",
    pa.int64(),
    nullable=False,
    metadata={b"unit": b"ns", b"comment": b"on the recording's clock, exact"},
)


def arrow_field(name: str, field: Field) -> Any:
    """Arrow's field of a column, with unit, comment and names of values as its metadata."""
    metadata = {}
    if field.unit:
        metadata["unit"] = field.unit
    if field.comment:
        metadata["comment"] = field.comment
    if field.names and not field.text:
        metadata["values"] = json.dumps(field.names)
    kind = TEXT if field.text else pa.from_numpy_dtype(field.dtype)
    return pa.field(name, kind, metadata=metadata or None)
