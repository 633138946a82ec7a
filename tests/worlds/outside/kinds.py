"""Kinds of worlds with mechanisms that no library has, and their nulls.

`outside:NAME` a mechanism; `mech:EFFECT` one of the eight families that a library may have, by
another law; `beside:EFFECT+NAME` a library effect and a mechanism; `null:memory-T` nothing, but the
error of the vehicle's speed has a memory of T seconds.
"""

# Their import is what enters the mechanisms.
from tests.worlds.kinds import SINGLES
from tests.worlds.outside import (
    contact_mechanisms,
    drivetrain_mechanisms,
    instrument_mechanisms,
    second_contact,
    second_drivetrain,
    second_instruments,
    track_mechanisms,
    vehicle_mechanisms,
)
from tests.worlds.outside.families import FAMILIES
from tests.worlds.outside.registry import MECHANISMS, set_aside

__all__ = ["ASIDE", "BESIDE", "MECH", "MEMORY", "OPEN", "OUTSIDE_KINDS", "SECOND"]

assert all((
    contact_mechanisms, drivetrain_mechanisms, instrument_mechanisms, track_mechanisms,
    vehicle_mechanisms, second_contact, second_drivetrain, second_instruments,
))  # fmt: skip

SECOND_NAMES = tuple(name for name, one in MECHANISMS.items() if one.second)
NAMES = tuple(name for name in MECHANISMS if name not in SECOND_NAMES)
"""Of the first set: what is added later does not change which of them are set aside."""
ASIDE_NAMES = set_aside(list(NAMES))
OPEN_NAMES = tuple(name for name in NAMES if name not in ASIDE_NAMES)
OPEN = tuple(f"outside:{name}" for name in OPEN_NAMES)
ASIDE = tuple(f"outside:{name}" for name in ASIDE_NAMES)
SECOND = tuple(f"outside:{name}" for name in SECOND_NAMES)
MECH = tuple(f"mech:{effect}" for effect in FAMILIES)
BESIDE = tuple(
    f"beside:{effect}+{name}"
    for effect in SINGLES
    for name in OPEN_NAMES
    if effect not in MECHANISMS[name].same
)
"""Open mechanisms only: those set aside are looked at once."""
MEMORIES = (0.0, 0.2, 1.0, 10.0)
MEMORY = tuple(f"null:memory-{memory:g}" for memory in MEMORIES)
OUTSIDE_KINDS = (*OPEN, *ASIDE, *SECOND, *MECH, *BESIDE, *MEMORY)
