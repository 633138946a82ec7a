"""Readings: one signal of one accepted frame, in SI units, with the role that it plays."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class Role(StrEnum):
    """Meaning of a signal to the service; `ROLE_UNITS` has the unit of its values."""

    WHEEL_SPEED = "wheel_speed"  # an axle each
    VEHICLE_SPEED = "vehicle_speed"
    TRACTIVE_EFFORT = "tractive_effort"  # an axle each
    AXLE_LOAD = "axle_load"  # an axle each
    SPEED_SOURCE = "vehicle_speed_source"
    DIRECTION = "direction"
    AMBIENT_TEMPERATURE = "ambient_temperature"
    RAIL_TEMPERATURE = "rail_temperature"
    HUMIDITY = "relative_humidity"
    SANDING = "sanding_active"
    RAIN = "rain"
    GRADIENT = "gradient"
    CURVATURE = "curvature"
    GNSS_SPEED = "gnss_speed"  # beside wheels and efforts, for the observed speed
    ACCELERATION = "acceleration"  # longitudinal, without gravity's part, likewise
    CHANNEL = "channel"  # a signal of the user's, its number in place of an axle's

    @property
    def per_axle(self) -> bool:
        """Whether each axle has a signal of its own."""
        return self in PER_AXLE


REQUIRED = frozenset({Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT})
"""Roles without which no sample can be formed."""
ROLE_UNITS: Mapping[Role, str] = {
    Role.WHEEL_SPEED: "rad/s",
    Role.VEHICLE_SPEED: "m/s",
    Role.TRACTIVE_EFFORT: "N",
    Role.AXLE_LOAD: "N",
    Role.AMBIENT_TEMPERATURE: "degC",
    Role.RAIL_TEMPERATURE: "degC",
    Role.HUMIDITY: "%",
    Role.GRADIENT: "m/m",
    Role.CURVATURE: "1/m",
    Role.GNSS_SPEED: "m/s",
    Role.ACCELERATION: "m/s²",
}
"""SI unit of the readings of a role; states and the user's channels have none here."""
PER_AXLE = frozenset({Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT, Role.AXLE_LOAD})
SPEED_AIDS = frozenset({Role.GNSS_SPEED, Role.ACCELERATION})
"""Roles that only the observed speed uses. Nobody's database is searched for them."""


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
