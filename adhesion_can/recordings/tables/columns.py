"""Columns of a table by name, before it is known what they mean."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from adhesion_can.arrays import Array

Column = Array | tuple[str, ...]
"""Numbers, NaN where a cell is empty; or texts where some cell is no number."""
_WITH_UNIT = re.compile(r"(?P<name>.*\S)\s*[\[(](?P<unit>[^\[\]()]*)[\])]")


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
    match = _WITH_UNIT.fullmatch(heading.strip())
    if match is None:
        return heading.strip(), ""
    return match["name"], match["unit"].strip()
