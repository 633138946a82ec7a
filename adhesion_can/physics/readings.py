"""Readings: one signal of one accepted frame, in SI units, with the role that it plays."""

from dataclasses import dataclass
from enum import StrEnum


class Role(StrEnum):
    """Meaning of a signal to the service; a comment beside each role has the unit of its values."""

    WHEEL_SPEED = "wheel_speed"  # rad/s, an axle each
    VEHICLE_SPEED = "vehicle_speed"  # m/s
    TRACTIVE_EFFORT = "tractive_effort"  # N, an axle each
    AXLE_LOAD = "axle_load"  # N, an axle each
    SPEED_SOURCE = "vehicle_speed_source"
    DIRECTION = "direction"
    AMBIENT_TEMPERATURE = "ambient_temperature"  # degC
    RAIL_TEMPERATURE = "rail_temperature"  # degC
    HUMIDITY = "relative_humidity"  # %
    SANDING = "sanding_active"
    RAIN = "rain"
    GRADIENT = "gradient"  # m/m
    CURVATURE = "curvature"  # 1/m
    CHANNEL = "channel"  # a signal of the user's, its number in place of an axle's

    @property
    def per_axle(self) -> bool:
        """Whether each axle has a signal of its own."""
        return self in PER_AXLE


REQUIRED = frozenset({Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT})
"""Roles without which no sample can be formed."""
PER_AXLE = frozenset({Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT, Role.AXLE_LOAD})


def role_name(role: Role, axle: int) -> str:
    """Role as configurations and reports spell it: `wheel_speed.1`, `vehicle_speed`."""
    return f"{role}.{axle}" if axle else str(role)


class SpeedSource:
    """Values of `Role.SPEED_SOURCE`."""

    UNKNOWN, RADAR, GNSS, TRAILING_AXLE, DRIVEN_AXLES = range(5)


class Direction:
    """Values of `Role.DIRECTION`."""

    UNKNOWN, FORWARD, REVERSE, NOT_AVAILABLE = range(4)


@dataclass(frozen=True, slots=True)
class Reading:
    """One signal of one accepted frame.

    Attributes:
        t_us: Time stamp, µs.
        role: Meaning of the signal.
        axle: Number of the axle, from 1; 0 for roles without an axle.
        value: Value in SI units; None where the sender marks it as not available.

    """

    t_us: int
    role: Role
    axle: int
    value: float | None
