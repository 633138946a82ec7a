"""Contacts that are not Burckhardt's: what a diagnosis must say of them, and the peak it gives."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Record = dict[str, Any]

SHAPES = frozenset({"curve_shape", "falling_friction"})
"""Ids that say what such a contact is; in Polach's form both are the same."""
INSTRUMENTS = frozenset(
    {
        "wheelset_inertia",
        "wheel_radius",
        "speed_scale",
        "speed_delay",
        "wheel_speed_delay",
        "effort_delay",
        "effort_bias",
    }
)
"""Errors of a sensor or of the vehicle's data."""
LEAST_EXCESS = 0.10
"""Share by which a misfit must raise the RMSE for a diagnosis to have to name it."""


@dataclass(frozen=True)
class PeakErrors:
    """The peak of an extended model beside the true one.

    Attributes:
        mu_max: Relative error of μ_max; on a plateau of its height.
        lambda_m: Relative error of λ_m; None where the true curve has no peak.
        covered: Whether each 95 % interval that is given holds the truth.

    """

    mu_max: float
    lambda_m: float | None
    covered: tuple[bool, ...]


def contact_outcome(record: Record, diagnosis: Record) -> tuple[str, tuple[str, ...]]:
    """Outcome and answer of a contact that is not Burckhardt's, perhaps with an effect besides.

    'named': the shape, and no other cause but its rivals. With an effect besides 'both', 'one' (the
    effect alone) or 'shape' (the shape alone), whatever else is named. 'nothing below noise': the
    misfit is too small to be asked for.
    """
    causes = diagnosis["causes"]
    names = tuple(cause["effect"] for cause in causes)
    others = record["truth"]["effects"][1:]
    channel = (f"[{diagnosis['channel']}]",) if diagnosis["verdict"] == "unexplained" else ()
    has_shape = any(names_one_of(cause, SHAPES) for cause in causes)
    if others:
        has_effect = any(names_one_of(cause, {others[0]["effect"]}) for cause in causes)
        found = {(True, True): "both", (False, True): "one", (True, False): "shape"}
        outcome = found.get((has_shape, has_effect))
    else:
        excess = record["truth"]["excess"][0]
        outcome = "named" if has_shape and _only_shapes(causes) else None
        if outcome is None and diagnosis["verdict"] == "nothing_found" and excess < LEAST_EXCESS:
            outcome = "nothing below noise"
    if outcome is None:
        outcome = {"named": "wrong", "nothing_found": "nothing"}.get(
            diagnosis["verdict"], "unexplained"
        )
    return outcome, (*names, *channel)


def names_one_of(cause: Record, effects: frozenset[str] | set[str]) -> bool:
    """Whether a cause or one of its rivals is one of the effects."""
    return bool({cause["effect"], *(cause["rivals"] or ())} & effects)


def _only_shapes(causes: Sequence[Record]) -> bool:
    """Whether every cause is the shape, or a rival of a cause that is."""
    rivals = {
        rival for c in causes if c["effect"] in SHAPES for rival in (c["rivals"] or ())
    } | SHAPES
    return all(names_one_of(cause, SHAPES) or cause["effect"] in rivals for cause in causes)


def blames_instrument(record: Record, diagnosis: Record) -> bool:
    """Whether a sensor or the vehicle's data are blamed for what they have not done."""
    hidden = {effect["effect"] for effect in record["truth"]["effects"]}
    # The one finding about a sensor without an effect id: that it cuts its readings off.
    if diagnosis["verdict"] == "unexplained" and diagnosis["channel"] == "tractive_effort":
        return True
    return any(
        cause["effect"] in INSTRUMENTS and not names_one_of(cause, hidden)
        for cause in diagnosis["causes"]
    )


def peak_errors(truth: Record, diagnosis: Record) -> PeakErrors | None:
    """The peak of the extended curve beside the true one; None where one is not known.

    Falling friction moves the peak of the base curve; it is taken at the drive's mean speed, where
    the truth is, with the relative standard deviations of the base curve's peak.
    """
    true, found = truth.get("peak"), diagnosis.get("extended")
    if not true or not found:
        return None
    falling = [c for c in diagnosis["causes"] if c["effect"] == "falling_friction"]
    if falling:
        found = _with_falling_friction(found, falling[0], true["speed"])
    names = ("mu_max", "lambda_m") if true["interior"] else ("mu_max",)
    errors = {name: found[name]["value"] / true[name] - 1 for name in names}
    covered = tuple(
        abs(errors[name]) * true[name] <= 1.96 * found[name]["std"]
        for name in names
        if found[name]["std"] is not None
    )
    return PeakErrors(errors["mu_max"], errors.get("lambda_m"), covered)


def _with_falling_friction(found: Record, cause: Record, speed: float) -> Record:
    """Peak of a base curve times falling friction at a speed, m/s."""
    p = {name: parameter["value"] for name, parameter in cause["parameters"].items()}
    slip = np.geomspace(1e-3, 0.5, 3000)
    c1, c2, c3 = (found[name]["value"] for name in ("c1", "c2", "c3"))
    curve = -c1 * np.expm1(-c2 * slip) - c3 * slip
    if "c4" in p:
        factor = np.exp(-p["c4"] * slip * speed)
    else:
        factor = (1 - p["A"]) * np.exp(-p["B"] * slip * speed) + p["A"]
    at = int(np.argmax(curve * factor))
    moved = {"mu_max": float((curve * factor)[at]), "lambda_m": float(slip[at])}

    def scaled(name: str) -> Record:
        base = found[name]
        std = None if base["std"] is None else base["std"] * moved[name] / base["value"]
        return {"value": moved[name], "std": std}

    return {name: scaled(name) for name in moved}
