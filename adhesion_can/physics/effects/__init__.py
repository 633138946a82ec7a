"""Mechanisms beyond the plain curve: one file each, one definition for all uses.

The registry is this tuple; adding an effect is adding a file and a line here. Two forms of one
mechanism share their id.
"""

from adhesion_can.physics.effects.active import (
    LEAST,
    ActiveEffect,
    acts_in_contact,
    build_instruments,
    compute_change,
)
from adhesion_can.physics.effects.adhesion_recovery import AdhesionRecovery
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    ContactEffect,
    Effect,
    InstrumentEffect,
    Parameter,
)
from adhesion_can.physics.effects.creep_relaxation import CreepRelaxation
from adhesion_can.physics.effects.curve_creep import CurveCreep
from adhesion_can.physics.effects.effort_bias import EffortBias
from adhesion_can.physics.effects.effort_delay import EffortDelay
from adhesion_can.physics.effects.falling_friction import FallingFriction, PolachFriction
from adhesion_can.physics.effects.humidity import Humidity
from adhesion_can.physics.effects.lag_states import LagStates
from adhesion_can.physics.effects.load_dependence import LoadDependence, LoadPower
from adhesion_can.physics.effects.rail_cleaning import RailCleaning
from adhesion_can.physics.effects.rail_temperature import RailTemperature
from adhesion_can.physics.effects.sanding import Sanding
from adhesion_can.physics.effects.slow_drift import SlowDrift
from adhesion_can.physics.effects.speed_delay import SpeedDelay
from adhesion_can.physics.effects.speed_dependence import SpeedDependence
from adhesion_can.physics.effects.speed_scale import SpeedScale
from adhesion_can.physics.effects.traction_braking_asymmetry import TractionBrakingAsymmetry
from adhesion_can.physics.effects.wheel_radius import WheelRadius
from adhesion_can.physics.effects.wheelset_inertia import WheelsetInertia

# What changes the slip stands before what multiplies the adhesion, as it does in the contact.
EFFECTS: tuple[Effect, ...] = (
    WheelsetInertia(),
    WheelRadius(),
    SpeedScale(),
    SpeedDelay(),
    EffortDelay(),
    EffortBias(),
    CreepRelaxation(),
    CurveCreep(),
    SpeedDependence(),
    LoadDependence(),
    LoadPower(),
    FallingFriction(),
    PolachFriction(),
    RailCleaning(),
    AdhesionRecovery(),
    Humidity(),
    RailTemperature(),
    Sanding(),
    SlowDrift(),
    TractionBrakingAsymmetry(),
)

__all__ = [
    "EFFECTS",
    "LEAST",
    "ActiveEffect",
    "Change",
    "Contact",
    "ContactEffect",
    "Effect",
    "InstrumentEffect",
    "LagStates",
    "Parameter",
    "acts_in_contact",
    "compute_change",
    "effect_by_id",
    "build_instruments",
]


def effect_by_id(effect_id: str, form: str = "") -> Effect:
    """The effect of that id, in a form or in its first one; KeyError with the ids that exist."""
    for effect in EFFECTS:
        if effect.id == effect_id and form in {"", effect.form}:
            return effect
    known = ", ".join(dict.fromkeys(e.id for e in EFFECTS))
    wanted = f"{effect_id} {form}".strip()
    raise KeyError(f"no effect {wanted!r}; known: {known}")
