"""One table for the rows of many groups; it gets wider with each new group."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from adhesion_can.reporting.export.layout import Frames, Group, Rows


class PartFile(Protocol):
    """A file of a fixed set of columns."""

    def write(self, rows: Sequence[Rows]) -> None:
        """Append rows of the part's own groups."""

    def close(self) -> None:
        """Finish the file."""


class TableFormat(Protocol):
    """How a format writes a table."""

    def open(self, path: Path, groups: Sequence[Group]) -> PartFile:
        """Begin a file with the columns of some groups."""

    def join(self, parts: Sequence[tuple[Path, int]], path: Path, groups: Sequence[Group]) -> None:
        """Write one file of several, each with the columns of the first so many groups."""


class GrowingTable:
    """Writes a table whose columns become known as it is written.

    The messages in a recording are known only at its end, and a column for every signal of a large
    database would be mostly empty. So a new part of the file begins with each new group, and the
    parts are joined at the end. Nearly always all groups stand in the first rows: one part then.

    Args:
        path: Path of the finished table.
        table_format: Format of the table.
        groups: Groups known from the start.

    """

    def __init__(self, path: Path, table_format: TableFormat, groups: Sequence[Group] = ()) -> None:
        self._path = path
        self._format = table_format
        self._groups = {group.name: group for group in groups}
        self._parts: list[tuple[Path, int]] = []
        self._joined = path.with_name(path.name + ".part")
        self._part: PartFile | None = None
        if groups:
            self._begin()

    def begin(self, t_ns: int) -> None:
        """Do nothing: the table keeps the stamps of the recording."""

    def write(self, rows: Sequence[Rows], _frames: Frames | None = None) -> None:
        """Append rows."""
        held = [part for part in rows if len(part.t_ns)]
        fresh = [part for part in held if part.group.name not in self._groups]
        for part in sorted(fresh, key=lambda part: int(part.position[0])):
            self._groups[part.group.name] = part.group
        if fresh:
            self._begin()
        if held and self._part is not None:
            self._part.write(held)

    def problems(self) -> list[str]:
        """Nothing: the table holds the numbers as they are."""
        return []

    def close(self) -> None:
        """Finish the table, which then gets its name."""
        if not self._parts:
            self._begin()
        self._end()
        last = self._parts[0][0]
        if len(self._parts) > 1:
            last = self._joined
            self._format.join(self._parts, last, list(self._groups.values()))
        last.replace(self._path)
        for path in self._made():
            path.unlink(missing_ok=True)

    def abandon(self) -> None:
        """Delete what has been written so far."""
        # The file is deleted, so its end may be missing; on a full disk it cannot be written.
        with suppress(OSError):
            self._end()
        for path in self._made():
            # The error that led here is the one to be raised.
            with suppress(OSError):
                path.unlink(missing_ok=True)

    def _begin(self) -> None:
        self._end()
        path = self._path.with_name(f"{self._path.name}.part{len(self._parts) + 1}")
        self._parts.append((path, len(self._groups)))
        self._part = self._format.open(path, list(self._groups.values()))

    def _end(self) -> None:
        part, self._part = self._part, None
        if part is not None:
            part.close()

    def _made(self) -> list[Path]:
        """Paths of all temporary files; some may be gone by now."""
        return [*(part for part, _ in self._parts), self._joined]
