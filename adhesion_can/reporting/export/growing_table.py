"""One table for the rows of many groups; it gets wider with each new group."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, Protocol

from adhesion_can.files import OutputFile, Temporary
from adhesion_can.reporting.export.layout import Frames, Group, GroupRows, Sink


class PartFile(Protocol):
    """Rows of a fixed set of columns on their way into a file."""

    def write(self, rows: Sequence[GroupRows]) -> None:
        """Append rows of the part's own groups."""

    def close(self) -> None:
        """Write what is left; the file stays open."""


class TableFormat(Protocol):
    """How a format writes a table."""

    def open(self, file: BinaryIO, groups: Sequence[Group]) -> PartFile:
        """Start a file with the columns of some groups."""

    def join(
        self, parts: Sequence[tuple[Temporary, int]], file: BinaryIO, groups: Sequence[Group]
    ) -> None:
        """Write one file of several, each with the columns of the first so many groups."""


class GrowingTable(Sink):
    """Writes a table whose columns become known as it is written.

    The messages in a recording are known only at its end, and a column for every signal of a large
    database would be mostly empty. So a new part of the file starts with each new group, and the
    parts are joined at the end. Nearly always all groups stand in the first rows: one part then.

    Args:
        path: Path of the finished table.
        table_format: Format of the table.
        groups: Groups known from the start.

    """

    def __init__(self, path: Path, table_format: TableFormat, groups: Sequence[Group] = ()) -> None:
        self._format = table_format
        self._groups = {group.name: group for group in groups}
        self._out = OutputFile(path, random_access=True)
        self._parts: list[tuple[Temporary, int]] = []
        """Parts in front of the one that is written, each with its number of groups."""
        self._part: PartFile | None = None
        self._width = 0
        """Number of groups of the part that is written."""
        if groups:
            try:
                self._begin()
            except BaseException:
                self.abandon()
                raise

    def write(self, rows: Sequence[GroupRows], _frames: Frames | None = None) -> None:
        """Append rows."""
        held = [part for part in rows if len(part.t_ns)]
        fresh = [part for part in held if part.group.name not in self._groups]
        for part in sorted(fresh, key=lambda part: int(part.position[0])):
            self._groups[part.group.name] = part.group
        if fresh:
            self._begin()
        if held and self._part is not None:
            self._part.write(held)

    def close(self) -> None:
        """Finish the table, which then gets its name."""
        if self._part is None:
            self._begin()
        if self._parts:
            self._set_aside()
            self._format.join(self._parts, self._out.file, list(self._groups.values()))
        else:
            self._end()
        self._out.finish()
        self._remove_parts()

    def abandon(self) -> None:
        """Delete what has been written so far."""
        # The file is deleted, so its end may be missing; on a full disk it cannot be written.
        with suppress(OSError):
            self._end()
        self._out.abandon()
        self._remove_parts()

    def _begin(self) -> None:
        if self._part is not None:
            self._set_aside()
        self._width = len(self._groups)
        self._part = self._format.open(self._out.file, list(self._groups.values()))

    def _set_aside(self) -> None:
        self._end()
        self._parts.append((self._out.set_aside(), self._width))

    def _end(self) -> None:
        part, self._part = self._part, None
        if part is not None:
            part.close()

    def _remove_parts(self) -> None:
        for part, _ in self._parts:
            part.remove()
