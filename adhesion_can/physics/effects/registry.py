"""All effects: the built-in ones, and those of installed distributions.

A built-in effect is a row of `CONTACT_FACTORS`, `COVARIATE_FACTORS` or `INSTRUMENT_ERRORS`; one
that is more than a formula is a file of this folder and a line of `EFFECTS`. A distribution offers
an effect by an entry point of the group 'adhesion_can.effects': an object with the attributes and
the method of `ContactEffect` or `InstrumentEffect`, or its class.
"""

import copyreg
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

from adhesion_can.physics.effects.base import Effect, Observability, Requirements
from adhesion_can.physics.effects.brake_blending import BRAKE_BLENDING, FADING_BRAKE_BLENDING
from adhesion_can.physics.effects.channel_factor import LINEAR, PREFIX, STEP, ChannelFactor
from adhesion_can.physics.effects.contact_factors import CONTACT_FACTORS
from adhesion_can.physics.effects.covariate_factors import COVARIATE_FACTORS
from adhesion_can.physics.effects.creep_relaxation import CreepRelaxation
from adhesion_can.physics.effects.curve_creep import CurveCreep
from adhesion_can.physics.effects.curving_resistance import CURVING_RESISTANCE
from adhesion_can.physics.effects.effort_gain import (
    AXLE_EFFORT_GAIN,
    COMMON_EFFORT_GAIN,
    HEAT_EFFORT_GAIN,
    TIME_EFFORT_GAIN,
)
from adhesion_can.physics.effects.instrument_errors import INSTRUMENT_ERRORS
from adhesion_can.physics.effects.load_transfer import LOAD_TRANSFER, LOAD_TRANSFER_HEIGHTS
from adhesion_can.physics.effects.rows import EffectRow, ErrorEffect, FactorEffect
from adhesion_can.physics.effects.speed_error import (
    CURVATURE_SPEED_ERROR,
    LOW_PASS_SPEED_ERROR,
    OFFSET_SPEED_ERROR,
    PITCH_SPEED_ERROR,
    STEPPED_SPEED_ERROR,
)
from adhesion_can.physics.effects.wheel_once_per_turn import WHEEL_ONCE_PER_TURN
from adhesion_can.physics.parameter import Parameter
from adhesion_can.plugins import Plugin, load_plugins

GROUP = "adhesion_can.effects"
"""Group of the entry points."""

EFFECTS: tuple[Effect, ...] = (
    *INSTRUMENT_ERRORS,
    # Laws of the instruments.
    LOAD_TRANSFER,
    LOAD_TRANSFER_HEIGHTS,
    AXLE_EFFORT_GAIN,
    HEAT_EFFORT_GAIN,
    TIME_EFFORT_GAIN,
    COMMON_EFFORT_GAIN,
    STEPPED_SPEED_ERROR,
    PITCH_SPEED_ERROR,
    OFFSET_SPEED_ERROR,
    CURVATURE_SPEED_ERROR,
    LOW_PASS_SPEED_ERROR,
    CURVING_RESISTANCE,
    BRAKE_BLENDING,
    FADING_BRAKE_BLENDING,
    WHEEL_ONCE_PER_TURN,
    CreepRelaxation(),
    CurveCreep(),
    *CONTACT_FACTORS,
    *COVARIATE_FACTORS,
)
"""The built-in effects; effects that change the slip stand before those that scale the adhesion."""


@cache
def known_effects() -> tuple[Effect, ...]:
    """The built-in effects, then those of installed distributions.

    Two forms of one mechanism share their id.

    Raises:
        PluginError: A distribution offers something that is no effect, or an effect that is there.

    """
    effects = list(EFFECTS)
    for plugin in load_plugins(GROUP):
        effect = plugin.value() if isinstance(plugin.value, type) else plugin.value
        _require_effect(effect, plugin)
        if any((effect.id, effect.form) == (other.id, other.form) for other in effects):
            raise plugin.error(f"an effect {_name(effect.id, effect.form)!r} exists already")
        effects.append(effect)
    return tuple(effects)


def effect_by_id(effect_id: str, form: str = "") -> Effect:
    """The effect of that id, in a form or in its first one; KeyError with the ids that exist."""
    for effect in forms_of_effect(effect_id):
        if form in {"", effect.form}:
            return effect
    known = ", ".join(dict.fromkeys(e.id for e in known_effects()))
    raise KeyError(f"no effect {_name(effect_id, form)!r}; known: {known}")


def forms_of_effect(effect_id: str) -> tuple[Effect, ...]:
    """The effects of that id, first form first; () where there is none."""
    channel = effect_id.removeprefix(PREFIX)
    if channel and effect_id.startswith(PREFIX):
        return ChannelFactor(channel, form=LINEAR), ChannelFactor(channel, form=STEP)
    return tuple(effect for effect in known_effects() if effect.id == effect_id)


def effect_position(effect: Effect) -> int:
    """Place of an effect among all effects, from 0: the order in which effects act."""
    return _positions().get((effect.id, effect.form), len(known_effects()))


@cache
def _positions() -> dict[tuple[str, str], int]:
    return {(effect.id, effect.form): place for place, effect in enumerate(known_effects())}


def _reduce(effect: EffectRow) -> tuple[Callable[..., Any], tuple[Any, ...]]:
    return _restore, (effect.id, effect.form, effect.parameters)


def _restore(effect_id: str, form: str, parameters: tuple[Parameter, ...]) -> Effect:
    effect = effect_by_id(effect_id, form)
    if isinstance(effect, EffectRow) and effect.parameters != parameters:
        return replace(effect, parameters=parameters)
    return effect


# Pickling stores no formula that has no name: the id and the form stand for it.
copyreg.pickle(FactorEffect, _reduce)
copyreg.pickle(ErrorEffect, _reduce)


def _name(effect_id: str, form: str) -> str:
    return f"{effect_id} {form}".strip()


_ATTRIBUTES = {
    "id": str,
    "form": str,
    "title": str,
    "parameters": tuple,
    "literature": str,
    "requires": Requirements,
    "observability": Observability,
}


def _require_effect(effect: object, plugin: Plugin) -> None:
    """PluginError where an object lacks something of an effect."""
    for attribute, kind in _ATTRIBUTES.items():
        if not isinstance(getattr(effect, attribute, None), kind):
            raise plugin.error(f"not an effect: its {attribute!r} is not of type {kind.__name__}")
    if not re.fullmatch(r"[a-z][a-z0-9_]*", str(getattr(effect, "id", ""))):
        raise plugin.error(
            "not an effect: its 'id' must consist of lower case letters, digits and _"
        )
    methods = [callable(getattr(effect, name, None)) for name in ("change", "amend")]
    if methods.count(True) != 1:
        raise plugin.error("not an effect: it needs a method 'change' or 'amend'")
    parameters = getattr(effect, "parameters", ())
    if not parameters or not all(isinstance(p, Parameter) for p in parameters):
        raise plugin.error("not an effect: its 'parameters' must be one Parameter or more")
    size = parameters[0]
    if not size.lower <= 0.0 <= size.upper:
        raise plugin.error(f"not an effect: its size, {size.name!r}, must allow 0")
