"""Columns of Arrow and Parquet: types, units, comments and the names of values."""

import json
from collections.abc import Sequence
from itertools import accumulate
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

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


def arrow_column(values: NDArray[Any], missing: NDArray[np.bool_] | None = None) -> Any:
    """Arrow's array of numbers. It refers to the values, which must stay as they are.

    `pyarrow.array` imports pandas where it is installed: longer than a short conversion takes.

    Args:
        values: Numbers, shape (n,).
        missing: Rows without a value, shape (n,); None: there is none.

    """
    bits = None
    if missing is not None:
        bits = pa.py_buffer(np.packbits(~missing, bitorder="little"))
    kind = pa.from_numpy_dtype(values.dtype)
    numbers = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(kind, len(values), [bits, numbers])


def arrow_texts(texts: Sequence[str]) -> Any:
    """Arrow's array of texts, without pandas as `arrow_column`."""
    encoded = [text.encode() for text in texts]
    ends = np.fromiter(accumulate(map(len, encoded), initial=0), np.int32, len(texts) + 1)
    buffers = [None, pa.py_buffer(ends), pa.py_buffer(b"".join(encoded))]
    return pa.Array.from_buffers(pa.string(), len(texts), buffers)
