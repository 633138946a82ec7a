"""Where the heading of a text table is, and what parts its cells.

Tables of spreadsheets and loggers start with a title, with lines about the rig, with comment; below
the names there may be a line of units and one of kinds. What parts the cells is a comma, a
semicolon, a tab, a bar or spaces. Line numbers are those of the file.
"""

import csv
import io
import re
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from adhesion_can.recordings.tables.cells import ERRORS, NO_VALUE, is_number
from adhesion_can.recordings.tables.columns import split_unit

DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "spaces"}
"""What may part the cells, and its name; spaces only where nothing else does."""
_COMMENT = re.compile(r"[ \t]*(?:#|%|//)")
_STATED = re.compile(r"sep=(.)\s*", re.IGNORECASE)
"""First line that names the delimiter for a spreadsheet."""
LOOKED_AT = 1000
"""First lines in which the heading is looked for."""
SAMPLED = 50
"""Rows that show in which places there are numbers."""
_NO_VALUES = NO_VALUE | ERRORS
_NOTHING = frozenset({"", "-", "1"})
"""Units of a column that has none."""

Row = tuple[int, list[str]]
"""Number of a row's last line, and its cells."""


@dataclass(frozen=True, slots=True)
class TableLayout:
    """How the cells of a text are written.

    Attributes:
        delimiter: What parts the cells; ' ' for any number of spaces.
        heading: Cells of the heading, stripped; () where there is none.
        line: Number of the heading's line.
        units: Cells of a line of units below it; () where there is none.
        body: Number of the last line in front of the first row.

    """

    delimiter: str
    heading: tuple[str, ...]
    line: int = 1
    units: tuple[str, ...] = ()
    body: int = 1

    @property
    def names(self) -> tuple[str, ...]:
        """Names in the heading, units taken off."""
        return tuple(split_unit(cell)[0] for cell in self.heading)


def find_layout(text: str, wanted: Collection[str] = ()) -> TableLayout:
    """Layout of a text: the one whose heading has a wanted name and the most even rows.

    Args:
        text: Text of a file, or its first lines.
        wanted: Names of which the heading has one.

    Raises:
        csv.Error: No row can be read.

    """
    lines = text.splitlines(keepends=True)[:LOOKED_AT]
    stated = _STATED.fullmatch(lines[0]) if lines else None
    choices = [stated[1]] if stated and stated[1] in DELIMITERS else list(DELIMITERS)
    best, most = TableLayout(",", ()), (False, False, 0.0, 0)
    for delimiter in choices:
        if delimiter == " " and most[1] and most[3] > 1:
            continue  # names and texts have spaces too
        try:
            layout, even = _layout(lines, delimiter, wanted, 1 if stated else 0)
        except csv.Error:
            if delimiter == ",":
                raise
            continue
        if layout is None:
            continue
        has_wanted = not set(wanted).isdisjoint(layout.names)
        width = len(layout.heading)
        score = (has_wanted, width > 1, even, width)
        if score > most:
            best, most = layout, score
    return best


def rows_of(text: str, layout: TableLayout) -> Iterator[Row]:
    """Rows below the heading and its units that have a cell; comment lines among them are not.

    A line that starts as comment does is a row where it has as many cells as the heading.
    """
    width = len(layout.heading)
    lines = io.StringIO(text, newline="")
    kept = (
        line
        if number > layout.body and not _is_comment(line, layout.delimiter, width)
        else _blank(line)
        for number, line in enumerate(lines, start=1)
    )
    return _rows(kept, layout.delimiter)


def comment_lines(text: str, layout: TableLayout) -> int:
    """Number of lines of comment between the rows."""
    width = len(layout.heading)
    lines = io.StringIO(text, newline="")
    return sum(
        _is_comment(line, layout.delimiter, width)
        for number, line in enumerate(lines, start=1)
        if number > layout.body
    )


def trimmed(row: Sequence[str], width: int) -> list[str]:
    """A row without empty cells behind a width: some programs end each line with a delimiter."""
    end = len(row)
    while end > width and not row[end - 1].strip():
        end -= 1
    return list(row[:end])


def _layout(
    lines: Sequence[str], delimiter: str, wanted: Collection[str], skipped: int
) -> tuple[TableLayout | None, float]:
    """Layout with this delimiter, and the share of its rows that are as wide as the heading."""
    bare = [
        _blank(line) if number < skipped or _COMMENT.match(line) else line
        for number, line in enumerate(lines)
    ]
    rows = list(_rows(iter(bare), delimiter))
    if not rows:
        commented = _commented_heading(lines, delimiter, None)
        return (commented, 1.0) if commented else (None, 0.0)
    width = _usual_width([row for _, row in rows])
    full = [(line, row) for line, row in rows if len(trimmed(row, width)) == width]
    numeric = _numeric_places([row for _, row in full], width)
    named = next((line for line, row in rows if _has_a_name(row, wanted)), 0)
    body = next(
        (line for line, row in full if line > named and not _is_label(row, numeric)),
        rows[-1][0] + 1,
    )
    above = [(line, row) for line, row in rows if line < body]
    even = len(full) / len(rows)
    if not above:
        commented = _commented_heading(lines, delimiter, width) if numeric else None
        return commented or _from_heading(rows, delimiter), even
    wide = [line for line, row in above if len(trimmed(row, width)) == width]
    line = named or (wide or [above[-1][0]])[0]
    heading = next(row for number, row in above if number == line)
    below = [(number, row) for number, row in above if number > line]
    units = _stripped(trimmed(below[0][1], width)) if below else ()
    layout = TableLayout(
        delimiter,
        _stripped(trimmed(heading, width if len(heading) > width else 1)),
        line,
        units if len(units) == width else (),
        body=below[-1][0] if below else line,
    )
    return layout, even


def _has_a_name(row: Sequence[str], wanted: Collection[str]) -> bool:
    """Whether a row has one of the wanted names."""
    return any(split_unit(cell)[0] in wanted for cell in row)


def _from_heading(rows: Sequence[Row], delimiter: str) -> TableLayout:
    """Layout whose first row is the heading."""
    line, heading = rows[0]
    return TableLayout(delimiter, _stripped(heading), line, body=line)


def _usual_width(rows: Sequence[Sequence[str]]) -> int:
    """Number of cells of most rows, without a last one that is empty in all of them."""
    counts = Counter(len(row) for row in rows)
    width = max(counts, key=lambda number: (counts[number], number))
    wide = [row for row in rows if len(row) == width]
    while width > 1 and all(not row[width - 1].strip() for row in wide):
        width -= 1
    return width


def _numeric_places(rows: Sequence[Sequence[str]], width: int) -> list[int]:
    """Places in which most of the rows below the first ones have numbers."""
    sampled = rows[-SAMPLED:] if len(rows) < 2 * SAMPLED else rows[SAMPLED : 2 * SAMPLED]
    return [
        place
        for place in range(width)
        if 2 * sum(is_number(row[place]) for row in sampled) > len(sampled)
        or (len(sampled) < 4 and len(sampled) > 0 and is_number(sampled[-1][place]))
    ]


def _is_label(row: Sequence[str], numeric: Sequence[int]) -> bool:
    """Whether a row has names, units or kinds where others have numbers."""
    texts = [row[place].strip() for place in numeric]
    stated = [text for text in texts if text not in _NOTHING and text.lower() not in _NO_VALUES]
    return bool(stated) and not any(map(is_number, stated))


def _commented_heading(
    lines: Sequence[str], delimiter: str, width: int | None
) -> TableLayout | None:
    """Layout with the last comment above the rows as heading, as NumPy writes it."""
    last = 0
    for number, line in enumerate(lines, start=1):
        if line.strip() and not _COMMENT.match(line):
            break
        last = number if line.strip() else last
    if not last:
        return None
    bare = _COMMENT.sub("", lines[last - 1], count=1)
    cells = next((row for _, row in _rows(iter([bare]), delimiter)), [])
    if width is None or len(cells) != width:
        return None
    return TableLayout(delimiter, _stripped(cells), last, body=last)


def _is_comment(line: str, delimiter: str, width: int) -> bool:
    """Whether a line is comment, and no row whose first cell looks like it."""
    if not _COMMENT.match(line):
        return False
    cells = next((row for _, row in _rows(iter([line]), delimiter)), [])
    return len(trimmed(cells, width)) != width


def _rows(lines: Iterator[str], delimiter: str) -> Iterator[Row]:
    """Line number and cells of every row with a cell that is not empty."""
    if delimiter == " ":
        for number, line in enumerate(lines, start=1):
            words = _words(line)
            if words:
                yield number, words
        return
    reader = csv.reader(lines, delimiter=delimiter, strict=False)
    for row in reader:
        if any(cell.strip() for cell in row):
            yield reader.line_num, row


def _words(line: str) -> list[str]:
    """Cells between spaces; a unit in brackets belongs to the name in front of it."""
    words: list[str] = []
    for word in line.split():
        if words and word[0] in "[(" and word[-1] in "])":
            words[-1] += f" {word}"
        else:
            words.append(word)
    return words


def _stripped(row: Sequence[str]) -> tuple[str, ...]:
    return tuple(cell.strip() for cell in row)


def _blank(line: str) -> str:
    """The end of a line alone, which keeps the numbers of those behind it."""
    return line[len(line.rstrip("\r\n")) :] or "\n"
