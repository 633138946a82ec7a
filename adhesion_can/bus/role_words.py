"""Words of names in databases, and the parts of a name; `role_specs` has the words of each role.

Words are in lower case and without umlauts; languages are mixed, as in the databases of trains.
"""

import re
from typing import NamedTuple

WHEEL = {"wheel", "whl", "wheelset", "wheelspeed", "whlspd", "axle", "axl", "ax", "axis",
          "radsatz", "rs", "rad", "achse", "achs", "omega", "essieu", "ess", "roue", "eje", "rueda",
          "asse", "ruota"}  # fmt: skip
ONE_WHEEL = {"wheel", "whl", "rad", "radlast", "roue", "rueda", "ruota"}
"""Words of one wheel, of which an axle has two; a speed of it is that of the axle."""
SPEED = {"speed", "spd", "velocity", "vel", "v", "n", "omega", "w", "drehzahl", "rpm",
          "geschwindigkeit", "geschw", "vitesse", "velocidad", "velocita", "rotspeed", "tacho",
          "whlspd", "wheelspeed"}  # fmt: skip
VEHICLE_WHOLE = {"vehiclespeed", "groundspeed", "trainspeed", "fahrgeschwindigkeit", "vfzg",
                  "vveh", "vist", "vtrain", "zuggeschwindigkeit"}  # fmt: skip
FORCES = {"force", "kraft", "f", "fuerza", "forza"}
"""Words of any force: an effort, and a load where it has no negative values."""
FZ = {"fz"}
"""Word of the vertical force, and of the German 'Zugkraft': the range decides."""
SOURCE = {"source", "src", "quelle"}
AGAINST = {"setpoint", "set", "soll", "demand", "dmd", "req", "request", "target", "max", "min",
            "limit", "lim", "avail", "available", "valid", "validity", "quality", "status", "stat",
            "fault", "err", "error", "std", "raw", "mean", "avg", "average", "filtered", "filt",
            "motor", "mot", "engine", "wind", "fan", "brake", "brk", "bremse", "oil", "cylinder",
            "lateral", "lat", "vertical", "yaw", "enable", "cmd", "command", "reference", "ref",
            "est", "estimated", "test", "sim", "old", "backup", "redundant", "prev", "diff",
            "threshold", "acc", "accel", "acceleration", "offset", "crc", "alive", "counter", "cnt",
            "creep", "slip", "schlupf", "cabin", "innen", "inside", "coolant", "inverter",
            "gearbox", "bearing", "lager", "oel", "display", "anzeige", "trailer", "sum", "total",
            "all", "whole", "angle", "level", "tank", "door", "sollwert", "vorgabe", "anforderung",
            "grenze", "mittel", "mittelwert", "gueltig", "verfuegbar", "fehler", "brems", "roh",
            "consigne", "demande", "limite", "moyen", "moyenne", "defaut", "valide", "validite",
            "etat", "frein", "freinage", "freno", "frenatura", "frenado", "essai", "braking",
            "bremsen", "friction", "possible", "potential", "capability", "verfuegbare", "coupler",
            "coupling", "kupplung", "attelage", "buffer", "puffer", "drawbar", "hook", "spring",
            "feder", "damper", "daempfer", "pantograph", "panto", "actuator", "clamp", "caliper",
            "piston", "kolben", "pedal", "lever", "passenger", "pax", "fahrgast", "payload",
            "zuladung", "empty", "leer", "tare", "tara", "slide", "gleiten", "schleudern",
            "glissement", "patinage", "deviation", "delta", "differenz", "vibration"}  # fmt: skip
"""Words that make a signal another quantity, or another form of it, than the measured one."""
AXLE_MESSAGES = {*WHEEL, "drive", "motor", "mot", "antrieb", "traktion", "traction", "trk"}
"""Words of messages whose number is that of an axle."""
PLAIN = {"act", "ist", "actual", "value", "val", "wert", "mes", "sensor"}
"""Words that say nothing about the quantity."""
GROUPS = {
    "motor": "motor",
    "mot": "motor",
    "moteur": "motor",
    "motore": "motor",
    "bogie": "bogie",
    "bog": "bogie",
    "bg": "bogie",
    "truck": "bogie",
    "drehgestell": "bogie",
    "dg": "bogie",
    "carrello": "bogie",
    "inverter": "inverter",
    "umrichter": "inverter",
}
"""Words of what may drive several axles, and the English one."""
SIDES = {"l", "r", "left", "right", "fl", "fr", "rl", "rr", "links", "rechts"}


_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "é": "e", "è": "e",
                          "ê": "e", "à": "a", "ô": "o", "ç": "c"})  # fmt: skip
_COMPOUNDS = {
    "radgeschwindigkeit": ("rad", "geschwindigkeit"),
    "achsgeschwindigkeit": ("achse", "geschwindigkeit"),
    "drehgestelllast": ("drehgestell", "last"),
    "drehgestellast": ("drehgestell", "last"),
    "motorzugkraft": ("motor", "zugkraft"),
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


_LETTERS = "abcdefgh"
_PLURALS = {"wheels", "axles", "speeds", "loads", "efforts", "forces", "bogies", "motors",
            "essieux", "roues", "charges"}  # fmt: skip


class Words(NamedTuple):
    """A name in parts.

    Attributes:
        words: Words in lower case, without umlauts.
        numbers: Numbers.
        of_axles: Those of the numbers that follow a word for an axle.
        of_bogies: Numbers, or letters as numbers, that follow a word for a bogie.
        letter: Its only single letter from a to h as a number from 1, where it has no number;
            None: it has none.

    """

    words: list[str]
    numbers: list[int]
    of_axles: list[int]
    of_bogies: list[int]
    letter: int | None


def split_words(name: str) -> tuple[list[str], int | None]:
    """Words of a name in lower case, and its number; None where it has none, or more than one.

    Of several numbers the one behind a word for an axle counts.
    """
    parts = split_name(name)
    numbers = parts.of_axles if len(parts.of_axles) == 1 else parts.numbers
    return parts.words, numbers[0] if len(numbers) == 1 else None


def counts_axles(name: str) -> bool:
    """Whether the number of a name follows a word for an axle."""
    return len(split_name(name).of_axles) == 1


def bogie_number(name: str) -> int | None:
    """Number of a bogie in a name; None where it has none, or more than one."""
    numbers = split_name(name).of_bogies
    return numbers[0] if len(numbers) == 1 else None


def split_name(name: str) -> Words:
    """The parts of a name, by capitals, digits and signs."""
    plain = name.translate(_UMLAUTS)
    plain = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", plain)
    plain = re.sub(r"([A-Z]+)([A-Z][a-z])", r"\1 \2", plain)
    words: list[str] = []
    numbers: list[int] = []
    of_axles: list[int] = []
    of_bogies: list[int] = []
    letters: list[int] = []
    for part in re.findall(r"[a-z]+|[0-9]+", plain.lower()):
        before = words[-1] if words else ""
        if part.isdigit():
            numbers.append(int(part))
            if before in WHEEL:
                of_axles.append(int(part))
            if GROUPS.get(before) == "bogie":
                of_bogies.append(int(part))
            continue
        if part in _LETTERS:
            letters.append(1 + _LETTERS.index(part))
            if GROUPS.get(before) == "bogie":
                of_bogies.append(letters[-1])
        singular = part[:-1] if part in _PLURALS else part
        words.extend(_COMPOUNDS.get(part, (singular,)))
    letter = letters[0] if len(letters) == 1 and not numbers else None
    return Words(words, numbers, of_axles, of_bogies, letter)
