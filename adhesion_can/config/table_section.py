"""Section `[table]` of the configuration file: the columns of a table by their meaning."""

from dataclasses import dataclass
from typing import Annotated

from adhesion_can.config.toml_tables import section, table_of
from adhesion_can.errors import ConfigError
from adhesion_can.ranges import Within
from adhesion_can.recordings.tables.choice import ColumnChoice

PLAUSIBLE = "plausible"
"""Value of `assume` with which data that look wrong are used."""


@dataclass(frozen=True, slots=True)
class _ColumnTable:
    """Table of one column in the file.

    Attributes:
        column: Heading of the column, without its unit.
        unit: Unit of its values; '?' for the unit that the file states, or else the known one.
        sign: 1, or -1 where the column counts the other way.
        late_s: Time by which the column is late, s; negative where it is early.

    """

    column: str
    unit: str = "?"
    sign: Annotated[int, Within(-1, 1)] = 1
    late_s: Annotated[float, Within(-3600, 3600)] = 0.0


def load_table_section(value: object, where: str) -> tuple[tuple[ColumnChoice, ...], bool]:
    """Columns from the section `[table]`, and whether data that look wrong are used.

    Args:
        value: TOML table: a known name and the heading that means it, or a table of heading,
            unit, sign and delay; and `assume = "plausible"`.
        where: File, for errors.

    Raises:
        ConfigError: A value is wrong.

    """
    choices = []
    stated_columns = dict(table_of(value, f"{where}: table"))
    assumed = stated_columns.pop("assume", None)
    if assumed not in (None, PLAUSIBLE):
        raise ConfigError(f"{where}: table.assume", f"{assumed!r}", f'write "{PLAUSIBLE}"')
    for name, stated in stated_columns.items():
        place = f"{where}: table.{name}"
        inner = {"column": stated} if isinstance(stated, str) else table_of(stated, place)
        if "column" not in inner:
            raise ConfigError(place, "names no column", 'write column = "its heading"')
        row: _ColumnTable = section(_ColumnTable, inner, place)
        try:
            unit = None if row.unit == "?" else row.unit
            choices.append(ColumnChoice(name, row.column, unit, row.sign, row.late_s))
        except ValueError as error:
            raise ConfigError(place, str(error), "correct the value") from error
    return tuple(choices), assumed is not None
