"""Evidence of all units from the tables of a data set."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from adhesion_can.fleet.dataset import FAILED, DataSet
from adhesion_can.fleet.effect_records import grams_from_rows
from adhesion_can.fleet.evidence import AxleDeviation, CauseSize, UnitEvidence, VehicleForm
from adhesion_can.fleet.rows import Row
from adhesion_can.fleet.schema import CAUSES, EFFECTS, UNITS
from adhesion_can.physics.effects.instrument_errors import WHEEL_RADIUS
from adhesion_can.plurals import counted

AXLE = "axle"
"""Name of the parameter that is the number of an axle."""
_OF_UNITS = (
    "unit_id",
    "vehicle",
    "path",
    "day",
    "line",
    "frames",
    "axles",
    "vehicle_data",
    "status",
    "error",
    "usable",
    "first_failure",
    "causes",
    "wheel_radii_m",
    "wheel_radii_std_m",
    "wheel_radii_configured_m",
    "wheel_radii_applied",
)
_OF_CAUSES = (
    "unit_id",
    "effect",
    "form",
    "axle",
    "named",
    "parameters",
    "values",
    "stds",
    "parameter_units",
)


def read_evidence(data: DataSet) -> list[UnitEvidence]:
    """Evidence of all units of a data set, in the order of their ids.

    Raises:
        InputError: The data set cannot be read.

    """
    # Not their rows, which are four times as large: there may be many units.
    units = {
        row["unit_id"]: unit_evidence(row)
        for rows in data.read_rows(UNITS, _OF_UNITS)
        for row in rows
    }
    for rows in data.read_rows(CAUSES, _OF_CAUSES):
        sizes = tuple(cause_size(row) for row in rows if row["named"] and row["parameters"])
        # A unit counts from its row in `units` on: that one is written last.
        if sizes and rows[0]["unit_id"] in units:
            name = rows[0]["unit_id"]
            units[name] = replace(units[name], cause_sizes=sizes)
    effects: dict[str, list[Row]] = defaultdict(list)
    for rows in data.read_rows(EFFECTS):
        for row in rows:
            if row["unit_id"] in units:
                effects[row["unit_id"]].append(row)
        done = [
            name
            for name, unit_rows in effects.items()
            if len(unit_rows) == len(unit_rows[0]["gram"])
        ]
        for name in done:
            units[name] = replace(units[name], grams=grams_from_rows(effects.pop(name)))
    for name, incomplete in effects.items():
        units[name] = replace(units[name], error=_describe_incomplete(incomplete, data.out))
    return [units[name] for name in sorted(units)]


def unit_evidence(row: Mapping[str, Any]) -> UnitEvidence:
    """Evidence of a unit from its row of `units`, without the Gram matrices of its effects."""
    failed = row["status"] == FAILED
    unusable = row["usable"] is False and row["first_failure"]
    causes = tuple(row["causes"] or ())
    if row["wheel_radii_applied"] and WHEEL_RADIUS not in causes:
        causes = (WHEEL_RADIUS, *causes)  # as certain as a cause, and no longer in the residual
    return UnitEvidence(
        unit=row["unit_id"],
        vehicle=row["vehicle"],
        form=_form(row),
        line=row["line"] or "",
        day="" if row["day"] is None else row["day"].isoformat(),
        radii=tuple(_radii(row)),
        radii_applied=bool(row["wheel_radii_applied"]),
        causes=causes,
        path=row["path"],
        faults=(row["first_failure"],) if unusable else (),
        error=(row["error"] or "failed") if failed else "",
    )


def cause_size(row: Mapping[str, Any]) -> CauseSize:
    """Size of a named cause from its row of `causes`: its first parameter that is no axle."""
    names = row["parameters"]
    place = next((i for i, name in enumerate(names) if name != AXLE), 0)
    return CauseSize(
        row["effect"],
        row["form"] or "",
        row["axle"] or 0,
        names[place],
        row["parameter_units"][place],
        row["values"][place],
        row["stds"][place],
    )


def _describe_incomplete(rows: Sequence[Row], out: str) -> str:
    """Error of a unit whose rows of effects are not those that its matrix needs."""
    name, wanted = rows[0]["unit_id"], len(rows[0]["gram"])
    what = f"{out}: effects of {name}: {counted(len(rows), 'row')} instead of {wanted}"
    return f"{what}; remove its file below units/ and run the same command again"


def _form(row: Mapping[str, Any]) -> VehicleForm:
    if row["axles"] is None:
        return VehicleForm()  # it could not be read
    data = "TABLEs" if row["frames"] is None else "recordings"
    return VehicleForm(data, row["axles"], row["vehicle_data"] or "")


def _radii(row: Mapping[str, Any]) -> Iterable[AxleDeviation]:
    columns = (row[f"wheel_radii_{name}"] or () for name in ("m", "std_m", "configured_m"))
    for axle, (radius, std, configured) in enumerate(zip(*columns, strict=True), start=1):
        if radius is not None and std is not None:
            yield AxleDeviation(axle, radius / configured - 1.0, std / configured)
