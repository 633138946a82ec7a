"""A table of the data set: columns with their types, units and meanings."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

SCHEMA_VERSION = 2
"""Version of the tables: another one where a column gets another name, type, unit or meaning."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table.

    Attributes:
        name: Name of the column.
        type: Name of its type, a key of `_types`.
        meaning: Meaning of its values, a noun phrase.
        unit: SI unit, '1' for a ratio or a count; '' where it has none.
        required: Whether no row is without a value.

    """

    name: str
    type: str
    meaning: str
    unit: str = ""
    required: bool = False


@dataclass(frozen=True, slots=True)
class TableSchema:
    """A table of the data set.

    Attributes:
        name: Name of the table and of its folder.
        row: Meaning of a row, a noun phrase.
        columns: Columns in their order.

    """

    name: str
    row: str
    columns: tuple[Column, ...]

    def arrow(self) -> Any:
        """Schema for pyarrow, with version, units and meanings as metadata."""
        import pyarrow as pa  # noqa: PLC0415  a page about the schema needs no extra

        types = _types()
        fields = [
            pa.field(
                column.name,
                types[column.type],
                nullable=not column.required,
                metadata={"unit": column.unit, "comment": column.meaning},
            )
            for column in self.columns
        ]
        version = {"adhesion_can.schema": str(SCHEMA_VERSION), "adhesion_can.table": self.name}
        return pa.schema(fields, metadata=version)


def _types() -> Mapping[str, Any]:
    """Types of pyarrow by their names here."""
    import pyarrow as pa  # noqa: PLC0415  a page about the schema needs no extra

    return {
        "string": pa.string(),
        "date": pa.date32(),
        "timestamp": pa.timestamp("us", tz="UTC"),
        "double": pa.float64(),
        "int": pa.int64(),
        "bool": pa.bool_(),
        "list<double>": pa.list_(pa.float64()),
        "list<string>": pa.list_(pa.string()),
    }
