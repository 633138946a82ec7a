"""Readings as variables: names, units and descriptions by the signals' roles."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from adhesion_can.bus.roles import BoundMessage
from adhesion_can.fmu.variables import (
    DIRECTION,
    SPEED_SOURCE,
    Causality,
    Variable,
    enumerated,
)
from adhesion_can.physics.channels import COVARIATES, UserChannel, channel_label
from adhesion_can.physics.readings import ROLE_UNITS, Direction, Role, SpeedSource

STATES = {
    Role.SPEED_SOURCE: (SPEED_SOURCE, "source of the vehicle speed", SpeedSource.UNKNOWN),
    Role.DIRECTION: (DIRECTION, "direction of travel", Direction.UNKNOWN),
}
"""Roles whose readings are items of an enumeration: type, meaning, and item where none is given."""
MEANINGS = {
    Role.WHEEL_SPEED: "angular speed of the wheelset",
    Role.VEHICLE_SPEED: "vehicle speed, 0 or more in both directions",
    Role.TRACTIVE_EFFORT: "effort at the wheel rim, positive along the direction of travel",
    Role.AXLE_LOAD: "load of the wheelset on the rail",
    Role.GNSS_SPEED: "speed by satellites",
    Role.ACCELERATION: "longitudinal acceleration without gravity's part",
}
"""Meaning of the roles that need more words than their label."""


class SignalKey(NamedTuple):
    """A role with its axle, or with the number of the user's channel.

    Attributes:
        role: Role.
        axle: Number of the axle or channel, from 1; 0 for neither.

    """

    role: Role
    axle: int


def signal_variable(
    key: SignalKey, causality: Causality, channels: Sequence[UserChannel] = ()
) -> Variable:
    """Variable that carries the readings of a role.

    Args:
        key: Role and axle.
        causality: Whether the slave gets the readings or gives them.
        channels: Channels of the configuration, by their numbers from 1.

    """
    role, axle = key
    if role is Role.CHANNEL:
        channel = channels[axle - 1]
        label = channel.label or channel.name
        return Variable(f"channel_{channel.name}", causality, label, channel.unit)
    if role in STATES:
        kind, meaning, start = STATES[role]
        return enumerated(role.value, causality, kind, meaning, start)
    meaning = MEANINGS.get(role) or channel_label(COVARIATES[role])
    if axle:
        return Variable(
            f"{role.value}_{axle}", causality, f"axle {axle}: {meaning}", ROLE_UNITS.get(role, "")
        )
    return Variable(role.value, causality, meaning, ROLE_UNITS.get(role, ""))


class SignalGroup(NamedTuple):
    """Signals that a message carries together: they are read at the same times.

    Attributes:
        parameter: Name of the parameter with their cycle.
        cycle_us: Cycle as configured, µs.
        keys: Role and axle of each signal.
        message: Their message.

    """

    parameter: str
    cycle_us: int
    keys: tuple[SignalKey, ...]
    message: BoundMessage


def group_signals(messages: Iterable[BoundMessage]) -> list[SignalGroup]:
    """Signals by message, in the order in which a bus would carry them: by ascending id."""
    ordered = sorted(
        messages,
        key=lambda bound_message: (bound_message.plan.is_extended, bound_message.plan.frame_id),
    )
    names: dict[str, int] = {}
    groups = []
    for message in ordered:
        name = f"cycle_{message.plan.name}"
        names[name] = names.get(name, 0) + 1
        if names[name] > 1:  # the same message of a second bus
            name += f"_{names[name]}"
        keys = tuple(SignalKey(signal.role, signal.axle) for signal in message.signals)
        groups.append(SignalGroup(name, message.cycle_us or 0, keys, message))
    return groups


def cycle_variable(group: SignalGroup, names: Iterable[str]) -> Variable:
    """Parameter with the cycle of a group.

    Args:
        group: Signals that are read together.
        names: Names of their variables.

    """
    what = f"time from one reading to the next of {', '.join(names)}"
    return Variable(group.parameter, Causality.PARAMETER, what, "s", group.cycle_us / 1e6)
