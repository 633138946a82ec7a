"""Columns of a table put back in time by what they are late."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.errors import TableError
from adhesion_can.recordings.tables.choice import ColumnChoice
from adhesion_can.recordings.tables.columns import Column, Columns

LARGEST_GAP = 3.0
"""Distance of two rows over the median one from which nothing is known between them."""


def shift_columns(columns: Columns, choices: Sequence[ColumnChoice], where: str) -> Columns:
    """Columns in time: of one that is late the value of a later row, between rows a straight line.

    Rows whose value would lie beyond the ends, or in a gap, have none afterwards (NaN). The rows of
    each axle are a series of their own.

    Args:
        columns: Columns by their known names, in SI units.
        choices: What the user states.
        where: Name of the file, for errors.

    Raises:
        TableError: The table has no time, or a column that is late is not numeric.

    """
    late = [choice for choice in choices if choice.late_s]
    if not late:
        return columns
    values, notes = dict(columns.values), list(columns.notes)
    time_s = _numbers(values, "time_s", where)
    axle = _numbers(values, "axle", where) if "axle" in values else np.zeros_like(time_s)
    for choice in late:
        if choice.name in {"time_s", "axle", "segment"}:
            raise TableError(where, f"{choice.name!r} cannot have a delay", "remove late_s")
        moved = np.full_like(time_s, np.nan)
        given = _numbers(values, choice.name, where)
        for number in np.unique(axle[np.isfinite(axle)]):
            rows = np.flatnonzero(axle == number)
            moved[rows] = _shifted(time_s[rows], given[rows], choice.late_s)
        values[choice.name] = moved
        lost = int(np.count_nonzero(np.isfinite(given) & ~np.isfinite(moved)))
        by, to = abs(choice.late_s), "earlier" if choice.late_s > 0 else "later"
        notes.append(
            f"{choice.name} shifted {by:g} s {to}; {lost} rows at ends and gaps have no value"
        )
    return replace(columns, values=values, notes=tuple(notes))


def _numbers(values: Mapping[str, Column], name: str, where: str) -> Array:
    column = values.get(name)
    if column is None:
        raise TableError(where, f"late_s needs the column {name!r}", "add it, or remove late_s")
    if isinstance(column, tuple):
        raise TableError(where, f"column {name!r} is not numeric", "write numbers in it")
    return np.asarray(column, dtype=np.float64)


def _shifted(time_s: Array, values: Array, late_s: float) -> Array:
    """Values of one series at its times plus a delay; NaN where there is none, shape (n,)."""
    known = np.flatnonzero(np.isfinite(time_s) & np.isfinite(values))
    known = known[np.argsort(time_s[known], kind="stable")]
    if len(known) < 2:
        return np.full_like(values, np.nan)
    # To the microsecond: what falls on a row is that row's, whatever the sum is rounded to.
    at, wanted = np.round(time_s[known], 6), np.round(time_s + late_s, 6)
    steps = np.diff(at)
    shifted = np.interp(wanted, at, values[known], left=np.nan, right=np.nan)
    limit = LARGEST_GAP * float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    place = np.clip(np.searchsorted(at, wanted, side="right"), 1, len(at) - 1)
    in_gap = (steps[place - 1] > limit) & (wanted > at[place - 1]) & (wanted < at[place])
    shifted[in_gap] = np.nan
    return np.asarray(shifted)
