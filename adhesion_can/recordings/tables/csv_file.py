"""CSV in the dialects that spreadsheets and loggers write.

Recognised are commas, semicolons, tabs and bars between cells, decimal commas where the cells are
not separated by commas, lines of comment (`#`, `%`, `//`), a commented heading as NumPy writes it,
and a line of units below the heading. Line numbers in errors are those of the file.
"""

import csv
import gzip
import io
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from adhesion_can.errors import TableError
from adhesion_can.formula_cells import unquote_formula
from adhesion_can.recordings.candump_columns.text_source import Packing
from adhesion_can.recordings.tables.columns import (
    NO_VALUE,
    Column,
    Columns,
    as_column,
    has_decimal_comma,
    is_number,
    split_unit,
)

DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
_COMMENT = re.compile(r"^[ \t]*(#|%|//)[^\r\n]*", re.MULTILINE)
LARGEST_TEXT = 512 << 20
"""Most text of a table, unpacked, bytes: its cells take many times as much, and a packed file of
1 MiB may hold 1 GiB."""
ALWAYS_READ, MOST_TIMES = 32 << 20, 200
"""Text of a packed table that is read whatever its file's size, bytes, and beyond it how many times
that size: numbers pack to a third, and the same row over and over to a hundredth."""
HEAD = 20
"""Lines from which the dialect is recognised."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """How the cells of a file are written.

    Attributes:
        delimiter: Character between cells.
        heading: Cells of the heading, stripped.
        commented: Whether the heading is the last line of comment.

    """

    delimiter: str
    heading: tuple[str, ...]
    commented: bool = False


def read_heading(path: Path) -> tuple[str, ...]:
    """Names in the heading of a file, units taken off; () where it is empty.

    Raises:
        TableError: The file cannot be read, or is not CSV.

    """
    return tuple(split_unit(cell)[0] for cell in _recognise(_text(path), path).heading)


def read_csv(path: Path) -> Columns:
    """Columns of a file.

    Raises:
        TableError: The file cannot be read, is not CSV, or has a row of another length.

    """
    text = _text(path)
    dialect = _recognise(text, path)
    if not dialect.heading:
        raise TableError(str(path), "empty", "write a heading and rows below it")
    rows = _rows(text, path, dialect.delimiter)
    if not dialect.commented:
        next(rows)
    body = []
    for line, row in rows:
        if len(row) != len(dialect.heading):
            fields = f"{len(row)} fields under {len(dialect.heading)} columns"
            raise TableError(f"{path}:{line}", fields, "correct the row")
        body.append(row)
    comma = dialect.delimiter != "," and any(
        has_decimal_comma(cell) for row in body for cell in row
    )
    units = _units(body, decimal_comma=comma)
    body = body[1:] if units else body
    if not body:
        raise TableError(str(path), "has a heading and no rows", "write one row a sample")
    return _columns(dialect, body, units, decimal_comma=comma)


def _columns(
    dialect: Dialect, body: Sequence[list[str]], units: Sequence[str], *, decimal_comma: bool
) -> Columns:
    names = [split_unit(cell) for cell in dialect.heading]
    known = {name: unit for name, unit in names if name and unit}
    if units:
        below = zip(names, units, strict=True)
        known |= {name: unit for (name, _), unit in below if name and unit}
    values = {
        name: _column([row[place] for row in body], decimal_comma=decimal_comma)
        for place, (name, _) in enumerate(names)
        if name
    }
    notes = []
    if dialect.delimiter != ",":
        decimals = ", decimal commas" if decimal_comma else ""
        notes.append(f"cells separated by {DELIMITERS[dialect.delimiter]}{decimals}")
    if units:
        notes.append("the first line below the heading has the units")
    return Columns(values, known, tuple(notes))


def _column(cells: Sequence[str], *, decimal_comma: bool) -> Column:
    column = as_column(cells, decimal_comma=decimal_comma)
    return tuple(map(unquote_formula, column)) if isinstance(column, tuple) else column


def _recognise(text: str, path: Path) -> Dialect:
    """Dialect of a text: the delimiter under which heading and next line have most cells alike."""
    head = "".join(text.splitlines(keepends=True)[: 50 * HEAD])
    best, most = Dialect(",", ()), (False, 0)
    for delimiter in DELIMITERS:
        try:
            first = [row for _, row in zip(range(2), _rows(head, path, delimiter), strict=False)]
        except TableError:
            if delimiter == ",":
                raise
            continue
        cells = [row for _, row in first]
        if not cells:
            return _commented_heading(text, best, []) or best
        alike = len(cells) < 2 or len(cells[0]) == len(cells[1])
        if (alike and len(cells[0]) > 1, len(cells[0])) > most:
            most = (alike and len(cells[0]) > 1, len(cells[0]))
            heading = tuple(unquote_formula(cell.strip()) for cell in cells[0])
            best = _commented_heading(text, Dialect(delimiter, heading), cells[0]) or Dialect(
                delimiter, heading
            )
    return best


def _commented_heading(text: str, dialect: Dialect, row: Sequence[str]) -> Dialect | None:
    """The dialect with a heading from the comment above rows of numbers; None without one."""
    if not row or not all(is_number(cell) or has_decimal_comma(cell) for cell in row):
        return None
    lines = []
    for line in text.splitlines()[: 50 * HEAD]:
        if line.strip() and not _COMMENT.match(line):
            break
        lines += [line] if line.strip() else []
    if not lines:
        return None
    bare = re.sub(r"^[ \t]*(#|%|//)", "", lines[-1])
    heading = tuple(cell.strip() for cell in next(csv.reader([bare], delimiter=dialect.delimiter)))
    if len(heading) != len(row):
        return None
    return Dialect(dialect.delimiter, heading, commented=True)


def _units(body: Sequence[list[str]], *, decimal_comma: bool) -> tuple[str, ...]:
    """Units in the first row; () where it holds values.

    In a line of units no cell is a number where the row below has one, but for the unit 1.
    """
    if len(body) < 2:
        return ()
    first, second = body[0], body[1]
    numeric = [
        place for place, cell in enumerate(second) if is_number(cell, decimal_comma=decimal_comma)
    ]
    stated = [first[place].strip() for place in numeric]
    texts = [text for text in stated if text not in {"", "-", "1"}]
    if not texts or any(text.lower() in NO_VALUE for text in texts):
        return ()
    if any(is_number(text, decimal_comma=decimal_comma) for text in texts):
        return ()
    return tuple(cell.strip().strip("[]()").strip() for cell in first)


def _rows(text: str, path: Path, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of every row with a cell that is not empty."""
    reader = csv.reader(
        io.StringIO(_COMMENT.sub("", text), newline=""), delimiter=delimiter, strict=False
    )
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                yield reader.line_num, row
    except csv.Error as error:
        what = f"not CSV ({error})"
        raise TableError(f"{path}:{reader.line_num}", what, "correct the line") from error


def _text(path: Path) -> str:
    content = _read(path)
    if content[:2] in {b"\xff\xfe", b"\xfe\xff"}:
        return content.decode("utf-16", "replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        # What spreadsheets write in Western Europe, where units hold 'µ' and '°'.
        return content.decode("cp1252", "replace")


def _read(path: Path) -> bytes:
    most = LARGEST_TEXT
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
        if Packing.from_head(content) is Packing.GZIP:
            most = min(max(ALWAYS_READ, MOST_TIMES * len(content)), LARGEST_TEXT)
            content = gzip.GzipFile(fileobj=io.BytesIO(content)).read(most + 1)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise TableError(
            str(path), f"the gzip file is damaged ({error})", "compress it again"
        ) from error
    except OSError as error:
        raise TableError(str(path), error.strerror or "cannot be read", "check the path") from error
    if len(content) > most:
        raise TableError(
            str(path),
            f"more than {most >> 20} MiB of text",
            "cut it into parts, or write it as Parquet",
        )
    return content
