"""What a world can hide: kinds by name, drawn forms and the range of their sizes.

An effect by its id; `law:EFFECT` by another law; `pair:a+b` two of them; `null:..` nothing;
`out:..` what no library has; `contact:NAME` a contact that is not Burckhardt's,
`contact:NAME+a` an effect besides; `points:NAME` a table of independent points of such a contact.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from tests.worlds.contact_laws import NAMES
from tests.worlds.hidden import Hidden
from tests.worlds.other_laws import OTHER_LAWS
from tests.worlds.rail import Floats, peak

RANGES: Mapping[str, tuple[float, float]] = {
    "speed_dependence": (0.0, 3.0),
    "load_dependence": (0.0, 1.1e-11),
    "falling_friction": (0.0, 2.0),
    "wheelset_inertia": (-200.0, 3000.0),  # of 25 t on 1.25 m, J / r² below a third of the mass
    "wheel_radius": (-0.05, 0.05),
    "speed_scale": (-0.05, 0.05),
    "speed_delay": (0.0, 1.0),
    "effort_delay": (0.0, 0.5),
    "effort_bias": (-50e3, 50e3),
    "creep_relaxation": (0.0, 10.0),
    "curve_creep": (0.0, 30.0),
    "rail_cleaning": (-0.1, 0.2),
    "adhesion_recovery": (0.0, 1e-5),
    "humidity": (-0.01, 0.01),
    "rail_temperature": (-0.02, 0.02),
    "sanding": (-0.5, 2.0),
    "slow_drift": (-0.004, 0.01),
    "traction_braking_asymmetry": (-0.6, 1.0),
}
"""Lowest and highest size of each effect, in the unit of its first parameter."""
FORMS: Mapping[str, tuple[str, ...]] = {
    "load_dependence": ("burckhardt", "power"),
    "falling_friction": ("burckhardt", "polach"),
}
SINGLES = tuple(RANGES)
NULLS = ("null:0", "null:1", "null:5", "null:surfaces")
OUTSIDE = ("out:periodic", "out:hump", "out:torsion", "out:saturation", "out:table")
PAIRS = tuple(f"pair:{a}+{b}" for a, b in combinations(SINGLES, 2))
CONTACTS = tuple(f"contact:{name}" for name in NAMES)
CONTACT_EFFECTS = tuple(
    f"contact:{name}+{effect}"
    for name in NAMES
    for effect in SINGLES
    if effect != "falling_friction"
)
"""Not falling friction: these contacts have it in themselves."""
POINTS = tuple(f"points:{name}" for name in NAMES)
LAWS = tuple(f"law:{effect}" for effect in OTHER_LAWS)
"""Library effects by laws that are not the library's."""
KINDS = (*SINGLES, *LAWS, *PAIRS, *NULLS, *OUTSIDE, *CONTACTS, *CONTACT_EFFECTS, *POINTS)
CHANNELS = {
    "out:periodic": "position",
    "out:hump": "slip",
    "out:torsion": None,
    "out:saturation": "tractive_effort",
}


@dataclass(frozen=True)
class Draft:
    """An effect whose size is still open.

    Attributes:
        effect: its id.
        form: '' where there is one only.
        name: Name of the parameter that is its size.
        limit: largest size in the direction drawn; its sign is that direction.
        first: size to begin the search with.
        others: the parameters that are drawn already.

    """

    effect: str
    form: str
    name: str
    limit: float
    first: float
    others: Mapping[str, float]

    def sized(self, size: float) -> Hidden:
        """The effect with its size."""
        if self.effect == "out:saturation":
            # The size is the share of the largest effort that is cut off.
            size = self.others["largest"] * (1 - size)
            return Hidden(self.effect, self.form, {self.name: size})
        return Hidden(self.effect, self.form, {self.name: float(size), **self.others})


def is_outside(kind: str) -> bool:
    """Whether `tests.worlds.outside` makes worlds of a kind."""
    return kind.startswith(("outside:", "mech:", "beside:", "null:memory-", "car:"))


def contact_of(kind: str) -> str | None:
    """Name of the contact law of a kind; None: Burckhardt's curve."""
    head, _, rest = kind.partition(":")
    return rest.partition("+")[0] if head in ("contact", "points") else None


def effects_of(kind: str) -> tuple[str, ...]:
    """Ids of what a kind hides besides its contact; none for a null."""
    if kind not in KINDS:
        others = ", ".join(NULLS + OUTSIDE + CONTACTS + POINTS)
        raise ValueError(f"no kind {kind!r}: an effect id, pair:a+b, contact:NAME+a, {others}")
    if contact_of(kind) is not None:
        effect = kind.partition("+")[2]
        return (effect,) if effect else ()
    if kind.startswith("pair:"):
        first, second = kind.removeprefix("pair:").split("+")
        return first, second
    return () if kind.startswith("null:") else (kind.removeprefix("law:"),)


_NAMES = {
    "speed_dependence": "share",
    "speed_delay": "delay",
    "effort_delay": "delay",
    "effort_bias": "bias",
    "creep_relaxation": "length",
    "curve_creep": "lever",
    "humidity": "slope",
    "rail_temperature": "slope",
    "slow_drift": "rate",
    "wheelset_inertia": "error",
    "wheel_radius": "error",
    "speed_scale": "error",
}


def draft(
    rng: np.random.Generator,
    effect: str,
    c: Floats,
    largest_effort: float,
    *,
    by_other_law: bool = False,
) -> Draft:
    """Draw the direction, the form and the other parameters of an effect.

    Args:
        rng: random numbers.
        effect: its id.
        c: the rail's curve, for what is shaped after it.
        largest_effort: Largest effort of the drive, N.
        by_other_law: Whether the law is one of `OTHER_LAWS`.

    """
    if effect.startswith("out:"):
        return _outside(rng, effect, c, largest_effort)
    if by_other_law:
        return _by_other_law(rng, effect)
    form = str(rng.choice(FORMS[effect])) if effect in FORMS else ""
    name, others = _NAMES.get(effect, "gain"), {}
    low, high = RANGES[effect]
    match effect, form:
        case "load_dependence", "burckhardt":
            name = "c5"
        case "load_dependence", _:
            name, (low, high) = "exponent", (-3.0, 3.0)
        case "falling_friction", "burckhardt":
            name = "c4"
        case "falling_friction", _:
            name, high = "B", 3.0
            others = {"A": float(rng.uniform(0.2, 0.6))}
        case "adhesion_recovery", _:
            others = {"time": float(np.exp(rng.uniform(np.log(0.7), np.log(15.0))))}
        case "wheel_radius", _:
            others = {"axle": int(rng.integers(1, 7))}
    limit = low if low < 0 and rng.random() < 0.5 else high
    # Cleaning feeds itself: from a large start the search would not come back.
    start = 0.03 if effect == "adhesion_recovery" else 0.2
    return Draft(effect, form, name, limit, start * limit, others)


def _by_other_law(rng: np.random.Generator, effect: str) -> Draft:
    law = OTHER_LAWS[effect]
    low, high = law.limits
    limit = low if low < 0 and rng.random() < 0.5 else high
    recovers = effect == "adhesion_recovery"
    others = {"time": float(np.exp(rng.uniform(np.log(0.7), np.log(15.0))))} if recovers else {}
    return Draft(effect, law.form, law.name, limit, (0.03 if recovers else 0.2) * limit, others)


def _outside(rng: np.random.Generator, effect: str, c: Floats, largest_effort: float) -> Draft:
    mu_max, lambda_m = peak(c)
    match effect:
        case "out:periodic":
            length, phase = rng.uniform(15, 80), rng.uniform(0, 2 * np.pi)
            others = {"length": float(length), "phase": float(phase)}
            return Draft(effect, "", "amplitude", 0.7, 0.1, others)
        case "out:hump":
            center = min(lambda_m + rng.uniform(0.04, 0.09), 0.19)
            others = {"center": float(center), "width": float(rng.uniform(0.01, 0.022))}
            sign = rng.choice((-1, 1))
            return Draft(effect, "", "height", sign * mu_max, sign * 0.1 * mu_max, others)
        case "out:torsion":
            others = {"frequency": float(rng.uniform(4, 12)), "shift": float(rng.random())}
            return Draft(effect, "", "amplitude", 0.15, 0.02, others)
        case _:
            return Draft(effect, "", "limit", 0.6, 0.15, {"largest": largest_effort})
