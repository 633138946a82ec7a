"""The configuration file: vehicle, database, roles, sensors and settings, in TOML.

Every key is known or an error. The file's values are in the units that its keys name.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from adhesion_can.bus.database import load_database
from adhesion_can.bus.roles import (
    OPTIONAL_MESSAGES,
    PROTECTIONS,
    SignalChoice,
    contract_choices,
)
from adhesion_can.config.configuration import Configuration, ServiceSettings
from adhesion_can.config.toml_tables import no_more, section, table_of, typed
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.baselines.paper import ChangeSettings
from adhesion_can.estimation.differential_evolution import EvolutionSettings
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.registry import DEFAULT
from adhesion_can.estimation.tracker.axle_deviations import AxleSettings
from adhesion_can.estimation.tracker.memories import MemorySettings
from adhesion_can.estimation.tracker.prior import PriorSettings
from adhesion_can.estimation.tracker.run_length import RunLengthSettings
from adhesion_can.estimation.tracker.tracker import TrackerSettings
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import Geometry, Locomotive
from adhesion_can.sampling.equations import SamplingSettings, Sensors


def load_configuration(path: Path | None = None, dbc: Path | None = None) -> Configuration:
    """Configuration from a TOML file; None: the defaults on our own database.

    Args:
        path: of the TOML file.
        dbc: database that takes the place of the one it names.

    Raises:
        ConfigError: the file cannot be read, or says what nobody understands.
        DatabaseError: its database is missing, broken or lacks a signal.

    """
    if path is None:
        return _complete(Configuration(Locomotive(), load_database(dbc), ()))
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ConfigError(
            str(path), error.strerror or "cannot be read", "check the path"
        ) from error
    try:
        document = tomllib.loads(content.decode("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(
            str(path), f"not TOML ({error})", "mend the line that it names"
        ) from error
    where = path.name
    document = dict(document)
    bus = table_of(document.pop("bus", {}), f"{where}: bus")
    named = bus.pop("database", None)
    no_more(bus, f"{where}: bus", ("database",))
    if named is not None and not isinstance(named, str):
        raise ConfigError(f"{where}: bus.database", "not a path", 'write database = "my.dbc"')
    database = load_database(dbc or (path.parent / named if named else None))
    vehicle = _vehicle(document.pop("vehicle", {}), where)
    roles = document.pop("roles", None)
    choices = () if roles is None else tuple(_roles(table_of(roles, f"{where}: roles"), where))
    estimator = document.pop("estimator", DEFAULT)
    if not isinstance(estimator, str):
        raise ConfigError(f"{where}: estimator", "not a name", 'write estimator = "tracker"')
    sections: dict[str, Any] = {
        name: section(kind, document.pop(name, {}), f"{where}: {name}")
        for name, kind in _SECTIONS.items()
    }
    known = ("bus", "vehicle", "roles", "estimator", *_SECTIONS)
    no_more(document, where, known)
    return _complete(
        Configuration(
            vehicle,
            database,
            choices,
            **sections,
            estimator=estimator,
            where=where,
            sha256=sha256(content).hexdigest(),
        )
    )


_SECTIONS: Mapping[str, type] = {
    "service": ServiceSettings,
    "sampling": SamplingSettings,
    "sensors": Sensors,
    "identifiability": IdentifiabilitySettings,
    "tracker": TrackerSettings,
    "run_length": RunLengthSettings,
    "memory": MemorySettings,
    "prior": PriorSettings,
    "axles": AxleSettings,
    "evolution": EvolutionSettings,
    "change": ChangeSettings,
}


def _complete(configuration: Configuration) -> Configuration:
    """With our own roles where none are given, and everything bound, so that errors come now."""
    if not configuration.choices:
        present = {message.name for message in configuration.database.db.messages}
        choices = tuple(
            choice
            for choice in contract_choices()
            if choice.axle <= configuration.vehicle.axles
            and (choice.message in present or choice.message not in OPTIONAL_MESSAGES)
        )
        configuration = replace(configuration, choices=choices)
    _ = configuration.messages
    configuration.make_estimator()
    return configuration


@dataclass(frozen=True, slots=True)
class _Vehicle:
    """[vehicle] as a file spells it."""

    axles: int = 6
    wheel_radius_m: float = 0.625
    axle_load_N: float = 245e3  # noqa: N815  the unit's own spelling
    wheelset_inertia_kgm2: float = 200.0
    train_mass_kg: float = 1.65e6
    load_std: float = 0.02


@dataclass(frozen=True, slots=True)
class _Geometry:
    """[vehicle.geometry] as a file spells it."""

    axles_per_bogie: tuple[int, ...] = (3, 3)
    pivot_distance_m: float = 10.3
    axle_spacing_m: float = 1.9
    coupler_height_m: float = 0.95
    traction_height_m: float = 0.46


def _vehicle(value: object, where: str) -> Locomotive:
    table = table_of(value, f"{where}: vehicle")
    lists = {key: table.pop(key, None) for key in ("wheel_radius_m", "axle_load_N")}
    geometry = table.pop("geometry", None)
    known = {f.name for f in fields(_Vehicle)}
    no_more(
        {k: v for k, v in table.items() if k not in known},
        f"{where}: vehicle",
        (*sorted(known), "geometry"),
    )
    scalars: _Vehicle = section(
        _Vehicle,
        table | {k: v for k, v in lists.items() if v is not None and not isinstance(v, list)},
        f"{where}: vehicle",
    )
    given = {
        key: typed(v, tuple[float, ...], f"{where}: vehicle.{key}")
        for key, v in lists.items()
        if isinstance(v, list)
    }
    stated = {len(v) for v in given.values()} | ({scalars.axles} if "axles" in table else set())
    axles = stated.pop() if stated else 6
    if stated:
        raise ConfigError(
            f"{where}: vehicle", "lists of different length", "give one value for each axle"
        )
    try:
        return Locomotive(
            wheel_radius=given.get("wheel_radius_m", (scalars.wheel_radius_m,) * axles),
            axle_load=given.get("axle_load_N", (scalars.axle_load_N,) * axles),
            wheelset_inertia=scalars.wheelset_inertia_kgm2,
            train_mass=scalars.train_mass_kg,
            geometry=_geometry(geometry, axles, f"{where}: vehicle.geometry"),
            load_std=scalars.load_std,
        )
    except ValueError as error:
        raise ConfigError(f"{where}: vehicle", str(error), "mend the value") from error


def _geometry(value: object, axles: int, where: str) -> Geometry | None:
    """As stated; a Co-Co's where nothing is and there are six axles."""
    if value is None:
        return Geometry() if axles == 6 else None
    stated: _Geometry = section(_Geometry, value, where)
    return Geometry(*(getattr(stated, f.name) for f in fields(_Geometry)))


@dataclass(frozen=True, slots=True)
class _RoleTable:
    """One role as a file spells it."""

    signal: str
    channel: str = ""
    unit: str = "?"
    factor: float = 1.0
    sign: int = 1
    offset: float = 0.0
    protection: str = ""
    data_id: int | None = None
    cycle_ms: float = 0.0
    not_available: bool = True


def _roles(table: Mapping[str, Any], where: str) -> list[SignalChoice]:
    choices: list[SignalChoice] = []
    for name, value in _flattened(table):
        place = f"{where}: roles.{name}"
        role, axle = _role(name, place)
        if any((choice.role, choice.axle) == (role, axle) for choice in choices):
            raise ConfigError(place, "named twice", "keep one of them")
        role_table = {"signal": value} if isinstance(value, str) else table_of(value, place)
        if "signal" not in role_table:
            raise ConfigError(place, "names no signal", 'write signal = "Message.Signal"')
        row: _RoleTable = section(_RoleTable, role_table, place)
        message, dot, signal = row.signal.rpartition(".")
        if not dot:
            raise ConfigError(place, f"{row.signal!r} is not Message.Signal", "name both")
        if row.sign not in (-1, 1):
            raise ConfigError(f"{place}.sign", f"{row.sign}", "write 1 or -1")
        if row.protection not in ("", *PROTECTIONS):
            raise ConfigError(
                f"{place}.protection",
                f"{row.protection!r}",
                f"write one of {', '.join(PROTECTIONS)}",
            )
        if row.factor == 0:
            raise ConfigError(f"{place}.factor", "0 makes every value 0", "write the factor")
        if row.data_id is not None and not 0 <= row.data_id <= 0xFFFF:
            raise ConfigError(f"{place}.data_id", f"{row.data_id}", "write 0 to 65535")
        if not 0 <= row.cycle_ms < 1e6:
            raise ConfigError(f"{place}.cycle_ms", f"{row.cycle_ms}", "write milliseconds")
        choices.append(
            SignalChoice(
                role,
                axle,
                message,
                signal,
                channel=row.channel or None,
                unit=None if row.unit == "?" else row.unit,
                factor=row.factor,
                sign=row.sign,
                offset=row.offset,
                protection=row.protection or None,  # type: ignore[arg-type]
                data_id=row.data_id,
                cycle_us=round(row.cycle_ms * 1000) or None,
                not_available=row.not_available,
            )
        )
    return choices


def _flattened(table: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """(role, value) of a table; TOML reads an unquoted `wheel_speed.1` as a table in a table."""
    rows: list[tuple[str, Any]] = []
    for name, value in table.items():
        if isinstance(value, dict) and value and all(key[:1].isdigit() for key in value):
            rows += [(f"{name}.{axle}", inner) for axle, inner in value.items()]
        else:
            rows.append((name, value))
    return rows


def _role(name: str, place: str) -> tuple[Role, int]:
    base, _, axle = name.partition(".")
    known = ", ".join(f"{role}.AXLE" if role.per_axle else str(role) for role in Role)
    try:
        role = Role(base)
    except ValueError as error:
        raise ConfigError(place, "unknown role", f"known: {known}") from error
    if role.per_axle is not bool(re.fullmatch("[1-9][0-9]{0,3}", axle)):
        mend = f"write {base}.1, {base}.2, .." if role.per_axle else f"write {base}"
        raise ConfigError(place, "axle missing" if role.per_axle else "has no axles", mend)
    return role, int(axle or 0)
