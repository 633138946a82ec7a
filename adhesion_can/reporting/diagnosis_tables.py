"""Rows of the tables of a diagnosis: causes, curve families and sizes by environment."""

from collections.abc import Sequence

from adhesion_can.diagnosis.cause_result import Cause, EnvironmentSizes
from adhesion_can.diagnosis.formatting import effect_name, fixed, measured, p_text, value_text
from adhesion_can.diagnosis.result import Diagnosis, FamilyResult
from adhesion_can.physics.effects.curve_shape import CURVE_SHAPE
from adhesion_can.result_text import HELD_OUT_RMSE

FAMILY_COLUMNS = (
    "family", "parameters", HELD_OUT_RMSE, "RMSE", "μ_max", "λ_m", "base curve",
)  # fmt: skip
FAMILY_TITLE = "Curve families without effects, fitted to the deciding data"
SHAPE_NOTE = (
    "lambda_m_after and mu_max_after of curve_shape are the peak of the base curve, fitted to all "
    "data together with the other named effects. λ_m and μ_max in this table are those of a family "
    "without any effect. This comparison decides about curve_shape, so Evidence has no row of it."
)
"""What distinguishes the two peaks of a family, where a shape is named."""
ENVIRONMENT_COLUMNS = ("size", "environment", "value", "spread", "p")


def cause_rows(causes: Sequence[Cause]) -> list[tuple[str, ...]]:
    """Cells of a table of causes: effect, parameter, value, meaning; one row a parameter."""
    return [
        (effect_name(c.effect, c.form), v.name, value_text(v), v.meaning)
        for c in causes
        for v in c.parameters
    ]


def family_rows(families: Sequence[FamilyResult]) -> list[tuple[str, ...]]:
    """Cells of a table with `FAMILY_COLUMNS`."""
    return [
        (
            one.title,
            str(one.parameters),
            fixed(one.held_out_rmse, 3),
            fixed(one.rmse, 4),
            fixed(one.mu_max, 4),
            "-" if one.lambda_m is None else fixed(one.lambda_m, 4),
            "yes" if one.chosen else "",
        )
        for one in families
    ]


def environment_rows(environments: Sequence[EnvironmentSizes]) -> list[tuple[str, ...]]:
    """Cells of a table with `ENVIRONMENT_COLUMNS`, one row an environment."""
    return [
        (
            f"{one.effect}: {one.parameter}",
            level.level,
            measured(level.value, level.std, one.unit),
            fixed(100 * one.spread, 0, " %"),
            p_text(one.p_value),
        )
        for one in environments
        for level in one.levels
    ]


def is_shape_named(diagnosis: Diagnosis) -> bool:
    """Whether another base curve than Burckhardt's is a named cause."""
    return any(cause.effect == CURVE_SHAPE for cause in diagnosis.causes)
