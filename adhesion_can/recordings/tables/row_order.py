"""Rows of a table in the order of their times, whatever order the file has them in.

Rows are ordered by time, then by axle. So a table and the same rows in any other order are one
table, to the last bit of every result. Of rows of one axle with one stamp the file's order says
which came first, as long as its times ascend; where they do not, all their cells order them.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.recordings.tables.columns import Column, Columns

SHORTEST_RUN = 10.0
"""Mean number of rows of an axle that follow each other in time within one segment, below which
the segments lie over each other: their clocks are not one."""


def sort_rows(columns: Columns) -> Columns:
    """Columns with their rows in the order of time, and a note where the file had another.

    Where segments lie over each other in time, because the clock starts again in each, the rows of
    each stay together, in the order of the segments' numbers or names. Rows without a finite time
    come last. A table without a numeric `time_s` has no order, and keeps its own.

    Args:
        columns: Columns by their known names, in SI units.

    """
    time_s = columns.values.get("time_s")
    if time_s is None or isinstance(time_s, tuple):
        return columns
    rows = len(time_s)
    axle = _numbered(columns.values.get("axle"), rows)
    segment = _numbered(columns.values.get("segment"), rows)
    back = _steps_back(time_s, axle, segment)
    keys = [axle, time_s, *([segment] if _overlap(time_s, axle, segment) else [])]
    if back and _has_ties(keys):
        others = [_numbered(column, rows) for column in columns.values.values()]
        keys = [*reversed(others), *keys]
    order = np.lexsort(keys)
    if np.array_equal(order, np.arange(rows)):
        return columns
    notes = columns.notes
    if back:
        count = "1 row has" if back == 1 else f"{back} rows have"
        what = (
            f"{count} an earlier time_s than the previous row of its axle: sorted by time_s. If "
            "the clock starts again within the file, number its parts in a column 'segment'"
        )
        notes = (*notes, what)
    values = {name: _take(column, order) for name, column in columns.values.items()}
    return replace(columns, values=values, notes=notes)


def _numbered(column: Column | None, rows: int) -> NDArray[np.int64]:
    """Rank of each row's number or text among those of the column; 0 without a column."""
    if column is None:
        return np.zeros(rows, dtype=np.int64)
    cells = np.array(column) if isinstance(column, tuple) else column
    return np.unique(cells, return_inverse=True)[1].astype(np.int64)


def _steps_back(time_s: Array, axle: NDArray[np.int64], segment: NDArray[np.int64]) -> int:
    """Number of rows that are earlier than the row before of the same axle and segment."""
    finite = np.flatnonzero(np.isfinite(time_s))
    rows = finite[np.lexsort((segment[finite], axle[finite]))]
    same = (np.diff(axle[rows]) == 0) & (np.diff(segment[rows]) == 0)
    return int(np.count_nonzero(same & (np.diff(time_s[rows]) < 0)))


def _overlap(time_s: Array, axle: NDArray[np.int64], segment: NDArray[np.int64]) -> bool:
    """Whether segments lie over each other: in time, one is left and entered again and again."""
    if not segment.any():
        return False
    rows = np.lexsort((segment, time_s, axle))
    part = (axle * (int(segment.max()) + 1) + segment)[rows]
    number = np.unique(part, return_inverse=True)[1]
    runs = np.bincount(number[np.diff(part, prepend=-1) != 0])
    lengths = np.bincount(number) / runs
    return bool(((runs > 1) & (lengths < SHORTEST_RUN)).any())


def _has_ties(keys: Sequence[NDArray[Any]]) -> bool:
    """Whether two rows are equal in all keys."""
    order = np.lexsort(keys)
    same = np.ones(max(len(order) - 1, 0), dtype=np.bool_)
    for key in keys:
        same &= np.diff(key[order]) == 0
    return bool(same.any())


def _take(column: Column, order: NDArray[np.int64]) -> Column:
    """Cells of a column in another order."""
    return tuple(column[i] for i in order) if isinstance(column, tuple) else column[order]
