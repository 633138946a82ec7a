"""Tables of the data set: each column with its type, unit and meaning.

The one place that says what a data set consists of: files are written by it, and the page
docs/reference/fleet.md is made of it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from adhesion_can.physics.doubt import DESCRIPTIONS, Doubt
from adhesion_can.physics.status import Status

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


RESULT_VERSION = 3
"""Version of what is written into them: another one where the same recording gives other rows."""
STEPS = ("check", "calibrate", "replay", "identify", "diagnose")
"""Steps of the work on a unit, in their order."""

PLACE = (
    Column("unit_id", "string", "identity of the unit, from its path", required=True),
    Column("vehicle", "string", "name of the vehicle; also the name of a folder", required=True),
    Column(
        "day",
        "date",
        "day of the first frame, UTC; also the name of a folder; none without a clock",
    ),
)
"""Columns that start every table, and by which a row finds its unit."""
POSITION = (
    Column("latitude_deg", "double", "latitude, WGS 84; none if unknown", "deg"),
    Column("longitude_deg", "double", "longitude, WGS 84; none if unknown", "deg"),
)
"""Position of a row."""
SIZED_EFFECT = (
    Column("effect", "string", "id of the effect", required=True),
    Column("form", "string", "form of the mechanism; empty if there is only one", required=True),
    Column("axle", "int", "axle of an effect at one axle; 0 for other effects", required=True),
    Column("parameter", "string", "name of its first parameter, the size", required=True),
    Column("unit", "string", "unit of the size", required=True),
)
"""Effect that a row has a size of: what distinguishes it from the other effects of a unit or
fleet."""


def status_column(status: Status) -> str:
    """Column with the share of the setpoints with a status."""
    return f"share_{status.name.lower()}"


def doubt_column(doubt: Doubt) -> str:
    """Column with the share of the setpoints with a doubt."""
    return f"doubt_{doubt.name.lower()}"


def seconds_column(step: str) -> str:
    """Column with the time that a step took."""
    return f"{step}_seconds"


_FOUND = (
    Column("path", "string", "absolute path or URL", required=True),
    Column("line", "string", "name of the railway line, from the manifest"),
    *POSITION,
    Column("started_at", "timestamp", "stamp of the first frame; none without a clock"),
    Column("duration_s", "double", "time from the first to the last frame or row", "s"),
    Column("frames", "int", "number of frames; none for a TABLE", "1"),
    Column("axles", "int", "number of axles with a wheel speed; for a TABLE, of its rows", "1"),
    Column("samples", "int", "number of samples of slip and adhesion", "1"),
)
_STATE = (
    Column("status", "string", "`done`, or `failed` if a step failed", required=True),
    Column("failed_step", "string", "first step that failed: one of the steps, or `read`"),
    Column("error", "string", "what is wrong and how to correct it"),
)
_CHECK = (
    Column("usable", "bool", "whether the check has no failure"),
    Column("failures", "int", "number of failures of the check", "1"),
    Column("warnings", "int", "number of warnings of the check", "1"),
    Column("first_failure", "string", "first failure of the check"),
    Column("frames_rejected", "int", "number of frames that failed their checks", "1"),
    Column("frames_lost", "int", "number of frames lost by their counters", "1"),
)
_CALIBRATE = (
    Column("wheel_radii_m", "list<double>", "radius of each axle; none if it does not coast",
           "m"),
    Column("wheel_radii_std_m", "list<double>", "standard error of each radius", "m"),
    Column("wheel_radii_configured_m", "list<double>", "configured radius of each axle", "m"),
    Column("coasting_s", "list<double>", "coasting time of each axle", "s"),
    Column("wheel_radii_applied", "bool", "whether later steps use calibrated radii"),
    Column("wheel_radii_used_m", "list<double>", "radius of each axle in these steps", "m"),
    Column("wheel_radii_note", "string", "why different radii were not applied"),
    Column("speed_offset_mps", "double", "offset of the vehicle speed", "m/s"),
)  # fmt: skip
_REPLAY = (
    Column("setpoints", "int", "number of setpoints of the replay", "1"),
    Column("tracking_s", "double", "time with status TRACKING", "s"),
    *(
        Column(status_column(status), "double", f"share of the setpoints with {status.name}", "1")
        for status in Status
    ),
    *(
        Column(doubt_column(doubt), "double", f"share of the setpoints with the doubt: {why}", "1")
        for doubt, why in DESCRIPTIONS.items()
    ),
    Column("mu_max", "double", "median of mu_max in TRACKING", "1"),
    Column("mu_max_std", "double", "median of its standard deviation in TRACKING", "1"),
    Column("lambda_m", "double", "median of lambda_m in TRACKING", "1"),
    Column("lambda_m_std", "double", "median of its standard deviation in TRACKING", "1"),
)
_DIAGNOSE = (
    Column("verdict", "string", "`named`, `nothing_found` or `unexplained`"),
    Column("conclusive", "bool", "whether the verdict is conclusive"),
    Column("causes", "list<string>", "named effects, the strongest first"),
    Column("channel", "string", "channel that an unexplained residual depends on"),
    Column("rmse_before", "double", "RMSE of the held-out adhesion of the plain curve", "1"),
    Column("rmse_after", "double", "RMSE of the held-out adhesion of the extended model", "1"),
    Column("noise_floor", "double", "noise floor of the RMSE", "1"),
    Column("gain_percent", "double", "gain of the extended model on held-out data", "%"),
    Column("gain_low_percent", "double", "lower end of its 95 % interval", "%"),
    Column("gain_high_percent", "double", "upper end of its 95 % interval", "%"),
)
_ORIGIN = (
    Column("steps", "list<string>", "requested steps", required=True),
    *(
        Column(seconds_column(step), "double", f"duration of `{step}`; none without it", "s")
        for step in ("read", *STEPS)
    ),
    Column("bytes", "int", "size of the file", "1"),
    Column("sha256", "string", "hash of its content, hexadecimal"),
    Column("fingerprint", "string",
        "size and time of change, or ETag, for a quick check for changes",
           required=True),
    Column("settings", "string", "hash of configuration, database, model, steps and version",
           required=True),
    Column("vehicle_data", "string",
        "hash of the vehicle's data and the model without wheel radii; units of another kind "
        "have another hash"),
    Column("key", "string", "hash of content and settings; none for a file that cannot be read"),
    Column("package_version", "string", "version of adhesion-can", required=True),
)  # fmt: skip
UNITS = TableSchema(
    "units",
    "a recording or TABLE",
    (*PLACE, *_FOUND, *_STATE, *_CHECK, *_CALIBRATE, *_REPLAY, *_DIAGNOSE, *_ORIGIN),
)
"""Units; the file of a unit here is written last, and says that the unit is complete."""

SEGMENTS = TableSchema(
    "segments",
    "a span of a recording on one surface, from `identify`",
    (
        *PLACE,
        Column("segment", "int", "number of the surface in its unit, from 1", required=True),
        Column("from_s", "double", "start on the recording's clock", "s", required=True),
        Column("to_s", "double", "end on the recording's clock", "s", required=True),
        *POSITION,
        Column("samples", "int", "number of samples behind the curve", "1", required=True),
        Column("mu_max", "double", "largest adhesion coefficient", "1"),
        Column("mu_max_std", "double", "its standard deviation; none if not identifiable", "1"),
        Column("lambda_m", "double", "slip ratio of the largest adhesion", "1"),
        Column("lambda_m_std", "double", "its standard deviation; none if not identifiable",
               "1"),
        Column("c1", "double", "level of the Burckhardt curve", "1"),
        Column("c2", "double", "steepness of the Burckhardt curve", "1"),
        Column("c3", "double", "fall of the Burckhardt curve", "1"),
        Column("noise_std", "double", "standard deviation of the adhesion around the curve", "1"),
        Column("directions_agree", "bool", "whether one curve fits traction and braking"),
    ),
)  # fmt: skip
"""Segments of constant surface."""

CAUSES = TableSchema(
    "causes",
    "an effect that `diagnose` tested",
    (
        *PLACE,
        Column("effect", "string", "id of the effect", required=True),
        Column("form", "string", "form of the mechanism; empty if there is only one"),
        Column("axle", "int", "axle of an effect at one axle; 0 for other effects"),
        Column("named", "bool", "whether it is named as a cause", required=True),
        Column("rank", "int", "rank among the causes, from 1; none if not named", "1"),
        Column("statistic", "double", "statistic of the sign-flip test", "1"),
        Column("p_value", "double", "p-value, corrected for all effects", "1"),
        Column("absorbed", "double", "share of its signature that the curve can imitate", "1"),
        Column("most_alike", "string", "effect with the most similar signature"),
        Column("cosine", "double", "cosine between both signatures", "1"),
        Column("gain_percent", "double", "gain of the effect alone on the deciding data", "%"),
        Column("parameters", "list<string>", "names of the parameters of a named effect"),
        Column("values", "list<double>", "their estimates in `parameter_units`"),
        Column("stds", "list<double>", "their standard deviations in `parameter_units`"),
        Column("parameter_units", "list<string>", "units of the parameters"),
        Column(
            "rivals", "list<string>", "effects that the data cannot distinguish from a named one"
        ),
    ),
)
"""Evidence for each effect, and those that are named."""

EFFECTS = TableSchema(
    "effects",
    "a candidate effect's part in the regression over many units, the unit's curves projected out",
    (
        *PLACE,
        Column("place", "int", "place of the effect in the unit's matrices, from 0", required=True),
        *SIZED_EFFECT,
        Column("typical", "double", "typical size in `unit`", required=True),
        Column("value", "double",
            "size if only this effect is added to the curves, to first order, in `unit`; none if "
            "the curves imitate all of it"),
        Column("std", "double", "its standard error from the spread over blocks, in `unit`"),
        Column("fitted_value", "double",
            "its size from the nonlinear fit, in `unit`, or `value` if that is below two standard "
            "errors; none if the fit ends at the end of its range"),
        Column("fitted_std", "double", "standard error of `fitted_value`, in `unit`"),
        Column("absorbed", "double", "share of its signature that the curves can imitate", "1",
               required=True),
        Column("gram", "list<double>", "products of its whitened signature with those of all "
               "effects of the unit, by `place`", required=True),
        Column("score", "double", "product of its whitened signature with the residual",
               required=True),
        Column("score_variance", "double", "variance of `score` from the spread over blocks",
               required=True),
        Column("square", "double", "whitened sum of squares of the residual", "1", required=True),
        Column("rows", "double", "number of rows", "1", required=True),
        Column("blocks", "int", "number of blocks of time", "1", required=True),
        Column("rmse", "double", "RMSE of the adhesion around the curves", "1", required=True),
    ),
)  # fmt: skip
"""Gram matrices for the diagnosis of the whole fleet."""

TABLES: tuple[TableSchema, ...] = (UNITS, SEGMENTS, CAUSES, EFFECTS)
"""All tables; `units` is written last."""

OF_STEP: Mapping[str, tuple[TableSchema, ...]] = {
    "identify": (SEGMENTS,),
    "diagnose": (CAUSES, EFFECTS),
}
"""Tables that a step fills, beside its columns in `units`."""


def tables_of(steps: Iterable[str]) -> tuple[TableSchema, ...]:
    """Tables that some steps fill, without `units`."""
    return tuple(table for step in steps for table in OF_STEP.get(step, ()))


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
