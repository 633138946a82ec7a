"""`--effect`: an effect by name, with its size and its other parameters."""

from collections.abc import Iterable
from math import isfinite

import numpy as np

from adhesion_can.errors import InputError
from adhesion_can.physics.effects import (
    MIN_FACTOR,
    ActiveEffect,
    Contact,
    Effect,
    LagStates,
    Parameter,
    compute_change,
    effect_by_id,
    known_effects,
)
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.surroundings import DEFAULT_CONDITIONS

SYNTAX = "NAME[:FORM][=SIZE[,PARAMETER=VALUE]..]"


def effects_help() -> str:
    """Every effect with its parameters, a line each, for the help of a command."""
    return "\n".join(f"  {_full_name(e):28}{_describe(e)}" for e in known_effects())


def parse_effects(texts: Iterable[str], vehicle: Locomotive) -> tuple[ActiveEffect, ...]:
    """Effects from the texts of `--effect`.

    Args:
        texts: Argument of each use of the option.
        vehicle: Configured vehicle, on which the effects act.

    Raises:
        InputError: An unknown name, a value that makes no sense, an effect given twice, or one
            that requires a channel which is not simulated.

    """
    actives: list[ActiveEffect] = []
    for text in texts:
        active = _parse(text, vehicle)
        if any(_is_same(active, other) for other in actives):
            raise InputError(
                f"--effect {text}", "the same effect is given twice", "give one size for it"
            )
        actives.append(active)
    return tuple(actives)


def _parse(text: str, vehicle: Locomotive) -> ActiveEffect:
    where = f"--effect {text}"
    name, given, rest = text.partition("=")
    effect = _find_effect(name, where)
    first, *others = effect.parameters
    values = {p.name: p.typical for p in effect.parameters}
    size, *pairs = rest.split(",")
    if given:
        values[first.name] = _parse_number(size, first, where)
    for pair in pairs:
        key, _, number = pair.partition("=")
        named = next((p for p in others if p.name == key.strip()), None)
        if named is None:
            known = ", ".join(p.name for p in others) or "it has none except the size"
            raise InputError(where, f"no parameter {key.strip()!r}", f"known: {known}")
        values[named.name] = _parse_number(number, named, where, vehicle.axles)
    active = ActiveEffect(effect, tuple(values.values()))
    _require_some_adhesion(active, vehicle, where)
    return active


def _find_effect(name: str, where: str) -> Effect:
    effect_id, _, form = name.partition(":")
    forms = [e.form for e in known_effects() if e.id == effect_id]
    if not forms:
        known = ", ".join(dict.fromkeys(e.id for e in known_effects()))
        raise InputError(where, f"no effect {effect_id!r}", f"known: {known}")
    try:
        return effect_by_id(effect_id, form)
    except KeyError as error:
        known = ", ".join(form for form in forms if form) or "it has only one form; remove this"
        raise InputError(where, f"no form {form!r}", f"known: {known}") from error


def _parse_number(text: str, parameter: Parameter, where: str, axles: int = 0) -> float:
    upper = float(axles) if parameter.axle else parameter.upper
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    try:
        value = float(text)
    except ValueError as error:
        fix = f"give {parameter.name}, {parameter.lower:g} to {upper:g}{unit}"
        raise InputError(where, f"{text!r} is not a number", fix) from error
    if not (isfinite(value) and parameter.lower <= value <= upper):
        raise InputError(
            where,
            f"{parameter.name} out of range",
            f"give {parameter.lower:g} to {upper:g}{unit}",
        )
    if parameter.axle and value != round(value):
        raise InputError(where, f"{text} is not an axle", f"give 1 to {axles}")
    return value


def _require_some_adhesion(active: ActiveEffect, vehicle: Locomotive, where: str) -> None:
    """Raise an InputError where nothing of the adhesion is left in calm surroundings."""
    covariates = DEFAULT_CONDITIONS.covariates(gradient=0.0)
    lacking = active.effect.requires.lacks(covariates)
    if lacking:
        what = f"{active.effect.id} needs {lacking}, which is not simulated"
        raise InputError(where, what, "take another effect")
    loads = np.array(vehicle.axle_load)
    axle = np.arange(1.0, vehicle.axles + 1)

    def every(value: float) -> np.ndarray:
        return np.full(vehicle.axles, value)

    common = Contact(
        slip=every(0.02),
        creep_speed=every(0.2),
        speed=every(10.0),
        load=loads,
        time_s=every(0.0),
        axle=axle,
        place=axle,
        adhesion=every(0.2),
        covariates={name: every(value) for name, value in covariates.items()},
    )
    if np.min(compute_change([active], common, LagStates()).factor) <= MIN_FACTOR:
        raise InputError(where, "leaves no adhesion on a common surface", "give a smaller size")


def _is_same(active: ActiveEffect, other: ActiveEffect) -> bool:
    """Whether two are one effect; of another axle, or in another form, they are two."""
    if (active.effect.id, active.effect.form) != (other.effect.id, other.effect.form):
        return False
    places = [k for k, p in enumerate(active.effect.parameters) if p.axle]
    return all(active.values[k] == other.values[k] for k in places)


def _full_name(effect: Effect) -> str:
    return f"{effect.id}:{effect.form}" if effect.form else effect.id


def _describe(effect: Effect) -> str:
    return "; ".join(
        f"{p.name}: {p.meaning}" + ("" if p.unit == "1" else f", {p.unit}") + f" ({p.typical:g})"
        for p in effect.parameters
    )
