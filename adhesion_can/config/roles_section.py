"""Sections `[roles]` and `[channels]` of the configuration file: which signal has which meaning."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

from adhesion_can.bus.roles import PROTECTIONS, SignalChoice
from adhesion_can.config.toml_tables import section, table_of
from adhesion_can.errors import ConfigError
from adhesion_can.physics.channels import CHANNELS, UserChannel
from adhesion_can.physics.readings import Role
from adhesion_can.ranges import Within


@dataclass(frozen=True, slots=True)
class _RoleTable:
    """Table of one role in the file.

    Attributes:
        signal: Signal as `Message.Signal`.
        channel: CAN channel on which the message is received; '' for any.
        unit: Unit of the signal's values; '?' for the unit of the database.
        factor: Factor on the value after the conversion of its unit; without it 1.
        sign: 1, or -1 where the signal counts the other way.
        offset: Zero error, in the unit of the role, subtracted last.
        protection: Protection of the message, `e2e-p01` or `none`; '' for that of the database.
        data_id: Data ID of the protection; without it that of the database.
        cycle_ms: Cycle of the message, ms; 0 for that of the database.
        not_available: Whether a raw value of all ones means that the signal is not available.
        stuck_check: Whether a speed or an effort with noise counts as not available once its value
            stops to change.

    """

    signal: str
    channel: str = ""
    unit: str = "?"
    factor: Annotated[float | None, Within(-1e12, 1e12)] = None
    sign: Annotated[int, Within(-1, 1)] = 1
    offset: Annotated[float, Within(-1e12, 1e12)] = 0.0
    protection: str = ""
    data_id: Annotated[int | None, Within(0, 0xFFFF)] = None
    cycle_ms: Annotated[float, Within(0, 100000)] = 0.0
    not_available: bool = True
    stuck_check: bool = True


def load_roles(value: object, where: str) -> tuple[SignalChoice, ...]:
    """Signals of the roles from the section `[roles]`.

    Args:
        value: TOML table.
        where: File, for errors.

    Raises:
        ConfigError: A role is unknown or named twice, or one of its values is wrong.

    """
    table = table_of(value, f"{where}: roles")
    choices: list[SignalChoice] = []
    for name, role_value in _flattened(table):
        place = f"{where}: roles.{name}"
        role, axle = _role(name, place)
        if any((choice.role, choice.axle) == (role, axle) for choice in choices):
            raise ConfigError(place, "named twice", "keep one of them")
        given = (
            {"signal": role_value} if isinstance(role_value, str) else table_of(role_value, place)
        )
        choices.append(load_choice(role, axle, given, place))
    return tuple(choices)


def load_choice(role: Role, axle: int, table: Mapping[str, Any], place: str) -> SignalChoice:
    """Signal of a role from its table.

    Args:
        role: Meaning of the signal.
        axle: Number of the axle or of the channel, from 1; 0 for none.
        table: Keys of the role.
        place: Place in the file, for errors.

    Raises:
        ConfigError: A value is wrong.

    """
    if "signal" not in table:
        raise ConfigError(place, "names no signal", 'write signal = "Message.Signal"')
    row: _RoleTable = section(_RoleTable, table, place)
    message, dot, signal = row.signal.rpartition(".")
    if not dot:
        raise ConfigError(place, f"{row.signal!r} is not Message.Signal", "name both")
    if row.sign not in (-1, 1):
        raise ConfigError(f"{place}.sign", f"{row.sign}", "write 1 or -1")
    if row.protection not in ("", *PROTECTIONS):
        fix = f"write one of {', '.join(PROTECTIONS)}"
        raise ConfigError(f"{place}.protection", f"{row.protection!r}", fix)
    if row.factor == 0:
        raise ConfigError(f"{place}.factor", "0 makes every value 0", "write the factor")
    return SignalChoice(
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
        stuck_check=row.stuck_check,
    )


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
    of_roles = [role for role in Role if role is not Role.CHANNEL]
    known = ", ".join(f"{role}.AXLE" if role.per_axle else str(role) for role in of_roles)
    role = next((role for role in of_roles if role == base), None)
    if role is None:
        fix = f"known: {known}; put other signals under [channels]"
        raise ConfigError(place, "unknown role", fix)
    fits = re.fullmatch("[1-9][0-9]{0,3}", axle) if role.per_axle else name == base
    if not fits:
        fix = f"write {base}.1, {base}.2, .." if role.per_axle else f"write {base}"
        raise ConfigError(place, "axle missing" if role.per_axle else "has no axles", fix)
    return role, int(axle or 0)


_RESERVED = {name for c in CHANNELS for name in (c.name, c.column, c.contact)}


class UserChannels(NamedTuple):
    """Channels of the user, and the signals that carry them, in the same order.

    Attributes:
        channels: Names with units and labels.
        choices: Signals; the number of a channel, from 1, takes the place of an axle's.

    """

    channels: tuple[UserChannel, ...]
    choices: tuple[SignalChoice, ...]


def load_channels(value: object, where: str) -> UserChannels:
    """Channels from the section `[channels]`.

    Args:
        value: TOML table: a name, and `Message.Signal` or a table as for a role, with `label`.
        where: File, for errors.

    Raises:
        ConfigError: A name is taken or a value is wrong.

    """
    channels, choices = [], []
    for number, (name, stated) in enumerate(table_of(value, f"{where}: channels").items(), 1):
        place = f"{where}: channels.{name}"
        if not re.fullmatch(r"[A-Za-z]\w*", name):
            raise ConfigError(place, "not a name", "write letters, digits and _")
        if name in _RESERVED:
            raise ConfigError(place, "a built-in channel has this name", "choose another name")
        table = {"signal": stated} if isinstance(stated, str) else table_of(stated, place)
        unit, label = (_pop_text(table, key, place) for key in ("unit", "label"))
        choice = load_choice(Role.CHANNEL, number, table, place)
        # The unit is for reports: the values stay as they are.
        choices.append(replace(choice, unit=""))
        channels.append(UserChannel(name, unit, label))
    return UserChannels(tuple(channels), tuple(choices))


def _pop_text(table: dict[str, Any], key: str, place: str) -> str:
    """Text that a channel has beside its signal, taken out of its table."""
    value = table.pop(key, "")
    if not isinstance(value, str):
        raise ConfigError(f"{place}.{key}", f"{value!r} is not a string", "write it in quotes")
    return value
