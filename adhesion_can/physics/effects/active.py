"""Effects with values: what several of them together change."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from adhesion_can.physics.burckhardt import Array
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    ContactEffect,
    Effect,
    InstrumentEffect,
)
from adhesion_can.physics.effects.memory import Memory
from adhesion_can.physics.instruments import PERFECT, Instruments


@dataclass(frozen=True, slots=True)
class ActiveEffect:
    """An effect with the values of its parameters."""

    effect: Effect
    values: tuple[float, ...]


def instruments_of(actives: Iterable[ActiveEffect], given: Instruments = PERFECT) -> Instruments:
    """The instruments with the errors that effects put on them."""
    for active in actives:
        if isinstance(active.effect, InstrumentEffect):
            given = active.effect.amend(given, active.values)
    return given


def change_of(actives: Iterable[ActiveEffect], contact: Contact, memory: Memory) -> Change:
    """What effects in the contact change together: each is entered with the slip of the one before.

    Args:
        actives: effects; those of the instruments change nothing here.
        contact: see there.
        memory: see `ContactEffect.change`.

    """
    factor: Array | float = 1.0
    for active in actives:
        if isinstance(active.effect, ContactEffect):
            change = active.effect.change(contact, active.values, memory)
            contact = replace(contact, slip=change.slip)
            factor = factor * change.factor
    return Change(contact.slip, factor)
