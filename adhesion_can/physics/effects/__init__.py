"""Mechanisms beyond the plain curve: one file each, one definition for all uses.

The registry is this tuple; adding an effect is adding a file and a line here.
"""

from adhesion_can.physics.effects.base import Contact, Effect, Parameter
from adhesion_can.physics.effects.falling_friction import FallingFriction
from adhesion_can.physics.effects.load_dependence import LoadDependence

EFFECTS: tuple[Effect, ...] = (FallingFriction(), LoadDependence())

__all__ = ["EFFECTS", "Contact", "Effect", "Parameter", "effect_by_id"]


def effect_by_id(effect_id: str) -> Effect:
    """The effect of that id; KeyError with the ids that exist."""
    for effect in EFFECTS:
        if effect.id == effect_id:
            return effect
    raise KeyError(f"no effect {effect_id!r}; known: {', '.join(e.id for e in EFFECTS)}")
