"""Columns of a table by name, before it is known what they mean."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from adhesion_can.arrays import Array

Column = Array | tuple[str, ...]
"""Numbers, NaN where a cell is empty; or texts where some cell is no number."""
NO_VALUE = frozenset({"", "-", "--", "na", "n/a", "#n/a", "none", "null"})
"""Cells without a value, in lower case; 'nan' is a number."""
_WITH_UNIT = re.compile(r"(?P<name>.*\S)\s*[\[(](?P<unit>[^\[\]()]*)[\])]")
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")


@dataclass(frozen=True)
class Columns:
    """Columns of a file.

    Attributes:
        values: Numbers or texts of each column, all of one length.
        units: Units of the columns that state one, in the heading or in a line of units.
        notes: What was recognised of the file, a sentence each.

    """

    values: Mapping[str, Column]
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def split_unit(heading: str) -> tuple[str, str]:
    """Name and unit of a heading such as 'Fx [kN]'; unit '' where it states none."""
    found = _WITH_UNIT.fullmatch(heading.strip())
    if found is None:
        return heading.strip(), ""
    return found["name"], found["unit"].strip()


def as_column(cells: Sequence[str], *, decimal_comma: bool = False) -> Column:
    """Numbers where all cells with a value are numbers, else texts.

    Args:
        cells: Cells of a column.
        decimal_comma: Whether a comma separates the decimals.

    """
    values = np.full(len(cells), np.nan)
    some = False
    for place, cell in enumerate(cells):
        text = cell.strip()
        if text.lower() in NO_VALUE:
            continue
        number = _number(text, decimal_comma=decimal_comma)
        if number is None:
            return tuple(one.strip() for one in cells)
        values[place], some = number, True
    empty = all(not cell.strip() for cell in cells)
    return values if some or empty else tuple(one.strip() for one in cells)


def is_number(cell: str, *, decimal_comma: bool = False) -> bool:
    """Whether a cell is a number."""
    return _number(cell.strip(), decimal_comma=decimal_comma) is not None


def has_decimal_comma(cell: str) -> bool:
    """Whether a cell is a number whose decimals are separated by a comma."""
    return _DECIMAL_COMMA.fullmatch(cell.strip()) is not None


def _number(text: str, *, decimal_comma: bool) -> float | None:
    if decimal_comma and _DECIMAL_COMMA.fullmatch(text):
        text = text.replace(",", ".")
    try:
        return float(text)
    except ValueError:
        return None
