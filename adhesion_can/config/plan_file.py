"""The file of a driving plan, `plan.toml`: written and read without losing a digit.

purpose = "which of A and B holds"
start_speed = 10.0          # m/s
curve = [0.37, 60.0, 0.26]  # c1, c2, c3 of the expected curve
bandwidth_share = 1.0       # of the creep speed control's
[limits]                    # those that the plan respects, and where each comes from
[[step]]                    # duration_s, mode; slip, period_s, stagger, axles, sand
[[prediction]]              # name, predicts
"""

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from adhesion_can.config.decimal_comma import decimal_commas_named
from adhesion_can.config.toml_tables import (
    array_of_tables,
    load_toml,
    reject_unknown_keys,
    section,
    section_with,
    typed,
)
from adhesion_can.config.toml_text import toml_value
from adhesion_can.errors import ConfigError
from adhesion_can.files import whole_file
from adhesion_can.physics.driving_plan import DrivingPlan, PlanLimits, PlanStep, Prediction

_KEYS = ("purpose", "start_speed", "curve", "bandwidth_share", "limits", "step", "prediction")


def read_plan(path: Path) -> DrivingPlan:
    """Driving plan from a file.

    Raises:
        ConfigError: The file cannot be read, has unknown keys or wrong values, or exceeds its own
            limits.

    """
    with decimal_commas_named(path):
        document, _ = load_toml(path)
    return plan_of(document, path.name)


def plan_of(document: dict[str, Any], where: str) -> DrivingPlan:
    """Driving plan from the content of a file.

    Args:
        document: Tables and values by key.
        where: Name of the file, for errors.

    Raises:
        ConfigError: A key is unknown or missing, a value is wrong, or a step exceeds the limits.

    """
    document = dict(document)
    limits: PlanLimits = section(PlanLimits, document.pop("limits", {}), f"{where}: limits")
    steps = [
        section_with(PlanStep, table, place, ("duration_s", "mode"))
        for table, place in array_of_tables(document.pop("step", []), where, "step")
    ]
    predictions = [
        section_with(Prediction, table, place, ("name", "predicts"))
        for table, place in array_of_tables(document.pop("prediction", []), where, "prediction")
    ]
    reject_unknown_keys(document, where, _KEYS)
    for key in ("start_speed", "curve"):
        if key not in document:
            raise ConfigError(f"{where}: {key}", "missing", "write it before the first table")
    start = typed(document["start_speed"], float, f"{where}: start_speed")
    curve = typed(document["curve"], tuple[float, float, float], f"{where}: curve")
    purpose = typed(document.get("purpose", ""), str, f"{where}: purpose")
    share = typed(document.get("bandwidth_share", 1.0), float, f"{where}: bandwidth_share")
    try:
        return DrivingPlan(tuple(steps), start, curve, limits, purpose, tuple(predictions), share)
    except ValueError as error:
        raise ConfigError(where, str(error), "correct the value") from error


# ------------------------------------------------------------------------------------ writing


def write_plan(plan: DrivingPlan, path: Path, sources: Mapping[str, str] | None = None) -> None:
    """Write a plan where `read_plan` finds it; whole or not at all.

    Args:
        plan: Plan.
        path: File to write.
        sources: Where each limit comes from, by its key: comments of the file.

    Raises:
        InputError: The folder does not exist or cannot be written to.

    """
    with whole_file(path) as file:
        file.write(plan_text(plan, sources))


def plan_text(plan: DrivingPlan, sources: Mapping[str, str] | None = None) -> str:
    """Text of a plan's file, with comments on where its limits come from."""
    lines = [
        "# A driving plan of adhesion-can: for control --plan and simulate --closed-loop --plan.",
        f"purpose = {toml_value(plan.purpose)}",
        f"start_speed = {toml_value(plan.start_speed)}",
        f"curve = {toml_value(plan.curve)}",
        f"bandwidth_share = {toml_value(plan.bandwidth_share)}",
        "",
        "[limits]",
        *_keys(plan.limits, {key: f"  # {text}" for key, text in (sources or {}).items()}),
    ]
    for key, values in (("step", plan.steps), ("prediction", plan.predictions)):
        for value in values:
            lines += ["", f"[[{key}]]", *_keys(value)]
    return "\n".join([*lines, ""])


def _keys(
    value: PlanLimits | PlanStep | Prediction, comments: Mapping[str, str] | None = None
) -> list[str]:
    names = [field.name for field in fields(value)]
    ends = comments or {}
    return [f"{name} = {toml_value(getattr(value, name))}{ends.get(name, '')}" for name in names]
