"""Roles of a database's signals, guessed from names, units and message names.

A wrong guess costs more than none: two signals that fit a role about equally well are rivals, and
neither is taken.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from cantools.database.can import Message, Signal

from adhesion_can.bus.signal_columns import find_obstacle
from adhesion_can.bus.units import to_si
from adhesion_can.physics.readings import PER_AXLE, Role, role_name
from adhesion_can.physics.vehicle import MOST_AXLES

LEAST_SCORE = 3
"""Score from which a signal is a candidate: a name that fits, and nothing against it."""
CLEAR_LEAD = 1
"""Lead over the next candidate with which the better one is taken."""

_WHEEL = {"wheel", "whl", "wheelset", "wheelspeed", "whlspd", "axle", "axl", "ax", "axis",
          "radsatz", "rs", "rad", "achse", "achs", "omega", "essieu", "roue", "eje", "rueda",
          "asse", "ruota"}  # fmt: skip
_SPEED = {"speed", "spd", "velocity", "vel", "v", "n", "omega", "w", "drehzahl", "rpm",
          "geschwindigkeit", "geschw", "vitesse", "velocidad", "velocita", "rotspeed", "tacho",
          "whlspd", "wheelspeed"}  # fmt: skip
_VEHICLE = {"vehicle", "veh", "train", "ground", "fahrzeug", "fzg", "zug", "loco", "radar",
            "gnss", "gps", "odometry", "odometer", "odo", "ist", "true", "actual", "act", "fahr",
            "trein", "tram"}  # fmt: skip
_VEHICLE_WHOLE = {"vehiclespeed", "groundspeed", "trainspeed", "fahrgeschwindigkeit", "vfzg",
                  "vveh", "vist", "vtrain", "zuggeschwindigkeit"}  # fmt: skip
_EFFORT = {"effort", "te", "force", "zugkraft", "kraft", "antriebskraft", "tractiveeffort",
           "tractive", "traction", "traktion", "tracteff", "rimforce", "fx", "f", "effortrim",
           "fuerza", "forza", "zk"}  # fmt: skip
_LOAD = {"load", "weight", "last", "achslast", "radlast", "radsatzlast", "axleload", "axload",
         "charge", "normal", "fz", "gewicht", "carga"}  # fmt: skip
_AMBIENT = {"ambient", "outside", "outdoor", "aussen", "umgebung", "air", "amb", "luft"}
_RAIL = {"rail", "schiene", "schienen"}
_TEMPERATURE = {"temperature", "temp", "temperatur", "tmp", "t"}
_HUMIDITY = {"humidity", "hum", "rh", "feuchte", "luftfeuchte", "relativehumidity", "humidite"}
_SANDING = {"sand", "sanding", "sander", "sandung", "sandstreuer", "sablage", "sanden"}
_RAIN = {"rain", "regen", "rainsensor", "pluie", "wiper"}
_GRADIENT = {"gradient", "grade", "slope", "steigung", "neigung", "pente"}
_CURVATURE = {"curvature", "curv", "kruemmung", "courbure"}
_DIRECTION = {"direction", "dir", "fahrtrichtung", "richtung", "reverser", "sens"}
_SOURCE = {"source", "src", "quelle"}
_AGAINST = {"setpoint", "set", "soll", "demand", "dmd", "req", "request", "target", "max", "min",
            "limit", "lim", "avail", "available", "valid", "validity", "quality", "status", "stat",
            "fault", "err", "error", "std", "raw", "mean", "avg", "average", "filtered", "filt",
            "motor", "mot", "engine", "wind", "fan", "brake", "brk", "bremse", "oil", "cylinder",
            "lateral", "lat", "vertical", "yaw", "enable", "cmd", "command", "reference", "ref",
            "est", "estimated", "test", "sim", "old", "backup", "redundant", "prev", "diff",
            "threshold", "acc", "accel", "acceleration", "offset", "crc", "alive", "counter", "cnt",
            "creep", "slip", "schlupf", "cabin", "innen", "inside", "coolant", "inverter",
            "gearbox", "bearing", "lager", "oel", "display", "anzeige", "trailer", "sum", "total",
            "all", "whole", "angle", "level", "tank", "door"}  # fmt: skip
"""Words that make a signal another quantity, or another form of it, than the measured one."""
_AXLE_MESSAGES = {*_WHEEL, "drive", "motor", "mot", "antrieb", "traktion", "traction", "trk"}
"""Words of messages whose number is that of an axle."""
_SIDES = {"l", "r", "left", "right", "fl", "fr", "rl", "rr", "links", "rechts"}
_STATES: Mapping[Role, Mapping[int, frozenset[str]]] = {
    Role.SPEED_SOURCE: {
        1: frozenset({"radar"}),
        2: frozenset({"gnss", "gps"}),
        3: frozenset({"trailing"}),
        4: frozenset({"derived"}),
    },
    Role.DIRECTION: {
        1: frozenset({"forward", "forwards", "vorwaerts", "vor", "fwd"}),
        2: frozenset({"reverse", "backward", "backwards", "rueckwaerts", "rev"}),
    },
    Role.RAIN: {0: frozenset({"none", "no", "dry", "off", "kein"})},
    Role.SANDING: {0: frozenset({"off", "no", "aus", "inactive", "false"})},
}
"""Words that the value table has for raw values, where a role is a state; those of the contract."""


@dataclass(frozen=True, slots=True)
class RoleGuess:
    """A signal that fits a role.

    Attributes:
        role: Meaning of the signal.
        axle: Number of the axle, 1.. for roles per axle, else 0.
        message: Message of the signal.
        signal: Signal.
        score: Points of its names and unit; more fits better.
        reasons: What speaks for it, a few words each.

    """

    role: Role
    axle: int
    message: Message
    signal: Signal
    score: int
    reasons: tuple[str, ...]

    @property
    def name(self) -> str:
        """Role as configurations spell it."""
        return role_name(self.role, self.axle)

    @property
    def place(self) -> str:
        """Signal as configurations spell it, `Message.Signal`."""
        return f"{self.message.name}.{self.signal.name}"


@dataclass(frozen=True, slots=True)
class GuessedRoles:
    """Roles of the signals of a database.

    Attributes:
        taken: Guesses that are clear, no signal in two of them.
        rivals: Guesses by role of which none is clearly the better one, best first.

    """

    taken: tuple[RoleGuess, ...]
    rivals: Mapping[str, tuple[RoleGuess, ...]]


def guess_roles(messages: Iterable[Message]) -> GuessedRoles:
    """Roles of the signals of these messages.

    Args:
        messages: Messages of a database, in cantools' form.

    """
    found = [g for m in messages for signal in m.signals for g in _guesses(m, signal)]
    by_role: dict[str, list[RoleGuess]] = {}
    for guess in (*found, *_counted_from_zero(found)):
        if guess.axle or guess.role not in PER_AXLE:
            by_role.setdefault(guess.name, []).append(guess)
    taken: list[RoleGuess] = []
    rivals: dict[str, tuple[RoleGuess, ...]] = {}
    for name, alike in by_role.items():
        alike.sort(key=lambda guess: (-guess.score, guess.place))
        best = [g for g in alike if g.score > alike[0].score - CLEAR_LEAD]
        if len(best) == 1:
            taken.append(best[0])
        else:
            rivals[name] = tuple(best)
    _leave_out_shared(taken, rivals)
    return GuessedRoles(tuple(sorted(taken, key=_order)), dict(sorted(rivals.items())))


def _counted_from_zero(found: Sequence[RoleGuess]) -> Iterable[RoleGuess]:
    """Guesses of the axles one higher, for roles of which a signal has the number 0.

    Whether 0 is the first axle or something else nobody knows: the signals become rivals.
    """
    roles = {guess.role for guess in found if guess.role in PER_AXLE and not guess.axle}
    for guess in found:
        if guess.role in roles:
            yield replace(guess, axle=guess.axle + 1)


def _leave_out_shared(taken: list[RoleGuess], rivals: dict[str, tuple[RoleGuess, ...]]) -> None:
    """A signal that fits two roles is taken for neither."""
    places = [guess.place for guess in taken]
    places += {rival.place for alike in rivals.values() for rival in alike}
    for guess in [one for one in taken if places.count(one.place) > 1]:
        taken.remove(guess)
        rivals[guess.name] = (guess,)


def _order(guess: RoleGuess) -> tuple[int, int]:
    return list(Role).index(guess.role), guess.axle


def _guesses(message: Message, signal: Signal) -> Iterable[RoleGuess]:
    """Roles that a signal fits, each with its score."""
    words, number = _words(signal.name)
    around, around_number = _words(message.name)
    if find_obstacle(signal, message) or set(words) & _AGAINST:
        return
    axle = None if set(words) & _SIDES else number  # a wheel of a side is no axle
    if number is None and set(around) & _AXLE_MESSAGES:
        axle = around_number
    doubtful = 2 if set(around) & _AGAINST else 0
    roles = [role for role in Role if role is not Role.CHANNEL]
    if axle is None or axle > MOST_AXLES:
        roles = [role for role in roles if role not in PER_AXLE]
    for role in roles:
        named, kind = _named(role, words, around), _kind(role, signal)
        # One of several vehicle speeds is less likely the one.
        several = 1 if role is Role.VEHICLE_SPEED and number is not None else 0
        score = named + 2 - doubtful - several
        if named and kind and score >= LEAST_SCORE:
            place = axle or 0 if role in PER_AXLE else 0
            yield RoleGuess(role, place, message, signal, score, ("its name", kind))


def _kind(role: Role, signal: Signal) -> str:
    """What besides the name speaks for a role: its unit or its values; '' where nothing does."""
    if role in _STATES:
        return _states(role, signal)
    known = to_si(role, signal.unit or "", 1.0 if role in PER_AXLE else None)
    return "" if known is None else "unit"


def _named(role: Role, words: Sequence[str], around: Sequence[str]) -> int:
    """Points of the names for a role; 0 where they do not fit."""
    own, both = set(words), {*words, *around}
    if own & _OTHERS.get(role, frozenset()) or (role is Role.SPEED_SOURCE and not both & _SPEED):
        return 0
    if role is Role.VEHICLE_SPEED and "".join(words) in _VEHICLE_WHOLE:
        return 3
    if role is Role.VEHICLE_SPEED and both & _WHEEL:
        return 0
    if role in _SINGLE:
        return 2 if own & _SINGLE[role] else 0
    return _two(own, both, *_PAIRS[role])


_PAIRS: Mapping[Role, tuple[set[str], set[str]]] = {
    Role.WHEEL_SPEED: (_SPEED, _WHEEL),
    Role.VEHICLE_SPEED: (_SPEED, _VEHICLE),
    Role.AMBIENT_TEMPERATURE: (_TEMPERATURE, _AMBIENT),
    Role.RAIL_TEMPERATURE: (_TEMPERATURE, _RAIL),
}
"""Words of the quantity and of the thing that has it, by role."""
_SINGLE: Mapping[Role, set[str]] = {
    Role.TRACTIVE_EFFORT: _EFFORT,
    Role.AXLE_LOAD: _LOAD,
    Role.SPEED_SOURCE: _SOURCE,
    Role.HUMIDITY: _HUMIDITY,
    Role.SANDING: _SANDING,
    Role.RAIN: _RAIN,
    Role.GRADIENT: _GRADIENT,
    Role.CURVATURE: _CURVATURE,
    Role.DIRECTION: _DIRECTION,
}
"""Words of roles of which one says all."""
_OTHERS: Mapping[Role, frozenset[str]] = {
    Role.WHEEL_SPEED: frozenset(_VEHICLE - {"act", "ist", "actual", "true"}),
    Role.VEHICLE_SPEED: frozenset(_WHEEL | _SOURCE),
    Role.TRACTIVE_EFFORT: frozenset(_LOAD),
}
"""Words of the signal's own name that make it another quantity."""


def _two(own: set[str], both: set[str], quantity: set[str], thing: set[str]) -> int:
    """Points of a quantity of a thing, where the message may name either."""
    if own & quantity and own & thing:
        return 3
    return 2 if own & (quantity | thing) and both & quantity and both & thing else 0


def _states(role: Role, signal: Signal) -> str:
    """What speaks for a state: a value table that agrees with the contract's values, or one bit."""
    if not signal.choices:
        return "one bit" if role is Role.SANDING and signal.length == 1 else ""
    named = {int(raw): set(_words(str(text))[0]) for raw, text in signal.choices.items()}
    fits = all(named.get(raw, set()) & words for raw, words in _STATES[role].items())
    return "value table" if fits else ""


_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "é": "e", "è": "e"})
_COMPOUNDS = {
    "radsatzdrehzahl": ("radsatz", "drehzahl"),
    "raddrehzahl": ("rad", "drehzahl"),
    "achsdrehzahl": ("achse", "drehzahl"),
    "aussentemperatur": ("aussen", "temperatur"),
    "schienentemperatur": ("schiene", "temperatur"),
    "lufttemperatur": ("luft", "temperatur"),
    "wheelspeed": ("wheel", "speed"),
    "wheelspeeds": ("wheel", "speed"),
    "axlespeed": ("axle", "speed"),
    "axlespeeds": ("axle", "speed"),
    "whlspd": ("whl", "spd"),
    "groundspeed": ("ground", "speed"),
    "vehiclespeed": ("vehicle", "speed"),
}


_PLURALS = {"wheels", "axles", "speeds", "loads", "efforts", "forces"}


def _words(name: str) -> tuple[list[str], int | None]:
    """Words of a name in lower case, and its number; None where it has none, or more than one.

    Of several numbers the one behind a word for an axle counts.
    """
    plain = name.translate(_UMLAUTS)
    plain = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", plain)
    plain = re.sub(r"([A-Z]+)([A-Z][a-z])", r"\1 \2", plain)
    parts = re.findall(r"[a-z]+|[0-9]+", plain.lower())
    words: list[str] = []
    numbers: list[int] = []
    of_axles: list[int] = []
    for part in parts:
        if part.isdigit():
            numbers.append(int(part))
            if words and words[-1] in _WHEEL:
                of_axles.append(int(part))
            continue
        singular = part[:-1] if part in _PLURALS else part
        words.extend(_COMPOUNDS.get(part, (singular,)))
    one = of_axles if len(of_axles) == 1 else numbers
    return words, one[0] if len(one) == 1 else None
