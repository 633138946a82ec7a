"""Calibrated values in a user's configuration file, whose other text stays as it is."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import InlineTable

from adhesion_can.bus.database import packaged_path
from adhesion_can.bus.roles import SignalChoice
from adhesion_can.config.calibrated_radii import rim_axles
from adhesion_can.config.configuration import Configuration
from adhesion_can.config.toml_tables import LARGEST_FILE
from adhesion_can.input_files import read_small_file
from adhesion_can.physics.readings import Role

MARK = "calibrated:"
"""First word of the remark of a calibration in a comment; text before it is the user's."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """Changes by a calibration, with a remark on standard error and origin for each.

    Attributes:
        radius_ratio: New over configured radius by axle, of the estimated radii.
        offset: Zero error of the vehicle speed as configured so far, m/s; None: not identifiable.
        speed_error_std: Standard error of the wheels' radii against the vehicle speed, 1, the share
        by which the scale of the slip may still be wrong by; None: it is not known.
        radii_remark: Remark behind `wheel_radius_m`.
        factor_remark: Remark behind the role of a wheel speed given at the rim, by axle.
        offset_remark: Remark behind the role of the vehicle speed.
        speed_error_remark: Remark behind `speed_error_std`.

    """

    radius_ratio: Mapping[int, float]
    offset: float | None
    speed_error_std: float | None
    radii_remark: str
    factor_remark: Mapping[int, str]
    offset_remark: str
    speed_error_remark: str = ""


def with_correction(
    configuration: Configuration, source: Path | None, target: Path, correction: Correction
) -> str:
    """Text of the configuration file with the correction, its comments and order kept.

    Args:
        configuration: Configuration as it was loaded.
        source: Path of its file; None: the defaults, and a new file is begun.
        target: Path of the new file; the path of the database is made relative to it.
        correction: Changes to write.

    """
    text = "" if source is None else read_small_file(source, LARGEST_FILE).decode("utf-8")
    document = tomlkit.parse(text)
    _name_database(document, configuration, target)
    at_rim = rim_axles(configuration)
    radii = [axle for axle in correction.radius_ratio if axle not in at_rim]
    if radii:
        _set_radii(document, configuration, correction, radii)
    if correction.speed_error_std is not None:
        instruments = document.setdefault("instruments", tomlkit.table())
        _put(instruments, "speed_error_std", float(f"{correction.speed_error_std:.2g}"))
        _remark(instruments, "speed_error_std", correction.speed_error_remark)
    scaled = [axle for axle in correction.radius_ratio if axle in at_rim]
    if not scaled and correction.offset is None:
        return tomlkit.dumps(document)
    roles = _roles(document, configuration)
    choices = {(choice.role, choice.axle): choice for choice in configuration.choices}
    for axle in scaled:
        choice = choices[Role.WHEEL_SPEED, axle]
        ratio = correction.radius_ratio[axle]
        keys = {"factor": choice.used_factor * ratio}
        if choice.offset:
            keys["offset"] = choice.offset * ratio
        _set_keys(roles, choice, keys, correction.factor_remark[axle])
    if correction.offset is not None:
        choice = choices[Role.VEHICLE_SPEED, 0]
        offset = choice.offset + correction.offset
        _set_keys(roles, choice, {"offset": offset}, correction.offset_remark)
    return tomlkit.dumps(document)


def _name_database(document: Any, configuration: Configuration, target: Path) -> None:
    """Set the path of the database so that the new file finds it."""
    used = configuration.database.path.resolve()
    if used == packaged_path().resolve():
        return
    bus = document.setdefault("bus", tomlkit.table())
    named = bus.get("database")
    if named is None or (target.parent / named).resolve() != used:
        bus["database"] = os.path.relpath(used, target.resolve().parent)


def _set_radii(
    document: Any, configuration: Configuration, correction: Correction, axles: Sequence[int]
) -> None:
    radii = list(configuration.vehicle.wheel_radius)
    for axle in axles:
        radii[axle - 1] = round(radii[axle - 1] * correction.radius_ratio[axle], 7)
    vehicle = document.setdefault("vehicle", tomlkit.table())
    stated = vehicle.get("wheel_radius_m")
    if isinstance(stated, list):
        # In place, which keeps the comments between the values.
        for axle in axles:
            stated[axle - 1] = radii[axle - 1]
    _put(vehicle, "wheel_radius_m", stated if isinstance(stated, list) else radii)
    _remark(vehicle, "wheel_radius_m", correction.radii_remark)


def _roles(document: Any, configuration: Configuration) -> Any:
    """Table of the roles. One role in a file replaces all defaults, so all of them are written."""
    if "roles" not in document:
        roles = tomlkit.table()
        for choice in configuration.choices:
            roles[choice.name] = f"{choice.message}.{choice.signal}"
        document["roles"] = roles
    return document["roles"]


def _set_keys(roles: Any, choice: SignalChoice, keys: Mapping[str, float], remark: str) -> None:
    """Set keys of a role, in each of the spellings of a role."""
    table, name = roles, choice.name
    if name not in roles:
        # An unquoted wheel_speed.1 is a table in a table.
        outer, _, name = name.partition(".")
        table = roles[outer]
    if isinstance(table[name], str):
        signal = tomlkit.inline_table()
        signal["signal"] = str(table[name])
        _put(table, name, signal)
    role = table[name]
    for key, value in keys.items():
        _put(role, key, float(f"{value:.8g}"))
    if isinstance(role, InlineTable):
        _remark(table, name, remark)
    else:
        _remark(role, next(iter(keys)), remark)


def _put(table: Any, key: str, value: Any) -> None:
    """Replace a value and keep the comment behind it."""
    comment = table[key].trivia.comment if key in table else ""
    table[key] = value
    if comment:
        table[key].comment(comment.lstrip("# "))


def _remark(table: Any, key: str, remark: str) -> None:
    """Add a remark to the comment behind a value, replacing an earlier remark.

    Within an inline table TOML has no comments: there the remark is left out.
    """
    if isinstance(table, InlineTable):
        return
    item = table[key]
    users = item.trivia.comment.lstrip("# ").partition(MARK)[0].rstrip("; ")
    item.comment(f"{users}; {MARK} {remark}" if users else f"{MARK} {remark}")
