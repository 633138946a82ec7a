"""Effects with values: what several of them together change."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import TypeGuard

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    ContactEffect,
    Effect,
    InstrumentEffect,
)
from adhesion_can.physics.effects.lag_states import LagStates
from adhesion_can.physics.instruments import PERFECT, Instruments

LEAST = 0.01
"""Factor below which effects do not take adhesion together: a rail does not drive the wheel."""


@dataclass(frozen=True, slots=True)
class ActiveEffect:
    """An effect with the values of its parameters."""

    effect: Effect
    values: tuple[float, ...]


def build_instruments(actives: Iterable[ActiveEffect], given: Instruments = PERFECT) -> Instruments:
    """The instruments with the errors that effects put on them."""
    for active in actives:
        if isinstance(active.effect, InstrumentEffect):
            given = active.effect.amend(given, active.values)
    return given


def compute_change(actives: Iterable[ActiveEffect], contact: Contact, lags: LagStates) -> Change:
    """What effects in the contact change together: each is entered with the slip of the one before.

    Args:
        actives: effects; those of the instruments change nothing here.
        contact: see there.
        memory: see `ContactEffect.change`.

    """
    factor: Array | float | None = None
    for active in actives:
        if acts_in_contact(active.effect):
            change = active.effect.change(contact, active.values, lags)
            if change.slip is not contact.slip:
                contact = replace(contact, slip=change.slip)
            factor = change.factor if factor is None else factor * change.factor
    return Change(contact.slip, 1.0 if factor is None else np.maximum(factor, LEAST))


def acts_in_contact(effect: Effect) -> TypeGuard[ContactEffect]:
    """Whether an effect is one in the contact; as `isinstance`, which is slow on protocols."""
    return _has_change(type(effect))


@cache
def _has_change(kind: type) -> bool:
    return hasattr(kind, "change")
