"""Parts of a file of columns, whatever its format: fields, groups of fields, and rows."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block

SECOND = 1_000_000_000
"""Number of nanoseconds in a second."""

FLOAT = np.dtype(np.float64)


@dataclass(frozen=True)
class Raw:
    """Integers that a field's numbers come from: number = raw · scale + offset, to the last bit.

    Attributes:
        dtype: Type of the integers.
        scale: Step of the integers, in the field's unit.
        offset: Number of the integer 0, in the field's unit.

    """

    dtype: np.dtype[Any]
    scale: float
    offset: float


@dataclass(frozen=True)
class Field:
    """One column.

    Attributes:
        name: Name of the field, unique in its group.
        dtype: Type of the numbers.
        unit: Unit of the numbers; '' for none.
        comment: Description for the reader of the file.
        names: Names of some of the numbers.
        text: Whether the names stand in place of the numbers; every number has one then.
        optional: Whether a row may lack the field.
        raw: Integers that a format with scaling may write in place of the numbers.
        spec: Format specification of Python for CSV; '' writes the shortest text that reads back
            exactly.

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
        name: Name of the group, unique in its file and channel.
        fields: Fields of the group, at least one.
        comment: Description for the reader of the file.
        channel: Name of the bus, in formats that keep buses apart; else ''.

    """

    name: str
    fields: tuple[Field, ...]
    comment: str = ""
    channel: str = ""


class FieldColumn(NamedTuple):
    """Numbers of one field.

    Attributes:
        values: Numbers, shape (n,).
        missing: Rows without the field, whose number means nothing, shape (n,); None: no row.

    """

    values: NDArray[Any]
    missing: NDArray[np.bool_] | None = None

    def select(self, rows: slice | NDArray[np.int64]) -> "FieldColumn":
        """Some of the rows, in their order."""
        missing = None if self.missing is None else self.missing[rows]
        return FieldColumn(self.values[rows], missing)


class GroupRows(NamedTuple):
    """Rows of one group.

    Attributes:
        group: Group of the rows.
        position: Position of each row among the rows of all groups that are written at once: 0, 1,
            2, .. over the groups, ascending in each; shape (n,).
        t_ns: Time stamps, ns, shape (n,).
        columns: Column of each field of the group.

    """

    group: Group
    position: NDArray[np.int64]
    t_ns: NDArray[np.int64]
    columns: Sequence[FieldColumn]

    def between(self, first: int, end: int) -> "GroupRows":
        """The rows whose position is first .. end - 1, counted from `first`."""
        low, high = np.searchsorted(self.position, (first, end))
        part = slice(int(low), int(high))
        columns = [column.select(part) for column in self.columns]
        return GroupRows(self.group, self.position[part] - first, self.t_ns[part], columns)


class Frames(NamedTuple):
    """Frames that rows were decoded from, among all others of their block.

    Attributes:
        block: Block of the recording.
        place: Row of the block of each `GroupRows.position`, ascending, shape (n,).

    """

    block: Block
    place: NDArray[np.int64]


class Sink(ABC):
    """A file in the making; a group starts with its first rows."""

    def begin(self, t_ns: int) -> None:  # noqa: B027  most formats keep the stamps
        """Set the start of the file's time, ns, where it counts from one; before the first rows."""

    @abstractmethod
    def write(self, rows: Sequence[GroupRows], frames: Frames | None = None) -> None:
        """Append rows; `GroupRows.position` is their order.

        Args:
            rows: Rows of some groups.
            frames: Frames behind the rows, for a format that keeps them.

        """

    def problems(self) -> list[str]:
        """Sentences about what the file does not hold exactly."""
        return []

    @abstractmethod
    def close(self) -> None:
        """Finish the file, which then gets its name."""

    @abstractmethod
    def abandon(self) -> None:
        """Delete what has been written so far."""


def count(rows: Sequence[GroupRows]) -> int:
    """Number of rows of all groups."""
    return sum(len(part.t_ns) for part in rows)


def in_order(rows: Sequence[GroupRows]) -> NDArray[np.int64]:
    """Stamps of the rows of all groups in their order, ns, shape (n,)."""
    t_ns = np.empty(count(rows), dtype=np.int64)
    for part in rows:
        t_ns[part.position] = part.t_ns
    return t_ns
