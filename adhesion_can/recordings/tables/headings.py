"""Columns by what a user types: the heading, or its name without unit, case and spaces."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from adhesion_can.bus.units import find_factor
from adhesion_can.errors import TableError, suggest
from adhesion_can.recordings.tables.choice import COLUMN_UNITS, ColumnChoice
from adhesion_can.recordings.tables.columns import split_unit

MOST_LISTED = 12
"""Headings that an error lists where none is similar."""
_LOOSE_UNIT = re.compile(r"(?P<name>.*?\S)(?:\s+in\s+|\s*/\s*)(?P<unit>\S+)", re.IGNORECASE)


def name_columns(headings: Iterable[str]) -> list[tuple[str, str]]:
    """Name and unit of each heading; the whole heading is the name where units alone differ.

    Args:
        headings: Headings of a file.

    Returns:
        The pairs in the order of the file. Names are equal only where the headings are, or where
        the name is one that a table knows.

    """
    pairs = [(heading, *split_unit(heading)) for heading in headings]
    counts = Counter(name for _, name, _ in pairs)
    whole = Counter(heading.strip() for heading, _, _ in pairs)
    return [
        (heading.strip(), unit)
        if counts[name] > 1 and name not in COLUMN_UNITS and whole[heading.strip()] == 1
        else (name, unit)
        for heading, name, unit in pairs
    ]


def resolve_choices(
    choices: Iterable[ColumnChoice], names: Iterable[str], units: Mapping[str, str], where: str
) -> tuple[ColumnChoice, ...]:
    """Choices with the columns as the file names them.

    Args:
        choices: What the user states.
        names: Names of the columns of the file.
        units: Units of the columns that state one in the heading.
        where: Name of the file, for errors.

    Raises:
        TableError: No column has the name, or several have it.

    """
    listed = list(names)
    return tuple(_resolve(choice, listed, units, where) for choice in choices)


def find_column(typed: str, names: Sequence[str], units: Mapping[str, str], where: str) -> str:
    """Name of the column that a user means.

    Args:
        typed: Heading with or without its unit.
        names: Names of the columns of the file.
        units: Units of the columns that state one in the heading.
        where: Name of the file, for errors.

    Raises:
        TableError: No column has the name, or several have it.

    """
    return _find(typed, "", names, units, where)


def has_column(typed: str, names: Iterable[str], units: Mapping[str, str]) -> bool:
    """Whether a user's heading, with or without its unit, means one of these columns or several."""
    listed = list(names)
    return typed in listed or bool(_alike(typed, listed, units))


def loose_unit(name: str) -> tuple[str, str]:
    """Name and unit of a heading such as 'v in km/h' or 'v / km/h'; unit '' where it has none."""
    match = _LOOSE_UNIT.fullmatch(name.strip())
    if match is None or match["unit"].isdigit():
        return name, ""
    known = any(find_factor(units, match["unit"]) is not None for units in COLUMN_UNITS.values())
    return (match["name"], match["unit"]) if known else (name, "")


def _resolve(
    choice: ColumnChoice, names: Sequence[str], units: Mapping[str, str], where: str
) -> ColumnChoice:
    column = _find(choice.column, choice.name, names, units, where)
    known, unit = COLUMN_UNITS.get(choice.name, {}), loose_unit(column)[1]
    if choice.unit is None and column not in units and find_factor(known, unit or "?") is not None:
        return replace(choice, column=column, unit=unit)
    return replace(choice, column=column)


def _find(
    typed: str, known: str, names: Sequence[str], units: Mapping[str, str], where: str
) -> str:
    if typed in names:
        return typed
    same = _alike(typed, names, units)
    for_known = f" for {known!r}" if known else ""
    if len(same) > 1:
        headings = ", ".join(map(repr, same))
        raise TableError(
            where, f"{typed!r}{for_known} may be {headings}", "write one of these in full"
        )
    if not same:
        what = f"no column {typed!r}{for_known}"
        raise TableError(where, what, _nearest(typed, names, units))
    return same[0]


def _alike(typed: str, names: Sequence[str], units: Mapping[str, str]) -> list[str]:
    """Columns with the name, and with the unit where it is typed."""
    name, unit = _parts(typed, "")
    return [
        column
        for column in names
        if _parts(column, "")[0] == name and unit in ("", _parts(column, units.get(column, ""))[1])
    ]


def _nearest(typed: str, names: Sequence[str], units: Mapping[str, str]) -> str:
    """Headings that are written alike, else the first ones."""
    wanted = _parts(typed, "")[0]
    by_name = {_parts(name, "")[0]: name for name in names}
    alike = [name for plain, name in by_name.items() if len(wanted) > 1 and wanted in plain][:3]
    if not alike:
        similar = suggest(wanted, by_name).partition(": ")[2]
        alike = [by_name[plain] for plain in similar.split(", ") if plain in by_name]
    if alike:
        return f"similar names: {', '.join(_with_unit(name, units) for name in alike)}"
    shown = ", ".join(_with_unit(name, units) for name in names[:MOST_LISTED])
    more = len(names) - MOST_LISTED
    return f"its columns are {shown}{f', and {more} more' if more > 0 else ''}"


def _with_unit(name: str, units: Mapping[str, str]) -> str:
    unit = units.get(name, "")
    return f"{name} [{unit}]" if unit and not split_unit(name)[1] else name


def _parts(text: str, stated: str) -> tuple[str, str]:
    """Name and unit of a heading, without case, double spaces and the sign in front of a unit.

    Args:
        text: Heading, with or without its unit.
        stated: Unit that the file states for it elsewhere; '' where it does not.

    """
    name, unit = split_unit(text)
    loose, other = loose_unit(name)
    plain = re.sub(r"\s+", " ", (loose if other else name).casefold()).rstrip(" /,_")
    return plain or name, (unit or other or stated).casefold()
