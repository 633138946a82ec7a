"""Mechanisms beyond the plain curve: a row of a table or a file each, one definition for all uses.

`base` has what a definition consists of, `registry` the list of all effects, `active` their joint
change. A distribution with an effect of its own imports from here.
"""

from adhesion_can.physics.effects.active import (
    MIN_FACTOR,
    ActiveEffect,
    acts_in_contact,
    build_instruments,
    compute_change,
)
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    ContactEffect,
    Effect,
    InstrumentEffect,
    Observability,
    Requirements,
    Separation,
)
from adhesion_can.physics.effects.registry import (
    EFFECTS,
    effect_by_id,
    effect_position,
    forms_of_effect,
    known_effects,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

__all__ = [
    "EFFECTS",
    "MIN_FACTOR",
    "ActiveEffect",
    "Change",
    "Contact",
    "ContactEffect",
    "Effect",
    "InstrumentEffect",
    "LagStates",
    "Observability",
    "Parameter",
    "Requirements",
    "Separation",
    "acts_in_contact",
    "build_instruments",
    "compute_change",
    "effect_by_id",
    "effect_position",
    "forms_of_effect",
    "known_effects",
]
