"""Effects with values, and their joint change of contacts and instruments."""

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
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.lag_states import LagStates

MIN_FACTOR = 0.01
"""Smallest factor of effects together: the adhesion never changes its sign."""


@dataclass(frozen=True, slots=True)
class ActiveEffect:
    """An effect with the values of its parameters.

    Attributes:
        effect: Definition of the effect.
        values: Values of its parameters, in their order.

    """

    effect: Effect
    values: tuple[float, ...]


def build_instruments(actives: Iterable[ActiveEffect], given: Instruments = PERFECT) -> Instruments:
    """The instruments with the errors that effects put on them."""
    for active in actives:
        if _acts_on_instruments(active.effect):
            given = active.effect.amend(given, active.values)
    return given


def compute_change(actives: Iterable[ActiveEffect], contact: Contact, lags: LagStates) -> Change:
    """Change by effects together: each is entered with the slip of the one before.

    Args:
        actives: Effects; those of the instruments change nothing here.
        contact: State of the contacts; rows of one axle in the order of time.
        lags: Lagging states, carried from call to call; fresh for a whole drive.

    """
    factor: Array | float | None = None
    for active in actives:
        if acts_in_contact(active.effect):
            change = active.effect.change(contact, active.values, lags)
            if change.slip is not contact.slip:
                contact = replace(contact, slip=change.slip)
            factor = change.factor if factor is None else factor * change.factor
    return Change(contact.slip, 1.0 if factor is None else np.maximum(factor, MIN_FACTOR))


def acts_in_contact(effect: Effect) -> TypeGuard[ContactEffect]:
    """Whether an effect is one in the contact; as `isinstance`, which is slow on protocols."""
    return _has_method(type(effect), "change")


def _acts_on_instruments(effect: Effect) -> TypeGuard[InstrumentEffect]:
    return _has_method(type(effect), "amend")


@cache
def _has_method(kind: type, name: str) -> bool:
    return hasattr(kind, name)
