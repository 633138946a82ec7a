"""CSV in the dialects that spreadsheets and loggers write: layout, cells and times as they are."""

import csv
from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path

from adhesion_can.errors import TableError
from adhesion_can.formula_cells import unquote_formula
from adhesion_can.plurals import counted
from adhesion_can.recordings.tables.cells import (
    NumberColumn,
    decimal_marks,
    is_number,
    note_errors,
    number_column,
)
from adhesion_can.recordings.tables.columns import Column, Columns
from adhesion_can.recordings.tables.headings import name_columns
from adhesion_can.recordings.tables.layout import (
    DELIMITERS,
    TableLayout,
    comment_lines,
    find_layout,
    rows_of,
    trimmed,
)
from adhesion_can.recordings.tables.text import read_text

MOST_BELOW = 50
"""Most lines below the rows that are left out; more are rows of another length."""


def heading_of(text: str, wanted: Collection[str], path: Path) -> dict[str, str]:
    """Names in the heading of a text with the units that it states; {} where it is empty.

    Args:
        text: First lines of a file.
        wanted: Names of which the heading has one, where the file is a table.
        path: Path of the file, for errors.

    Raises:
        TableError: The text is not CSV.

    """
    heading = _recognise(text, wanted, path).heading
    return {unquote_formula(name): unit for name, unit in name_columns(heading)}


def read_csv(path: Path, wanted: Collection[str] = ()) -> Columns:
    """Columns of a file.

    Args:
        path: Path of the file.
        wanted: Names of which the heading has one.

    Raises:
        TableError: The file cannot be read, is not CSV, has a row of another length, a name that
            occurs twice, or numbers that may be read in two ways.

    """
    text = read_text(path)
    layout = _recognise(text, wanted, path)
    if not layout.heading:
        raise TableError(str(path), "empty", "write a heading and rows below it")
    _require_names(layout, path)
    notes = _layout_notes(layout)
    body = _body(text, layout, path, notes)
    if not body:
        raise TableError(str(path), "has a heading and no rows", "write one row for each sample")
    comments = comment_lines(text, layout)
    if comments:
        notes.append(f"skipped {counted(comments, 'line')} of comment between the rows")
    return _columns(layout, body, notes, str(path))


def _recognise(text: str, wanted: Collection[str], path: Path) -> TableLayout:
    try:
        return find_layout(text, wanted)
    except csv.Error as error:
        raise TableError(f"{path}:1", f"not CSV ({error})", "correct the line") from error


def _require_names(layout: TableLayout, path: Path) -> None:
    """TableError where two columns have one name."""
    names = [name for name, _ in name_columns(layout.heading)]
    twice = [name for name, count in Counter(names).items() if count > 1 and name]
    if not twice:
        return
    places = [place for place, name in enumerate(names, start=1) if name == twice[0]]
    cells = " and ".join(f"{place} ({layout.heading[place - 1]!r})" for place in places)
    raise TableError(
        f"{path}:{layout.line}", f"columns {cells} have the same name", "rename all of them but one"
    )


def _layout_notes(layout: TableLayout) -> list[str]:
    notes = []
    if layout.line > 1:
        notes.append(f"line {layout.line} is read as the heading")
    if layout.units:
        notes.append("the first line below the heading is read as units")
    return notes


def _body(text: str, layout: TableLayout, path: Path, notes: list[str]) -> list[list[str]]:
    """Rows of the heading's length; others below all of them are left out and reported."""
    width = len(layout.heading)
    body: list[list[str]] = []
    odd: list[tuple[int, list[str]]] = []
    try:
        for line, cells in rows_of(text, layout):
            row = trimmed(cells, width)
            if len(row) == width and not odd:
                body.append(row)
            elif len(row) == width or is_number(row[0]):
                raise _odd_row(odd[0] if odd else (line, row), width, path)
            else:
                odd.append((line, row))
    except csv.Error as error:
        raise TableError(f"{path}", f"not CSV ({error})", "correct the line") from error
    if len(odd) > MOST_BELOW or (odd and not body):
        raise _odd_row(odd[0], width, path)
    if odd:
        line, row = odd[0]
        shown = " ".join(row).strip()[:40]
        notes.append(f"skipped {counted(len(odd), 'line')} below the rows (line {line}: {shown!r})")
    return body


def _odd_row(odd: tuple[int, list[str]], width: int, path: Path) -> TableError:
    line, row = odd
    fields = f"{len(row)} fields under {width} columns"
    return TableError(f"{path}:{line}", fields, "correct the row")


def _columns(
    layout: TableLayout, body: Sequence[Sequence[str]], notes: list[str], where: str
) -> Columns:
    named = [(place, *pair) for place, pair in enumerate(name_columns(layout.heading))]
    units = {name: unit for _, name, unit in named if name and unit}
    for place, name, _ in named:
        unit = layout.units[place].strip("[]()").strip() if layout.units else ""
        if name and unit and unit.lower() != "none":
            units[name] = unit
    values: dict[str, Column] = {}
    numbers: dict[str, NumberColumn] = {}
    for place, heading, _ in named:
        if not heading:
            continue
        name = unquote_formula(heading)
        cells = [row[place].strip() for row in body]
        column = number_column(cells)
        if column is None:
            values[name] = tuple(map(unquote_formula, cells))
        else:
            values[name], numbers[name] = (), column  # in its place, until its marks are known
    marks = decimal_marks(numbers, layout.delimiter, where)
    for name, column in numbers.items():
        values[name] = column.values(marks[name])
        if column.percent:
            units[name] = "%"
    notes[:0] = _cell_notes(
        layout, {marks[name] for name, numeric_column in numbers.items() if numeric_column.marks}
    )
    notes.extend(note_errors(numbers))
    return Columns(values, {unquote_formula(k): v for k, v in units.items()}, tuple(notes))


def _cell_notes(layout: TableLayout, marks: Collection[str]) -> list[str]:
    """Sentence about what parts cells and decimals, in a list; [] where it is as usual."""
    parts = []
    if layout.delimiter != ",":
        parts.append(f"cells separated by {DELIMITERS[layout.delimiter]}")
    if "," in marks:
        parts.append("decimal commas")
    return [", ".join(parts)] if parts else []
