"""Derivatives of the prediction by the parameters of effects, as difference quotients."""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.candidate import CHORD_STEP, Candidate
from adhesion_can.diagnosis.regression.model import (
    EvaluatedModel,
    Model,
    RegressionData,
    evaluate_model,
)
from adhesion_can.physics.effects import acts_in_contact

DELAY_ROWS = 2.0
"""Least step of a delay in a difference quotient, rows. The rate of change of noisy slips between
neighbouring rows is noise, on which Gauss and Newton's steps come to nothing."""
DERIVATIVE_STEP = 0.01
"""Step of a numerical derivative, relative to the parameter's typical size."""


def compute_effect_jacobian(
    data: RegressionData,
    model: Model,
    candidate: Candidate,
    values: tuple[float, ...],
    slip_correction: Array | None = None,
    known: EvaluatedModel | None = None,
) -> Array:
    """Derivatives of the prediction by an effect's parameters, by central differences.

    Args:
        data: Rows of all drives.
        model: Model without the effect.
        candidate: Effect whose parameters are varied.
        values: Values of the candidate's free parameters; a step that leaves the range is
            one-sided.
        slip_correction: Correction added to every measured slip ratio, shape (n,).
        known: Evaluation with the same curves and slip correction.

    Returns:
        Jacobian, adhesion per unit of the parameter; shape (n, size).

    """
    columns = []
    for place, parameter in enumerate(candidate.free_parameters):
        step = parameter.step or DERIVATIVE_STEP * abs(parameter.typical)
        if place == 0 and parameter.unit == "s" and not acts_in_contact(candidate.effect):
            step = max(step, DELAY_ROWS * max(drive.kinematics.cycle_s for drive in data.drives))
        columns.append(
            _difference_quotient(
                data, model, candidate, values, place, step, slip_correction, known
            )
        )
    return np.stack(columns, axis=1)


def compute_signature(
    data: RegressionData,
    model: Model,
    candidate: Candidate,
    start: tuple[float, ...],
    slip_correction: Array | None = None,
    chord: float = CHORD_STEP,
    known: EvaluatedModel | None = None,
) -> Array:
    """Signature of an absent effect: change of the prediction per unit of its size.

    It is a chord and not a derivative, since some effects start flat.

    Args:
        data: Rows of all drives.
        model: Model without the effect.
        candidate: Effect whose signature is computed.
        start: Values of the candidate's free parameters, with size 0.
        slip_correction: Correction added to every measured slip ratio, shape (n,).
        chord: Size of the effect at the chord's end, relative to the typical one.
        known: Evaluation of the model; None: it is made.

    Returns:
        Signature, adhesion per unit of size; shape (n,).

    """
    if known is None:
        known = evaluate_model(data, model.curves, model.active_effects, slip_correction)
    size = candidate.free_parameters[0]
    step = chord * abs(size.typical)
    if size.lower == 0.0 == candidate.lower_bound(size):
        # An effect of size 0 changes nothing: that end is known.
        top = min(step, size.upper)
        effects = model.with_effect(candidate, (top, *start[1:])).active_effects
        moved = evaluate_model(data, model.curves, effects, slip_correction, known)
        return np.asarray((known.residual - moved.residual) / top)
    return _difference_quotient(data, model, candidate, start, 0, step, slip_correction, known)


def _difference_quotient(
    data: RegressionData,
    model: Model,
    candidate: Candidate,
    values: tuple[float, ...],
    place: int,
    step: float,
    slip_correction: Array | None,
    known: EvaluatedModel | None,
) -> Array:
    """Change of −e per unit of one parameter, from a step to either side of it, shape (n,).

    Raises:
        ValueError: The value lies a step or more beyond its range, where both ends are one.

    """
    parameter = candidate.free_parameters[place]
    lower = candidate.lower_bound(parameter)
    ends = []
    for side in (1.0, -1.0):
        value = float(np.clip(values[place] + side * step, lower, parameter.upper))
        moved = (*values[:place], value, *values[place + 1 :])
        effects = model.with_effect(candidate, moved).active_effects
        known = evaluate_model(data, model.curves, effects, slip_correction, known)
        ends.append((value, known.residual))
    (high, above), (low, below) = ends
    if high == low:
        raise ValueError(f"{candidate.name}: {parameter.name} {values[place]:g} is out of range")
    return np.asarray((below - above) / (high - low))
