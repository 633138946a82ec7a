"""What the bus knows of each role: its units, its signal in the packaged database, its words.

Units of signals are converted to SI here and nowhere else.
"""

from collections.abc import Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from math import pi

from adhesion_can.bus.role_words import FORCES, FZ, SOURCE, SPEED, WHEEL
from adhesion_can.bus.units import find_factor
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import GRAVITY

_ANGULAR = {"rad/s": 1.0, "deg/s": pi / 180, "rpm": pi / 30, "1/min": pi / 30, "1/s": 2 * pi}
_LINEAR = {"m/s": 1.0, "km/h": 1 / 3.6, "kph": 1 / 3.6, "mph": 0.44704, "mm/s": 1e-3}
_FORCE = {"N": 1.0, "daN": 10.0, "kN": 1e3, "lbf": 4.4482216152605}
_MASS = {"kg": GRAVITY, "t": 1000 * GRAVITY}
_DEGREES = {"degC": 1.0, "°C": 1.0, "C": 1.0}
_NUMBER = {"": 1.0, "-": 1.0, "1": 1.0}

_VEHICLE = {"vehicle", "veh", "train", "ground", "fahrzeug", "fzg", "zug", "loco", "radar",
            "gnss", "gps", "odometry", "odometer", "odo", "ist", "true", "actual", "act", "fahr",
            "trein", "tram", "vehicule", "rame", "treno", "tren", "veicolo"}  # fmt: skip
_EFFORT = {"effort", "te", "zugkraft", "antriebskraft", "tractiveeffort", "tractive", "traction",
           "traktion", "tracteff", "rimforce", "fx", "effortrim", "zk"}  # fmt: skip
_LOAD = {"load", "weight", "last", "achslast", "radlast", "radsatzlast", "axleload", "axload",
         "charge", "normal", "gewicht", "carga", "poids", "peso", "masse", "mass"}  # fmt: skip
_WHOLE = {"vehicle", "veh", "train", "fahrzeug", "fzg", "loco", "tram", "wagen", "car", "body",
          "kasten", "caisse", "rame", "treno", "tren"}  # fmt: skip
_TEMPERATURE = {"temperature", "temp", "temperatur", "tmp", "t"}


@dataclass(frozen=True, slots=True, kw_only=True)
class RoleSpec:
    """A role at the bus.

    Attributes:
        units: Factor to SI of every unit that it accepts.
        signal: Message and signal of the packaged database, those of an axle without its number;
            None: it has none there.
        words: Words of a signal's name of which one says all; none where it takes two.
        of_thing: Words of the quantity, and of the thing that has it, where it takes both.
        against: Words of the signal's own name that make it another quantity.
        states: Words that the value table has for raw values, where it is a state; those of the
            contract.

    """

    units: Mapping[str, float]
    signal: tuple[str, str] | None = None
    words: AbstractSet[str] = frozenset()
    of_thing: tuple[AbstractSet[str], AbstractSet[str]] = (frozenset(), frozenset())
    against: AbstractSet[str] = frozenset()
    states: Mapping[int, AbstractSet[str]] = field(default_factory=dict)


ROLE_SPECS: Mapping[Role, RoleSpec] = {
    Role.WHEEL_SPEED: RoleSpec(
        units=_ANGULAR,
        signal=("WheelSpeeds", "WheelSpeed"),
        of_thing=(SPEED, WHEEL),
        against=_VEHICLE - {"act", "ist", "actual", "true"},
    ),
    Role.VEHICLE_SPEED: RoleSpec(
        units=_LINEAR,
        signal=("VehicleSpeed", "VehicleSpeed"),
        of_thing=(SPEED, _VEHICLE),
        against=WHEEL | SOURCE,
    ),
    Role.TRACTIVE_EFFORT: RoleSpec(
        units=_FORCE,
        signal=("TractiveEffort", "TractiveEffort"),
        words=_EFFORT | FORCES | FZ,
        against=_LOAD,
    ),
    Role.AXLE_LOAD: RoleSpec(
        units={**_FORCE, **_MASS},
        signal=("AxleLoads", "AxleLoad"),
        words=_LOAD | FORCES | FZ,
        against=_EFFORT | _WHOLE,
    ),
    Role.SPEED_SOURCE: RoleSpec(
        units=_NUMBER,
        signal=("VehicleSpeed", "VehicleSpeedSource"),
        words=SOURCE,
        states={1: {"radar"}, 2: {"gnss", "gps"}, 3: {"trailing"}, 4: {"derived"}},
    ),
    Role.DIRECTION: RoleSpec(
        units=_NUMBER,
        signal=("VehicleSpeed", "Direction"),
        words={"direction", "dir", "fahrtrichtung", "richtung", "reverser", "sens"},
        states={
            1: {"forward", "forwards", "vorwaerts", "vor", "fwd"},
            2: {"reverse", "backward", "backwards", "rueckwaerts", "rev"},
        },
    ),
    Role.AMBIENT_TEMPERATURE: RoleSpec(
        units=_DEGREES,
        signal=("Environment", "AmbientTemperature"),
        of_thing=(
            _TEMPERATURE,
            {"ambient", "outside", "outdoor", "aussen", "umgebung", "air", "amb", "luft"},
        ),
    ),
    Role.RAIL_TEMPERATURE: RoleSpec(
        units=_DEGREES,
        signal=("Environment", "RailTemperature"),
        of_thing=(_TEMPERATURE, {"rail", "schiene", "schienen"}),
    ),
    Role.HUMIDITY: RoleSpec(
        units={"%": 1.0},
        signal=("Environment", "RelativeHumidity"),
        words={"humidity", "hum", "rh", "feuchte", "luftfeuchte", "relativehumidity", "humidite"},
    ),
    Role.SANDING: RoleSpec(
        units=_NUMBER,
        signal=("Environment", "SandingActive"),
        words={"sand", "sanding", "sander", "sandung", "sandstreuer", "sablage", "sanden"},
        states={0: {"off", "no", "aus", "inactive", "false"}},
    ),
    Role.RAIN: RoleSpec(
        units=_NUMBER,
        signal=("Environment", "Rain"),
        words={"rain", "regen", "rainsensor", "pluie", "wiper"},
        states={0: {"none", "no", "dry", "off", "kein"}},
    ),
    Role.GRADIENT: RoleSpec(
        units={"permille": 1e-3, "‰": 1e-3, "%": 1e-2, "m/m": 1.0},
        signal=("TrackGeometry", "Gradient"),
        words={"gradient", "grade", "slope", "steigung", "neigung", "pente"},
    ),
    Role.CURVATURE: RoleSpec(
        units={"1/km": 1e-3, "1/m": 1.0},
        signal=("TrackGeometry", "Curvature"),
        words={"curvature", "curv", "kruemmung", "courbure"},
    ),
    # Nobody's database is searched for these two: no words.
    Role.GNSS_SPEED: RoleSpec(units=_LINEAR),
    Role.ACCELERATION: RoleSpec(
        units={"m/s²": 1.0, "m/s^2": 1.0, "m/s2": 1.0, "g": GRAVITY, "mg": GRAVITY / 1e3}
    ),
}
"""All roles but the user's channels, which stay in their own unit."""


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
    factor = find_factor(ROLE_SPECS[role].units, unit)
    if factor is None and role is Role.WHEEL_SPEED and wheel_radius:
        rim = find_factor(_LINEAR, unit)
        factor = None if rim is None else rim / wheel_radius
    return factor


def known_units(role: Role) -> str:
    """Units that a role accepts, for an error message."""
    units = list(ROLE_SPECS[role].units)
    if role is Role.WHEEL_SPEED:
        units += list(_LINEAR)
    return ", ".join(unit or '""' for unit in units)
