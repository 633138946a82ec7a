"""The table of the findings of the fleet-level diagnosis: one file beside the others' folders.

Like them it says each column's type, unit and meaning.
"""

from adhesion_can.fleet.schema import SIZED_EFFECT
from adhesion_can.fleet.table_schema import Column, TableSchema

FINDINGS = TableSchema(
    "fleet_findings",
    "a finding of the fleet-level diagnosis",
    (
        Column("scope", "string", "`vehicle`, `line`, `day` or `fleet`", required=True),
        Column("place", "string",
            "name of the vehicle, line or day; for the fleet, the kind of vehicles, or empty if "
            "there is only one kind", required=True),
        *SIZED_EFFECT,
        Column("value", "double", "size to first order, in `unit`", required=True),
        Column("std", "double", "standard error of `value`, without the error of the first order, "
               "in `unit`", required=True),
        Column("pooled_value", "double", "mean of the units' nonlinear sizes, in `unit`; none if "
               "no unit has one"),
        Column("pooled_std", "double", "standard error of `pooled_value`, the spread between units "
               "included, in `unit`"),
        Column("fleet_value", "double", "centre of the sizes in the fleet, in `unit`",
               required=True),
        Column("p_value", "double", "p-value, corrected for all effects", "1", required=True),
        Column("gain_percent", "double",
            "reduction of the RMSE of the adhesion; none if the size comes from coasting and no "
            "other unit shows the gain", "%"),
        Column("held_out", "bool", "whether the gain comes from units that had no part in the size",
               required=True),
        Column("units", "int", "number of units with an estimate", "1", required=True),
        Column("showing", "int",
            "number of these units that show it on their own", "1", required=True),
        Column("source", "string", "`regression` or `coasting`", required=True),
        Column("rivals", "list<string>", "effects that the data cannot distinguish from it",
               required=True),
        Column("named_by", "int", "number of units whose own diagnosis names it", "1",
               required=True),
    ),
)  # fmt: skip
"""Findings of the whole fleet."""
