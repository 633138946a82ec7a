"""Units of signals, converted to SI at the bus and nowhere else."""

from collections.abc import Mapping
from math import pi
from unicodedata import normalize

from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import GRAVITY

_ANGULAR = {"rad/s": 1.0, "deg/s": pi / 180, "rpm": pi / 30, "1/min": pi / 30, "1/s": 2 * pi}
_LINEAR = {"m/s": 1.0, "km/h": 1 / 3.6, "kph": 1 / 3.6, "mph": 0.44704, "mm/s": 1e-3}
_FORCE = {"N": 1.0, "daN": 10.0, "kN": 1e3, "lbf": 4.4482216152605}
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
    Role.GNSS_SPEED: _LINEAR,
    Role.ACCELERATION: {"m/s²": 1.0, "m/s^2": 1.0, "m/s2": 1.0, "g": GRAVITY, "mg": GRAVITY / 1e3},
}
"""Factor to SI of every unit that a role accepts."""

_SPELLINGS: Mapping[str, tuple[str, ...]] = {
    "km/h": ("kmh", "kmph", "km/hr", "km/hour", "kmh-1"),
    "mph": ("mi/h", "mile/h", "miles/h", "mile/hour", "miles/hour"),
    "m/s": ("mps", "m/sec", "meter/s", "metre/s", "ms-1"),
    "mm/s": ("mm/sec",),
    "rad/s": ("rad/sec", "rads-1", "radian/s", "radians/s"),
    "deg/s": ("°/s", "º/s", "deg/sec", "°/sec", "degree/s", "degrees/s", "degree/sec"),
    "rpm": ("r/min", "rev/min", "u/min", "min-1", "/min", "umdr/min", "tr/min"),
    "1/s": ("s-1", "/s", "rev/s", "rps", "u/s"),
    "N": ("newton", "newtons"),
    "lbf": ("lb-f", "pound-force"),
    "t": ("ton", "tons", "tonne", "tonnes", "to"),
    "kg": ("kgs", "kilogram", "kilograms"),
    "degC": ("deg c", "degree c", "degrees c", "celsius", "grad c", "deg celsius"),
    "%": ("percent", "prozent", "pct", "%rh"),
    "permille": ("per mille", "promille", "mm/m"),
}
"""Other spellings of units in databases and tables, by the one that `UNITS` has."""


def _plain(unit: str) -> str:
    """A unit's letters without case, spaces and signs of powers."""
    plain = normalize("NFKC", unit).casefold().replace("\u2212", "-")
    return "".join(letter for letter in plain if letter not in " ^*·")


_KNOWN_AS = {_plain(one): unit for unit, others in _SPELLINGS.items() for one in (unit, *others)}


def find_factor(units: Mapping[str, float], unit: str) -> float | None:
    """Factor to SI of a unit as somebody spells it; None where it is unknown.

    Args:
        units: Factor to SI by unit, as in `UNITS`.
        unit: Unit as a database, a table or a configuration spells it: `Km/h`, `U/min`, `min-1`.

    """
    found = units.get(unit)
    if found is not None:
        return found
    plain = _plain(unit)
    by_plain = {_plain(one): factor for one, factor in units.items()}
    if plain in by_plain or plain not in _KNOWN_AS:
        return by_plain.get(plain)
    return units.get(_KNOWN_AS[plain])


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
    factor = find_factor(UNITS[role], unit)
    if factor is None and role is Role.WHEEL_SPEED and wheel_radius:
        rim = find_factor(_LINEAR, unit)
        factor = None if rim is None else rim / wheel_radius
    return factor


def known_units(role: Role) -> str:
    """Units that a role accepts, for an error message."""
    units = list(UNITS[role])
    if role is Role.WHEEL_SPEED:
        units += list(_LINEAR)
    return ", ".join(unit or '""' for unit in units)
