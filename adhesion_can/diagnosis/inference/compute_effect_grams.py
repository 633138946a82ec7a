"""Gram matrices of all candidates of a prepared regression, for a diagnosis of many drives.

The matrices are those of a regression that is linear in the sizes, at size 0. There the curve that
was fitted without the effect has taken a part of it: an effect that takes a quarter off the
adhesion looks a third too large. So each effect with a clear size is also fitted alone beside the
curves, by Gauss-Newton steps about the fitted values until they settle (decision 081).
"""

from dataclasses import replace

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.effect_grams import EffectGrams, EffectKey, SizeEstimate, project_grams
from adhesion_can.diagnosis.inference.candidates import UNTESTABLE_SHARE
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.prepare_regression import PreparedRegression
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    fit_model,
)

CLEAR = 2.0
"""Size in its standard errors from which an effect is fitted: a smaller one is bent by a fraction
of its standard error."""
LARGEST_CORRECTION = 0.05
"""Largest correction of a slip ratio that errors of the speeds explain."""
SETTLED = 1.0
"""Largest step that is left where a fit has settled, in standard errors; it is taken to first
order."""


def compute_effect_grams(prepared: PreparedRegression, rmse: float) -> EffectGrams:
    """Gram matrices of all candidates on all rows of the drives, and the fits of the clear ones.

    Args:
        prepared: Whitened regression with the plain fit and the signatures.
        rmse: RMSE of the adhesion with the plain curves.

    """
    regression = _with_plausible_slips(prepared.regression.all_data)
    columns = regression.build_columns(prepared.plain.model)
    curve = columns.shape[1] - 1
    signatures = np.column_stack(
        [np.empty((len(columns), 0)), *_compute_signatures(regression, prepared)]
    )
    white = regression.whiten(signatures)
    grams = regression.compute_grams(np.column_stack([columns[:, :-1], white, columns[:, -1]]))
    keys = tuple(_key(candidate) for candidate in prepared.candidates)
    projected = project_grams(grams, curve, keys, rmse)
    typical = tuple(candidate.free_parameters[0].typical for candidate in prepared.candidates)
    return replace(
        projected, fits=_estimate_sizes(regression, prepared, projected), typical=typical
    )


def _estimate_sizes(
    regression: WhitenedRegression, prepared: PreparedRegression, grams: EffectGrams
) -> dict[int, SizeEstimate]:
    """Sizes that are not linearised where that matters, by the effect's place."""
    size, std = grams.size, grams.std
    sizes: dict[int, SizeEstimate] = {}
    for place, candidate in enumerate(prepared.candidates):
        value, error = float(size[place]), float(std[place])
        if grams.absorbed[place] >= UNTESTABLE_SHARE or not error > 0.0:
            continue
        if abs(value) < CLEAR * error:
            sizes[place] = SizeEstimate(value, error)
            continue
        fitted = _fit_size(regression, prepared, candidate, value)
        if fitted is not None:
            sizes[place] = fitted
    return sizes


def _with_plausible_slips(regression: WhitenedRegression) -> WhitenedRegression:
    """The regression with the slips as measured where their correction is no error of a speed.

    A residual over a flat slope is taken for a huge error of the slip. Where an effect leaves large
    residuals, corrected slips lie far outside of any curve, and its value there decides everything.
    """
    correction = regression.slip_correction
    plausible = np.abs(correction) <= LARGEST_CORRECTION
    if plausible.all():
        return regression
    return replace(regression, slip_correction=np.where(plausible, correction, 0.0))


def _compute_signatures(
    regression: WhitenedRegression, prepared: PreparedRegression
) -> tuple[Array, ...]:
    """Signatures of all candidates: those of the prepared regression where the slips are its."""
    if regression.slip_correction is prepared.regression.slip_correction:
        return prepared.signatures
    model = prepared.plain.model
    known = regression.evaluate_corrected(model)
    return tuple(
        regression.compute_signature(model, candidate, known=known)
        for candidate in prepared.candidates
    )


def _fit_size(
    regression: WhitenedRegression, prepared: PreparedRegression, candidate: Candidate, size: float
) -> SizeEstimate | None:
    """Size of an effect by the nonlinear fit of it alone, from its size to first order."""
    first = candidate.free_parameters[0]
    start = (float(np.clip(size, first.lower, first.upper)), *candidate.null_values[1:])
    model = prepared.plain.model.with_effect(candidate, start)
    if not np.isfinite(regression.residual(model)).all():
        return None  # the law has no value there
    return _settled_size(fit_model(regression, model), candidate)


def _settled_size(fitted: FittedModel, candidate: Candidate) -> SizeEstimate | None:
    """Size of the only effect of a fitted model; None at the end of its range, or not settled."""
    place, free = fitted.model.first_parameter(0), fitted.free
    value, std = fitted.model.values[0][0], float(np.sqrt(fitted.covariance[place, place]))
    at_bound = not free[place] or candidate.free_parameters[0].is_at_bound(value)
    if at_bound or not (np.isfinite(std) and std > 0.0):
        return None
    total = fitted.grams.total
    step = solve_normal_equations(total[:-1, :-1][np.ix_(free, free)], total[:-1, -1][free])
    left = float(step[int(free[:place].sum())])
    return SizeEstimate(value + left, std) if abs(left) <= SETTLED * std else None


def _key(candidate: Candidate) -> EffectKey:
    size = candidate.free_parameters[0]
    effect = candidate.effect
    return EffectKey(effect.id, effect.form, candidate.axle, size.name, size.unit)
