"""Section `[channels]` of the configuration file: further signals that may be a cause."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from adhesion_can.bus.roles import SignalChoice
from adhesion_can.config.roles_section import load_choice
from adhesion_can.config.toml_tables import table_of
from adhesion_can.errors import ConfigError
from adhesion_can.physics.channels import CHANNELS, UserChannel
from adhesion_can.physics.readings import Role

_RESERVED = {name for c in CHANNELS for name in (c.name, c.column, c.contact)}


class UserChannels(NamedTuple):
    """Channels of the user, and the signals that carry them, in the same order.

    Attributes:
        channels: Names with units and labels.
        choices: Signals; the number of a channel, from 1, takes the place of an axle's.

    """

    channels: tuple[UserChannel, ...]
    choices: tuple[SignalChoice, ...]


@dataclass(frozen=True, slots=True)
class _Texts:
    """What a channel has beside its signal."""

    unit: str
    label: str


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
        texts = _texts(table, place)
        choice = load_choice(Role.CHANNEL, number, table, place)
        # The unit is for reports: the values stay as they are.
        choices.append(replace(choice, unit=""))
        channels.append(UserChannel(name, texts.unit, texts.label))
    return UserChannels(tuple(channels), tuple(choices))


def _texts(table: dict[str, Any], place: str) -> _Texts:
    """Unit and label, taken out of the table of a channel."""
    found: Mapping[str, Any] = {key: table.pop(key, "") for key in ("unit", "label")}
    for key, value in found.items():
        if not isinstance(value, str):
            raise ConfigError(f"{place}.{key}", f"{value!r} is not a string", "write it in quotes")
    return _Texts(found["unit"], found["label"])
