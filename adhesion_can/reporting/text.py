"""Tables for a terminal; the same, without colour, in a pipe."""

import sys
from collections.abc import Iterable, Sequence
from typing import IO, Any

from rich import box
from rich.console import Console, ConsoleOptions, RenderResult
from rich.measure import Measurement
from rich.table import Table
from rich.text import Text

from adhesion_can.printable import printable

UNLIMITED = 10_000
PIPE_WIDTH = 120
"""Columns where the output is no terminal, so that a file does not depend on who wrote it."""


def console(file: IO[str] | None = None) -> Console:
    """Console on stdout, or on `file`."""
    file = file or sys.stdout
    # On a terminal lines break between words; in a pipe a sentence stays a line.
    is_terminal = file.isatty()
    width = None if is_terminal else PIPE_WIDTH
    return _Console(
        file=file,
        width=width,
        highlight=False,
        markup=False,
        emoji=False,
        soft_wrap=not is_terminal,
    )


class _Console(Console):
    """Console on which text of strangers is text: no control characters, no markup, no signs."""

    def render_str(self, text: str, **options: Any) -> Text:
        """A string as text, with escapes in place of what a terminal would obey."""
        return super().render_str(printable(text), **options)


class FittingTable:
    """A table that cuts no cell: where it is too wide, it goes on below with its first column.

    The first column is to the left, the others are to the right.

    Args:
        title: Title.
        columns: Headings.
        rows: Cells, row by row.

    """

    def __init__(self, title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
        self.title = title
        self.columns = list(columns)
        self.rows = [list(row) for row in rows]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        title, begin = self.title, 1
        while True:
            end = len(self.columns)
            while end > begin + 1 and not self._fits(console, options, begin, end):
                end -= 1
            yield self._part(title, begin, end)
            if end >= len(self.columns):
                return
            title, begin = "", end

    def _fits(self, console: Console, options: ConsoleOptions, begin: int, end: int) -> bool:
        wide = options.update(max_width=UNLIMITED)
        width = Measurement.get(console, wide, self._part("", begin, end)).maximum
        return width <= options.max_width

    def _part(self, title: str, begin: int, end: int) -> Table:
        """The first column to the left, some of the others to the right."""
        made = Table(
            title=title or None,
            title_justify="left",
            box=box.SIMPLE_HEAD,
            pad_edge=False,
            collapse_padding=True,
        )
        for i in (0, *range(begin, end)):
            name = self.columns[i]
            made.add_column(name, justify="left" if i == 0 else "right", no_wrap=True)
        for row in self.rows:
            made.add_row(row[0], *row[begin:end])
        return made
