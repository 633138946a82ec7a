"""What a file of columns is made of, whatever its format: fields, groups of fields, and rows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

SECOND = 1_000_000_000
"""In the nanoseconds of every stamp."""

FLOAT = np.dtype(np.float64)


@dataclass(frozen=True)
class Raw:
    """Integers that a field's numbers come from: number = raw · scale + offset, to the last bit.

    Attributes:
        dtype: of the integers.
        scale: in the field's unit.
        offset: likewise.

    """

    dtype: np.dtype[Any]
    scale: float
    offset: float


@dataclass(frozen=True)
class Field:
    """One column.

    Attributes:
        name: unique in its group.
        dtype: of its numbers.
        unit: '' for none.
        comment: for people.
        names: words for some of its numbers.
        text: the words stand in place of the numbers; every number has one.
        optional: a row may lack it.
        raw: integers that may be written in place of the numbers by a format that scales them.
        spec: of Python's `format` in CSV; '' writes what reads back exactly.

    """

    name: str
    dtype: np.dtype[Any] = FLOAT
    unit: str = ""
    comment: str = ""
    names: Mapping[float, str] = field(default_factory=dict)
    text: bool = False
    optional: bool = False
    raw: Raw | None = None
    spec: str = ""


@dataclass(frozen=True)
class Group:
    """Fields that share their rows: a message, or a whole table.

    Attributes:
        name: unique in its file.
        fields: at least one.
        comment: for people.

    """

    name: str
    fields: tuple[Field, ...]
    comment: str = ""


class Column(NamedTuple):
    """Numbers of one field.

    Attributes:
        values: shape (n,).
        missing: rows that lack it, whatever `values` says there, shape (n,); None: no row does.

    """

    values: NDArray[Any]
    missing: NDArray[np.bool_] | None = None


class Rows(NamedTuple):
    """Rows of one group.

    Attributes:
        group: whose.
        place: of each row among the rows of all groups that are written at once: 0, 1, 2, .. over
            the groups, ascending in each; shape (n,).
        t_ns: stamps, ns, shape (n,).
        columns: one a field of the group.

    """

    group: Group
    place: NDArray[np.int64]
    t_ns: NDArray[np.int64]
    columns: Sequence[Column]

    def between(self, first: int, end: int) -> "Rows":
        """The rows whose place is first .. end - 1, counted from `first`."""
        low, high = np.searchsorted(self.place, (first, end))
        part = slice(int(low), int(high))
        columns = [
            Column(c.values[part], None if c.missing is None else c.missing[part])
            for c in self.columns
        ]
        return Rows(self.group, self.place[part] - first, self.t_ns[part], columns)


class Sink(Protocol):
    """A file in the making, which knows a group from its first rows on."""

    def begin(self, t_ns: int) -> None:
        """Where its time begins, if it counts from a start."""

    def write(self, rows: Sequence[Rows]) -> None:
        """Append rows; `Rows.place` is their order."""

    def close(self) -> None:
        """Finish the file, which then gets its name."""

    def abandon(self) -> None:
        """Leave nothing behind."""


def count(rows: Sequence[Rows]) -> int:
    """Rows of all groups."""
    return sum(len(part.t_ns) for part in rows)


def in_order(rows: Sequence[Rows]) -> NDArray[np.int64]:
    """Stamps of the rows of all groups in their order, ns, shape (n,)."""
    t_ns = np.empty(count(rows), dtype=np.int64)
    for part in rows:
        t_ns[part.place] = part.t_ns
    return t_ns
