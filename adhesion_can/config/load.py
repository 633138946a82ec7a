"""The configuration file: vehicle, database, roles and settings, in TOML.

Every key is known or an error. Sections and keys are those of the dataclasses in `Configuration`;
only `[vehicle]`, `[roles]`, `[channels]` and `[table]` have a spelling of their own. Values are in
the units that keys name.
"""

from dataclasses import replace
from pathlib import Path

from adhesion_can.bus.database import DATABASE_SUFFIXES, load_database
from adhesion_can.bus.roles import OPTIONAL_MESSAGES, SignalChoice, packaged_choices
from adhesion_can.config.configuration import Configuration
from adhesion_can.config.roles_section import load_channels, load_roles
from adhesion_can.config.table_section import load_table_section
from adhesion_can.config.toml_tables import (
    load_toml,
    nested_sections,
    nested_settings,
    reject_unknown_keys,
    section_keys,
    table_of,
)
from adhesion_can.config.vehicle_section import load_vehicle
from adhesion_can.errors import ConfigError
from adhesion_can.estimation.registry import DEFAULT
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import Locomotive


def settings_sections() -> dict[str, tuple[str, ...]]:
    """Keys of each section of settings by the section's name, in the order of `Configuration`."""
    return {name: section_keys(kind) for name, kind in nested_sections(Configuration)}


def load_configuration(
    path: Path | None = None, dbc: Path | None = None, *, lenient: bool = False
) -> Configuration:
    """Configuration from a TOML file.

    Args:
        path: Path of the TOML file; None: the defaults on the packaged database.
        dbc: Path of a database to use instead of the one that the file names.
        lenient: Whether messages with a fault are left out of the database, else it is refused.

    Raises:
        ConfigError: The file cannot be read, or has unknown keys or wrong values.
        DatabaseError: The database is missing, broken or lacks a signal.

    """
    if path is None:
        return _complete(
            Configuration(
                vehicle=Locomotive(), database=load_database(dbc, lenient=lenient), choices=()
            )
        )
    if path.suffix.lower() in DATABASE_SUFFIXES:
        raise ConfigError(
            str(path),
            "a CAN database, judging by its name, not a configuration",
            "pass it with --dbc",
        )
    document, sha256 = load_toml(path)
    where = path.name
    bus = table_of(document.pop("bus", {}), f"{where}: bus")
    named = bus.pop("database", None)
    reject_unknown_keys(bus, f"{where}: bus", ("database",))
    if named is not None and (not isinstance(named, str) or "\0" in named):
        raise ConfigError(f"{where}: bus.database", "not a path", 'write database = "my.dbc"')
    where_from = dbc or (path.parent / named if named else None)
    database = load_database(where_from, lenient=lenient)
    section = document.pop("vehicle", {})
    vehicle = load_vehicle(section, where)
    roles = document.pop("roles", None)
    choices = () if roles is None else load_roles(roles, where)
    channels = load_channels(document.pop("channels", {}), where)
    columns, assume_plausible = load_table_section(document.pop("table", {}), where)
    estimator = document.pop("estimator", DEFAULT)
    if not isinstance(estimator, str):
        raise ConfigError(f"{where}: estimator", "not a name", 'write estimator = "tracker"')
    sections = tuple(settings_sections())
    tables = {name: document.pop(name) for name in sections if name in document}
    settings = nested_settings(Configuration, tables, where)
    if "effort_std" not in tables.get("sensors", {}):
        usual = settings["sensors"].effort_std * vehicle.relative_load
        settings["sensors"] = replace(settings["sensors"], effort_std=usual)
    reject_unknown_keys(
        document, where, ("bus", "vehicle", "roles", "channels", "table", "estimator", *sections)
    )
    return _complete(
        Configuration(
            vehicle=vehicle,
            vehicle_keys=frozenset(section),
            database=database,
            choices=(*choices, *channels.choices),
            channels=channels.channels,
            columns=columns,
            assume_plausible=assume_plausible,
            estimator=estimator,
            where=where,
            sha256=sha256,
            **settings,
        )
    )


def _complete(configuration: Configuration) -> Configuration:
    """Configuration with the default roles where none are given; errors of any part are raised."""
    given = configuration.choices
    if all(choice.role is Role.CHANNEL for choice in given):
        messages = {message.name for message in configuration.database.db.messages}
        choices = tuple(
            choice
            for choice in packaged_choices()
            if choice.axle <= configuration.vehicle.axles
            and (choice.message in messages or choice.message not in OPTIONAL_MESSAGES)
        )
        configuration = replace(configuration, choices=(*choices, *given))
    if configuration.observes_speed:
        configuration = _without_vehicle_speed(configuration, given)
    _ = configuration.messages
    configuration.find_estimator()
    return configuration


_OF_SPEED = (Role.VEHICLE_SPEED, Role.SPEED_SOURCE)


def _without_vehicle_speed(
    configuration: Configuration, given: tuple[SignalChoice, ...]
) -> Configuration:
    """Configuration without the roles that the observed speed replaces; an error if written."""
    for choice in given:
        if choice.role in _OF_SPEED:
            raise ConfigError(
                f"{configuration.where}: roles.{choice.name}",
                "[observed_speed] enabled = true replaces the vehicle speed",
                "remove one of the two",
            )
    choices = tuple(kept for kept in configuration.choices if kept.role not in _OF_SPEED)
    return replace(configuration, choices=choices)
