"""Numbers from the cells of a table: decimal marks, thousands, percent, a spreadsheet's errors.

A number such as `1.989` is 1.989 in one country and 1989 in another. Cells that can be read in one
way only decide for their column, and columns for the file; what nothing decides is an error.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Flag, auto

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.errors import TableError
from adhesion_can.plurals import counted

NO_VALUE = frozenset({"", "-", "--", "na", "n/a", "none", "null"})
"""Cells without a value, in lower case; 'nan' is a number."""
ERRORS = frozenset({
    "#n/a", "#na", "#nv", "#n/d", "#div/0!", "#¡div/0!", "#value!", "#wert!", "#valeur!",
    "#¡valor!", "#valore!", "#ref!", "#bezug!", "#¡ref!", "#num!", "#zahl!", "#nombre!", "#¡num!",
    "#name?", "#nom?", "#¿nombre?", "#null!", "#nul!", "#error!", "#fehler!",
})  # fmt: skip
"""What spreadsheets write where a formula has no value, in lower case."""
_SIGNS = str.maketrans({"\u2212": "-", "\u2013": "-", "\ufe63": "-", "\uff0d": "-"})
_PLAIN = re.compile(r"[-+]?\d+(?:[eE][-+]?\d+)?")
_GAPS = re.compile(r"(?<=\d)[ '\u2019\u00a0\u202f\u2009](?=\d{3}(?!\d))")
"""Marks of thousands that are no decimal marks anywhere."""


class NumberMark(Flag):
    """What a cell, or all of a column, says of the marks in its numbers."""

    NONE = 0
    POINT = auto()
    """A point that can only be the decimal mark, or a comma that can only part thousands."""
    COMMA = auto()
    """A comma that can only be the decimal mark, or a point that can only part thousands."""
    MAYBE_POINT = auto()
    """A point that is the decimal mark or parts thousands."""
    MAYBE_COMMA = auto()
    """A comma that is the decimal mark or parts thousands."""


@dataclass(frozen=True, slots=True)
class NumberColumn:
    """A column whose cells are numbers.

    Attributes:
        cells: Texts of the numbers, in ASCII, without percent signs; '' where there is no value.
        marks: What they say of decimal marks.
        percent: Whether all of them end with a percent sign.
        errors: Number of cells with a spreadsheet's error.

    """

    cells: tuple[str, ...]
    marks: NumberMark
    percent: bool
    errors: int

    def values(self, decimal: str) -> Array:
        """Numbers, NaN where there is no value; shape (n,)."""
        return np.array([_value(cell, decimal) for cell in self.cells], dtype=np.float64)


def number_column(cells: Sequence[str]) -> NumberColumn | None:
    """Cells of a column as numbers; None where one of them is none, or the marks contradict."""
    kept: list[str] = []
    marks, errors, percents, values = NumberMark.NONE, 0, 0, 0
    for cell in cells:
        text = cell.strip()
        known = text.lower()
        if known in NO_VALUE or known in ERRORS:
            errors += known in ERRORS
            kept.append("")
            continue
        text = plain_text(text)
        if text.endswith("%"):
            percents += 1
            text = text[:-1].rstrip()
        mark = mark_of(text)
        if mark is None:
            return None
        marks |= mark
        values += 1
        kept.append(text)
    if percents not in (0, values) or (not values and any(cell.strip() for cell in cells)):
        return None
    if NumberMark.POINT in marks and NumberMark.COMMA in marks:
        return None
    return NumberColumn(tuple(kept), marks, percents > 0, errors)


def plain_text(text: str) -> str:
    """A number's text with ASCII's minus sign and without gaps between thousands."""
    return text if text.isascii() and " " not in text and "'" not in text else _GAPS.sub(
        "", text.translate(_SIGNS)
    )  # fmt: skip


def mark_of(text: str) -> NumberMark | None:
    """What the marks in a number's text say; None where it is no number."""
    points, commas = text.count("."), text.count(",")
    if not points and not commas:
        return NumberMark.NONE if _PLAIN.fullmatch(text) or is_float(text) else None
    if points and commas:
        decimal = "." if text.rfind(".") > text.rfind(",") else ","
        sure = NumberMark.POINT if decimal == "." else NumberMark.COMMA
        return None if np.isnan(_value(text, decimal)) else sure
    mark, other = (".", ",") if points else (",", ".")
    if points + commas > 1:  # it can only part thousands
        sure = NumberMark.COMMA if mark == "." else NumberMark.POINT
        return None if np.isnan(_value(text, other)) else sure
    if not is_float(text.replace(",", ".")):
        return None
    if _grouped(mark).fullmatch(text) and text.lstrip("+-")[0] != "0":
        return NumberMark.MAYBE_POINT if mark == "." else NumberMark.MAYBE_COMMA
    return NumberMark.POINT if mark == "." else NumberMark.COMMA


def is_number(cell: str) -> bool:
    """Whether a cell is a number by itself, whatever its marks mean."""
    text = plain_text(cell.strip())
    return bool(text) and mark_of(text.removesuffix("%").rstrip()) is not None


def has_no_value(cell: str) -> bool:
    """Whether a cell is empty, or says that there is no value."""
    return cell.strip().lower() in NO_VALUE | ERRORS


def decimal_marks(
    columns: Mapping[str, NumberColumn], delimiter: str, where: str
) -> dict[str, str]:
    """Decimal mark of each column, '.' or ','.

    Args:
        columns: Columns of numbers by name.
        delimiter: Character between the cells of the file.
        where: Name of the file, for the error.

    Raises:
        TableError: Numbers of a column may be read in two ways.

    """
    sure = _sure(columns.values())
    return {
        name: _decimal_mark(name, column, sure, delimiter, where)
        for name, column in columns.items()
    }


def _sure(columns: Iterable[NumberColumn]) -> NumberMark:
    marks = NumberMark.NONE
    for column in columns:
        marks |= column.marks & (NumberMark.POINT | NumberMark.COMMA)
    return marks


def _decimal_mark(
    name: str, column: NumberColumn, sure: NumberMark, delimiter: str, where: str
) -> str:
    marks = column.marks
    if marks & (NumberMark.POINT | NumberMark.COMMA):
        return "." if NumberMark.POINT in marks else ","
    maybe = marks & (NumberMark.MAYBE_POINT | NumberMark.MAYBE_COMMA)
    if not maybe:
        return "."
    if sure in (NumberMark.POINT, NumberMark.COMMA):
        return "." if sure is NumberMark.POINT else ","
    if sure is NumberMark.NONE and maybe is NumberMark.MAYBE_POINT:
        return "."  # as every program writes numbers
    if sure is NumberMark.NONE and maybe is NumberMark.MAYBE_COMMA and delimiter != ",":
        return ","
    cell = next(text for text in column.cells if "." in text or "," in text)
    whole, part = re.sub(r"[.,]", "", cell), re.sub(",", ".", cell)
    raise TableError(
        where,
        f"column {name!r}: {cell!r} may be {whole} or {part}",
        "write the numbers without marks between thousands",
    )


def note_errors(columns: Mapping[str, NumberColumn]) -> list[str]:
    """Sentence about cells with a spreadsheet's error, in a list; [] where there is none."""
    errors = {name: column.errors for name, column in columns.items() if column.errors}
    if not errors:
        return []
    where = ", ".join(f"{name!r}" for name in errors)
    count = counted(sum(errors.values()), "cell")
    return [f"{count} with a spreadsheet's error count as empty, in {where}"]


def _grouped(mark: str) -> re.Pattern[str]:
    return _GROUPED_POINT if mark == "." else _GROUPED_COMMA


_GROUPED_POINT = re.compile(r"[-+]?\d{1,3}(?:\.\d{3})+")
_GROUPED_COMMA = re.compile(r"[-+]?\d{1,3}(?:,\d{3})+")


def _value(text: str, decimal: str) -> float:
    """Number of a text; NaN where it is none with this decimal mark."""
    if not text:
        return np.nan
    other = "," if decimal == "." else "."
    if other in text:
        whole, mark, part = text.partition(decimal)
        if not _grouped(other).fullmatch(whole):
            return np.nan
        text = whole.replace(other, "") + mark + part
    try:
        return float(text.replace(decimal, "."))
    except ValueError:
        return np.nan


def is_float(text: str) -> bool:
    """Whether a text is a number as Python writes it."""
    try:
        float(text)
    except ValueError:
        return False
    return "_" not in text
