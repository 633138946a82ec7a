"""The tables that `fleet` writes, from `adhesion_can/fleet/schema.py` and `findings_schema.py`."""

from adhesion_can.fleet.schema import FINDINGS, SCHEMA_VERSION, TABLES, Column, TableSchema
from reference_pages.markdown import GENERATED, code, page, table

HEAD = ("column", "type", "unit", "meaning")
INTRODUCTION = f"""
Tables of the data set that `adhesion-can fleet` writes, version {SCHEMA_VERSION}: it is in the
metadata of each file as `adhesion_can.schema`. A column that says nothing else may be null. How to
open them: [A fleet](../fleet.md).
"""


def fleet_page() -> str:
    """Every table with its columns."""
    parts = ["# Data set of a fleet: every column", GENERATED, INTRODUCTION]
    for one in (*TABLES, FINDINGS):
        parts += [f"## `{one.name}`", f"A row is {one.row}.", table(HEAD, _rows(one))]
    return page(parts)


def _rows(one: TableSchema) -> list[list[str]]:
    return [
        [code(column.name), code(column.type), column.unit, _sentence(column)]
        for column in one.columns
    ]


def _sentence(column: Column) -> str:
    never = "; never null" if column.required else ""
    return f"{column.meaning[0].upper()}{column.meaning[1:]}{never}."
