"""Formulas that a user tests as effects, read and held against the data."""

from collections.abc import Iterable

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.regression.model import compute_factor
from adhesion_can.errors import InputError
from adhesion_can.physics.effects import ActiveEffect, build_instruments
from adhesion_can.physics.effects.expression import ExpressionError
from adhesion_can.physics.effects.formula import AnyFormula, Formula, parse_formula


def read_formulas(texts: Iterable[str]) -> tuple[AnyFormula, ...]:
    """Formulas as a user writes them.

    Raises:
        InputError: A formula cannot be read.

    """
    formulas = []
    for text in texts:
        try:
            formulas.append(parse_formula(text))
        except ExpressionError as error:
            fix = (
                "write it as '1 + a * max(wind - b, 0) where a=0.1, b=5', with the size as the "
                "first constant"
            )
            raise InputError(f"formula {text!r}", str(error), fix) from error
    return tuple(formulas)


def require_formula_applies(formula: AnyFormula, drive: DriveData) -> None:
    """Raise where a formula does not apply to a drive.

    Raises:
        InputError: The formula lacks a channel, or nothing switches it off.

    """
    where = f"formula {formula.expression!r}"
    lacking = formula.requires.lacks(drive.covariates)
    lacking = lacking or ("speed" if formula.requires.speed and not drive.has_speed else "")
    lacking = lacking or ("load" if formula.requires.load and not drive.has_load else "")
    all_efforts = formula.requires.all_efforts and drive.kinematics.efforts is None
    lacking = lacking or ("total_effort" if all_efforts else "")
    if lacking:
        there = ", ".join(("slip", *drive.covariates))
        what = f"{drive.name} has no {lacking}"
        raise InputError(
            where, what, f"known there: {there}; also speed and load if they are measured"
        )
    values = (0.0, *(p.typical for p in formula.parameters[1:]))
    factor = _compute_formula(drive, formula, values)
    if not np.isfinite(factor).all():
        what = f"it is not a number in {int((~np.isfinite(factor)).sum())} rows of {drive.name}"
        raise InputError(where, what, "correct the expression, or start from other constants")
    if np.ptp(factor) > 1e-9:
        size = formula.parameters[0].name
        what = f"with {size} = 0 the factor still varies"
        raise InputError(where, what, "name the constant that switches it off first")


def _compute_formula(drive: DriveData, formula: AnyFormula, values: tuple[float, ...]) -> Array:
    """Factor by a formula in the rows of a drive, shape (n,)."""
    active = ActiveEffect(formula, values)
    if isinstance(formula, Formula):
        return compute_factor(drive, active)
    true = drive.observe(build_instruments([active]))
    factor = drive.observe().speed / true.speed * true.force_gain
    return np.asarray(factor)
