"""What the form of the model may be wrong by at the peak: the same data with another form.

A standard deviation from the scatter of the blocks holds for the form that was fitted. Contacts
computed by others are met by a formula within a tenth of the noise, and their λ_m by a few per cent
only. So the peak is estimated again, beside the same other effects, with the free curve times
friction that falls with creep speed, and with Polach's form; the largest difference counts as one
more standard deviation.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.fit_families import fit_family_curves
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    fit_model,
)
from adhesion_can.physics.burckhardt import SLIP_MAX
from adhesion_can.physics.curves import FAMILIES, Conditions
from adhesion_can.physics.effects import Contact, compute_change, effect_by_id
from adhesion_can.physics.effects.contact_factors import FALLING_FRICTION
from adhesion_can.physics.lag_states import LagStates

FREE, POLACH = FAMILIES["free"], FAMILIES["polach"]
NEARLY_AS_GOOD = 0.1
"""Share by which the whitened RMSE of another form may exceed that of the model to count."""
ITERATIONS = 20
POINTS = 4000
"""Slips between which the peak of a curve with falling friction is looked for."""


class PeakSpread(NamedTuple):
    """Differences of the peak between two forms of the model, relative to the peak.

    Attributes:
        mu_max: Relative difference of μ_max, 1.
        lambda_m: Relative difference of λ_m, 1.

    """

    mu_max: float
    lambda_m: float


NO_SPREAD = PeakSpread(0.0, 0.0)


def fit_other_forms(regression: WhitenedRegression, fitted: FittedModel) -> tuple[Model, ...]:
    """Models with curves of other forms and a model's other effects, where they are about as good.

    Burckhardt's curve without falling friction has passed the comparison of the families, and is
    taken at its word; not by a table of independent points, which may be too few to compare by.

    Args:
        regression: Regression on which the model was fitted.
        fitted: Fitted model.

    """
    model = fitted.model
    falls = any(c.effect.id == FALLING_FRICTION for c in model.candidates)
    points = any(drive.independent for drive in regression.data.drives)
    if model.curves.family is BURCKHARDT and not (falls or points):
        return ()
    limit = (1.0 + NEARLY_AS_GOOD) ** 2 * fitted.grams.square
    as_good = []
    for family in (FREE, POLACH):
        if family is POLACH and model.curves.family is POLACH:
            continue
        other = Model(fit_family_curves(regression.data, family), fixed=model.fixed)
        for candidate, values in model.estimates:
            if candidate.effect.id != FALLING_FRICTION:
                other = other.with_effect(candidate, values)
        if family is FREE and all(drive.has_speed for drive in regression.data.drives):
            friction = Candidate(effect_by_id(FALLING_FRICTION, "polach"))
            typical = tuple(p.typical for p in friction.free_parameters)
            other = other.with_effect(friction, typical)
        refitted = fit_model(regression, other, ITERATIONS)
        if refitted.grams.square <= limit:
            as_good.append(refitted.model)
    return tuple(as_good)


def compare_peaks(
    model: Model, others: Sequence[Model], surface: int, conditions: Conditions
) -> PeakSpread:
    """Largest differences of the peak of one surface to other models, relative to the first's."""
    peak = np.array(find_peak_with_friction(model, surface, conditions))
    differences = [
        np.abs(np.array(find_peak_with_friction(other, surface, conditions)) / peak - 1.0)
        for other in others
    ]
    mu_max, lambda_m = np.max([np.zeros(2), *differences], axis=0).tolist()
    return PeakSpread(mu_max, lambda_m)


def find_peak_with_friction(
    model: Model, surface: int, conditions: Conditions
) -> tuple[float, float]:
    """μ_max and λ_m of a curve times its falling friction, in given conditions."""
    slip = np.geomspace(1e-4, SLIP_MAX, POINTS)
    curve = model.curves.family.adhesion(slip, model.curves.parameters[surface], conditions)
    falling = tuple(
        active for active in model.active_effects if active.effect.id == FALLING_FRICTION
    )
    curve = curve * compute_change(falling, _contact_at(slip, conditions), LagStates()).factor
    top = int(np.argmax(curve))
    return float(curve[top]), float(slip[top])


def _contact_at(slip: Array, conditions: Conditions) -> Contact:
    """Contacts at given slips and one speed and load, without anything else."""
    ones = np.ones_like(slip)
    speed = conditions.speed * ones
    return Contact(
        slip=slip,
        creep_speed=slip * speed,
        speed=speed,
        load=conditions.load * ones,
        time_s=0.0 * ones,
        axle=ones,
        place=ones,
        adhesion=ones,
        covariates={},
    )
