"""Units of signals, converted to SI at the bus and nowhere else."""

from math import pi

from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import GRAVITY

_ANGULAR = {"rad/s": 1.0, "deg/s": pi / 180, "rpm": pi / 30, "1/min": pi / 30, "1/s": 2 * pi}
_LINEAR = {"m/s": 1.0, "km/h": 1 / 3.6, "kph": 1 / 3.6, "mph": 0.44704, "mm/s": 1e-3}
_FORCE = {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605}
_MASS = {"kg": GRAVITY, "t": 1000 * GRAVITY}
_NUMBER = {"": 1.0, "-": 1.0, "1": 1.0}

UNITS: dict[Role, dict[str, float]] = {
    Role.WHEEL_SPEED: _ANGULAR,
    Role.VEHICLE_SPEED: _LINEAR,
    Role.TRACTIVE_EFFORT: _FORCE,
    Role.AXLE_LOAD: {**_FORCE, **_MASS},
    Role.SPEED_SOURCE: _NUMBER,
    Role.DIRECTION: _NUMBER,
    Role.AMBIENT_TEMPERATURE: {"degC": 1.0, "°C": 1.0, "C": 1.0},
    Role.RAIL_TEMPERATURE: {"degC": 1.0, "°C": 1.0, "C": 1.0},
    Role.HUMIDITY: {"%": 1.0},
    Role.SANDING: _NUMBER,
    Role.RAIN: _NUMBER,
    Role.GRADIENT: {"permille": 1e-3, "‰": 1e-3, "%": 1e-2, "m/m": 1.0},
    Role.CURVATURE: {"1/km": 1e-3, "1/m": 1.0},
}
"""Factor to SI of every unit that a role accepts."""


def to_si(role: Role, unit: str, wheel_radius: float | None) -> float | None:
    """Factor from a unit to the SI unit of a role; None where the role does not accept it.

    A wheel speed may be given as speed of the rim (km/h): it is divided by the configured radius.

    Args:
        role: Meaning of the signal.
        unit: Unit as the database or the configuration spells it.
        wheel_radius: Wheel radius of the axle, m; None for roles without axle.

    """
    if role is Role.CHANNEL:
        return 1.0  # a channel of the user's stays in its own unit
    factor = UNITS[role].get(unit)
    if factor is None and role is Role.WHEEL_SPEED and wheel_radius:
        rim = _LINEAR.get(unit)
        factor = None if rim is None else rim / wheel_radius
    return factor


def known_units(role: Role) -> str:
    """Units that a role accepts, for an error message."""
    units = list(UNITS[role])
    if role is Role.WHEEL_SPEED:
        units += list(_LINEAR)
    return ", ".join(unit or '""' for unit in units)
