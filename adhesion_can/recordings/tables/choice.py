"""Meaning of each column of a table: names, units, signs and delays that a user states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from adhesion_can.bus.role_specs import ROLE_SPECS
from adhesion_can.bus.units import find_factor
from adhesion_can.errors import InputError, TableError
from adhesion_can.physics.channels import CHANNELS
from adhesion_can.physics.readings import Role
from adhesion_can.recordings.tables.columns import Column, Columns

_RATIO = {"": 1.0, "-": 1.0, "1": 1.0, "%": 0.01, "percent": 0.01, "permille": 1e-3, "‰": 1e-3}
_TIME = {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0,
         "h": 3600.0}  # fmt: skip
_NUMBER = {"": 1.0, "-": 1.0, "1": 1.0}
COLUMN_UNITS: Mapping[str, Mapping[str, float]] = {
    **{c.column: ROLE_SPECS[c.role].units for c in CHANNELS if c.column and c.role is not None},
    "time_s": _TIME,
    "slip": _RATIO,
    "adhesion": _RATIO,
    "longitudinal_force_N": ROLE_SPECS[Role.TRACTIVE_EFFORT].units,
    "axle": _NUMBER,
    "segment": _NUMBER,
}
"""Factor to the unit of a known column, of every unit that it may have in a file."""


@dataclass(frozen=True, slots=True)
class ColumnChoice:
    """A column of a table that means a known one.

    Attributes:
        name: Known name, such as 'slip'; or any name for your own channel.
        column: Heading of the column in the file, without its unit.
        unit: Unit of the values in the file; None: as the file states it, else that of `name`.
        sign: 1, or −1 where the column counts the other way.
        late_s: Time by which the column is late, s; negative where it is early.

    """

    name: str
    column: str
    unit: str | None = None
    sign: int = 1
    late_s: float = 0.0

    def __post_init__(self) -> None:
        if self.sign not in (-1, 1):
            raise ValueError(f"sign {self.sign}: write 1 or -1")
        if not isfinite(self.late_s):
            raise ValueError(f"late_s {self.late_s}: write a number of seconds")
        units = COLUMN_UNITS.get(self.name)
        if self.unit is not None and (units is None or find_factor(units, self.unit) is None):
            known = "none is known" if units is None else f"known: {_listed(units)}"
            raise ValueError(f"unit {self.unit!r} of {self.name}: {known}")


def parse_choice(text: str) -> ColumnChoice:
    """Choice from an option: `slip=kappa,unit=percent,sign=-1`.

    Raises:
        InputError: The text is no such choice.

    """
    where, fix = f"--column {text}", "write NAME=COLUMN[,unit=UNIT][,sign=-1][,late_s=SECONDS]"
    first, *others = text.split(",")
    name, equals, column = (part.strip() for part in first.partition("="))
    if not (equals and name and column):
        raise InputError(where, "not NAME=COLUMN", fix)
    given: dict[str, str] = {}
    for other in others:
        key, _, value = (part.strip() for part in other.partition("="))
        if key not in {"unit", "sign", "late_s"}:
            raise InputError(where, f"unknown key {key!r}", fix)
        given[key] = value
    if given.get("sign", "1") not in {"1", "+1", "-1"}:
        raise InputError(where, f"sign {given['sign']!r}", "write sign=1 or sign=-1")
    try:
        late_s = float(given.get("late_s", "0"))
    except ValueError:
        raise InputError(where, f"late_s {given['late_s']!r} is not a number", fix) from None
    try:
        sign = int(given.get("sign", "1"))
        return ColumnChoice(name, column, given.get("unit"), sign, late_s)
    except ValueError as error:
        raise InputError(where, str(error), fix) from error


def apply_choices(columns: Columns, choices: Sequence[ColumnChoice], where: str) -> Columns:
    """Columns under their known names, in SI units.

    A column that states its own unit, in its heading or in a line of units, is converted as well.

    Args:
        columns: Columns as the file has them.
        choices: What the user states.
        where: Name of the file, for errors.

    Raises:
        TableError: A chosen column is not there, is not numeric, or has a unit that is not known.

    """
    values, notes = dict(columns.values), list(columns.notes)
    stated = [choice for choice in choices if choice.column in values]
    _require_columns(columns, choices, where)
    taken: dict[str, Column] = {}
    for choice in stated:
        taken[choice.name] = values[choice.column]
    for choice in stated:
        values.pop(choice.column, None)
    values |= taken
    by_name = {choice.name: choice for choice in stated}
    for name in list(values):
        choice = by_name.get(name, ColumnChoice(name, name))
        values[name], note = _converted(values[name], choice, columns.units, where)
        notes += [note] if note else []
    return replace(columns, values=values, notes=tuple(notes))


def _require_columns(columns: Columns, choices: Sequence[ColumnChoice], where: str) -> None:
    for choice in choices:
        if choice.column not in columns.values:
            known = ", ".join(columns.values)
            what = f"no column {choice.column!r} for {choice.name!r}"
            raise TableError(where, what, f"there are: {known}")


def _converted(
    column: Column, choice: ColumnChoice, units: Mapping[str, str], where: str
) -> tuple[Column, str]:
    """A column in the unit of its known name, and a sentence where that changes the numbers."""
    known = COLUMN_UNITS.get(choice.name)
    stated = units.get(choice.column, "")
    unit = choice.unit if choice.unit is not None else stated
    factor = 1.0
    if known is not None and unit:
        unit_factor = find_factor(known, unit)
        if unit_factor is None:
            what = f"unit {unit!r} of column {choice.column!r} is not known"
            fix = f"--column {choice.name}='{choice.column}',unit=.. with one of {_listed(known)}"
            raise TableError(where, what, fix)
        factor = unit_factor
    factor *= choice.sign
    if factor == 1.0:
        return column, ""
    if isinstance(column, tuple):
        raise TableError(where, f"column {choice.column!r} is not numeric", "write numbers in it")
    sign = " with the sign changed" if choice.sign < 0 else ""
    note = f"{choice.name} from {choice.column!r} in {unit or 'SI'}{sign}"
    return factor * np.asarray(column), note


def _listed(units: Mapping[str, float]) -> str:
    return ", ".join(unit or "''" for unit in units)
