"""The configuration file: keys with defaults, units and meanings, from the classes of settings."""

import re
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields
from typing import Any

from adhesion_can.bus.role_specs import ROLE_SPECS, known_units
from adhesion_can.config.configuration import Configuration
from adhesion_can.config.roles_section import _RoleTable
from adhesion_can.config.table_section import _ColumnTable
from adhesion_can.config.toml_tables import nested_sections, section_keys
from adhesion_can.config.vehicle_section import AXLES, GEOMETRY, PER_AXLE, WHOLE_VEHICLE
from adhesion_can.physics.vehicle import Geometry, Locomotive
from adhesion_can.ranges import range_of, ranges_of
from reference_pages.markdown import GENERATED, code, page, table

HEAD = ("key", "default", "range", "unit", "meaning")

UNITS_IN_TEXT = (
    "1", "%", "N", "in the unit of the role", "kg", "kg·m²", "m", "m/s", "m/s²", "ms", "rad/s",
    "s", "samples", "µs",
)  # fmt: skip
"""Units with which the first sentence of a docstring's line may end, behind a comma."""
PURE_NUMBER = re.compile(r"\b([Ss]hare|Relative|[Pp]robability|Number|[Ff]actor|cycles)\b")
"""Words that say that a number has no unit."""

INTRODUCTION = """
Every section and key may be left out; an unknown one is an error that names it. What roles and
channels mean, and the model file: [Configuration](../configuration.md). At the top, before any
section, `estimator = "tracker"` chooses the estimator. Unit 1 is a ratio or another number without
a unit; counts, names and yes or no have none. Both ends of a range are in it; a list of fixed
length has one range for all its numbers, or one for each. A value beyond its range is an error that
names key, value and range.
"""
VEHICLE = """
`wheel_radius_m` and `axle_load_N` are a number, or a list with one for each axle.
"""
GEOMETRY_OF_OTHERS = """
The defaults hold for six axles in two bogies. Another vehicle has no transfer of load unless the
section states what its bogies need; what is missing is reported.
"""
CHANNELS = """
Further signals that may be a cause: `NAME = "Message.Signal"`, or a table with the keys of a role,
and `unit` and `label`, texts for reports: [Channels](../configuration.md#channels).
"""
COLUMNS = """
Meaning of each column of a table: `NAME = "heading"`, or a table with these keys:
[Your own measurements](../own_data.md).
"""
DATABASE = (
    "database",
    "the packaged `dbc/adhesion.dbc`",
    "Path of the database, beside the configuration file; `--dbc` takes its place.",
)


def configuration_page() -> str:
    """Every section of the configuration file."""
    default_axles, most = code(str(Locomotive().axles)), str(range_of(AXLES))
    axles = [code("axles"), default_axles, most, "", "Number of driven axles."]
    of_vehicle = setting_rows(Locomotive, {**PER_AXLE, **WHOLE_VEHICLE})
    key, default, meaning = DATABASE
    parts = [
        "# Configuration file: every key",
        GENERATED,
        INTRODUCTION,
        "## `[vehicle]`",
        f"{about(Locomotive)} {VEHICLE.strip()}",
        table(HEAD, [axles, *of_vehicle]),
        "## `[vehicle.geometry]`",
        f"{about(Geometry)} {GEOMETRY_OF_OTHERS.strip()}",
        table(HEAD, setting_rows(Geometry, GEOMETRY)),
        "## `[bus]`",
        table(HEAD, [[code(key), default, "", "", meaning]]),
        "## `[roles]`",
        '`ROLE = "Message.Signal"`, or a table with these keys:',
        table(HEAD, setting_rows(_RoleTable)),
        table(["role", "units understood"], role_rows()),
        "## `[channels]`",
        CHANNELS,
        "## `[table]`",
        COLUMNS,
        table(HEAD, setting_rows(_ColumnTable)),
    ]
    for name, kind in nested_sections(Configuration):
        parts += [f"## `[{name}]`", about(kind), table(HEAD, setting_rows(kind))]
    return page(parts)


def about(kind: type) -> str:
    """First sentence of a class, and its file."""
    first = (kind.__doc__ or "").strip().splitlines()[0]
    file = kind.__module__.removeprefix("adhesion_can.").replace(".", "/")
    return f"{first} (`{file}.py: {kind.__name__}`)"


def setting_rows(kind: type, keys: Mapping[str, str] | None = None) -> list[list[str]]:
    """Key, default, range, unit and meaning of every key of a section.

    Args:
        kind: Class of the settings.
        keys: Field by key of the file, where they differ.

    """
    texts, by_name = attribute_texts(kind), {field.name: field for field in fields(kind)}
    rows = []
    for key, name in (keys or {key: key for key in section_keys(kind)}).items():
        field, text = by_name[name], texts.get(name)
        if text is None:
            raise SystemExit(f"{kind.__module__}.{kind.__name__}: no line for {name}")
        unit = unit_of(text) if holds_numbers(field) else ""
        if unit is None:
            raise SystemExit(f"{kind.__module__}.{kind.__name__}.{name}: say its unit, or 1")
        reach = str(ranges_of(kind).get(name, ""))
        if not reach and is_number(field):
            raise SystemExit(f"{kind.__module__}.{kind.__name__}.{name}: state its range")
        rows.append([code(key), code(as_toml(default_of(field))), reach, unit, text])
    return rows


def attribute_texts(kind: type) -> dict[str, str]:
    """Text of every line under 'Attributes' of a class, by name."""
    _, _, rest = (kind.__doc__ or "").partition("Attributes:\n")
    texts: dict[str, str] = {}
    name = ""
    for line in rest.splitlines():
        start = re.match(r" {8}(\w+): (.*)", line)
        if start:
            name = start[1]
            texts[name] = start[2].strip()
        elif line.startswith(" " * 12):
            texts[name] += " " + line.strip()
        elif line.strip():
            break
    return texts


def unit_of(text: str) -> str | None:
    """Unit that a docstring's line states, '1' for a pure number; None where it says neither."""
    first = re.split(r"(?<!eq)[.;:](?= |$)", text)[0]
    for part in reversed(first.split(", ")):
        if part.strip() in UNITS_IN_TEXT:
            return part.strip().removeprefix("in the unit of ")
    return "1" if PURE_NUMBER.search(first) else None


def holds_numbers(field: Field[Any]) -> bool:
    """Whether a field holds numbers that may have a unit."""
    return "float" in str(field.type) or "CurveParameters" in str(field.type)


def is_number(field: Field[Any]) -> bool:
    """Whether a field holds numbers, which have a range."""
    return holds_numbers(field) or "int" in str(field.type)


def default_of(field: Field[Any]) -> object:
    """Default value of a field; None where it has none or it is None."""
    if field.default is not MISSING:
        return field.default
    return None if field.default_factory is MISSING else field.default_factory()


def as_toml(value: object) -> str:
    """A default as one writes it into the file; '' for None."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        if len(value) > 3 and len(set(value)) == 1:
            return as_toml(value[0])  # the same for every axle
        return f"[{', '.join(map(as_toml, value))}]"
    if isinstance(value, float):
        return f"{value:.10g}"
    return f'"{value}"' if isinstance(value, str) else str(value)


def role_rows() -> list[list[str]]:
    """Roles with the units that they take."""
    rows = []
    for role, spec in ROLE_SPECS.items():
        name = f"{role}.AXLE" if role.per_axle else str(role)
        units = "a number" if "" in spec.units else known_units(role)
        rows.append([code(name), units])
    return rows
