"""Units as databases, tables and configurations spell them."""

from collections.abc import Mapping
from unicodedata import normalize

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
"""Other spellings of units, by the one that `role_specs` has."""


def _plain(unit: str) -> str:
    """A unit's letters without case, spaces and signs of powers."""
    plain = normalize("NFKC", unit).casefold().replace("\u2212", "-")
    return "".join(letter for letter in plain if letter not in " ^*·")


_KNOWN_AS = {
    _plain(spelling): unit for unit, others in _SPELLINGS.items() for spelling in (unit, *others)
}


def find_factor(units: Mapping[str, float], unit: str) -> float | None:
    """Factor to SI of a unit as somebody spells it; None where it is unknown.

    Args:
        units: Factor to SI by unit.
        unit: Unit as a database, a table or a configuration spells it: `Km/h`, `U/min`, `min-1`.

    """
    factor = units.get(unit)
    if factor is not None:
        return factor
    plain = _plain(unit)
    by_plain = {_plain(known): factor for known, factor in units.items()}
    if plain in by_plain or plain not in _KNOWN_AS:
        return by_plain.get(plain)
    return units.get(_KNOWN_AS[plain])
