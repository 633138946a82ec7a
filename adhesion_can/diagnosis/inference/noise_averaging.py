"""Whether a lag or a delay only averages noise of the slip, or is shorter than the signals show.

A lag smooths the slips with which the curve is entered, and a delay interpolates between readings.
Where the curve bends sharply, or is steep, smoothing noisy slips gains by itself. It does so in
either direction of time; what a contact does follows its slip and does not run ahead of it.

A signal says when it was read to half its cycle: what a sender holds, filters and stamps within
that time is not known, and neither is how fast the vehicle speed changed between two readings.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adhesion_can.diagnosis.inference.model_comparison import ScoredModel, fit_and_score
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import remove_effect
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression, fit_model
from adhesion_can.normal_quantiles import NORMAL_95
from adhesion_can.physics.effects import Change, Contact, ContactEffect, LagStates, acts_in_contact

LEAST_DELAY = 0.5
"""Least delay of a signal that is named, in cycles of the slowest one."""
BACKWARD = 0.3
"""Share of a lag's gain from which the same lag backwards in time makes it an average of noise."""


class Reversed:
    """An effect in the contact with time running backwards.

    Args:
        effect: Effect as it is.
        symmetric: Whether it is the mean of both directions: it smooths and is not late.

    """

    def __init__(self, effect: ContactEffect, *, symmetric: bool = False) -> None:
        self.effect, self.symmetric = effect, symmetric
        # By its id it has its place in the order of effects.
        self.id, self.form, self.title = effect.id, effect.form, effect.title
        self.parameters, self.literature = effect.parameters, effect.literature
        self.requires, self.observability = effect.requires, effect.observability

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts, rows of one axle in the order of time."""
        back = replace(
            contact,
            slip=contact.slip[::-1],
            creep_speed=contact.creep_speed[::-1],
            speed=contact.speed[::-1],
            load=contact.load[::-1],
            time_s=-contact.time_s[::-1],
            series_s=-contact.lag_time_s[::-1],
            axle=contact.axle[::-1],
            place=contact.place[::-1],
            adhesion=contact.adhesion[::-1],
            covariates={name: x[::-1] for name, x in contact.covariates.items()},
        )
        change = self.effect.change(back, values, LagStates())
        slip, factor = change.slip[::-1], change.factor
        if isinstance(factor, np.ndarray):
            factor = factor[::-1]
        if self.symmetric:
            slip = 0.5 * (slip + self.effect.change(contact, values, LagStates()).slip)
        return Change(slip, factor)


def averages_noise(
    regression: WhitenedRegression, best: ScoredModel, lags: Sequence[Candidate]
) -> ScoredModel | None:
    """The model without some lags where they gain about as much backwards in time; else None.

    Two lags against each other may smooth without any lag in sum, so they are turned together.

    Args:
        regression: Data with weights, filter and blocks.
        best: Fitted model with the lags.
        lags: Lags and delays among its effects.

    """
    model = best.model
    smaller, backward = model, model
    for lag in lags:
        smaller, _, values = remove_effect(smaller, smaller.candidates.index(lag))
        # Of the same size: a lag whose size is free could run ahead as far as a signal is early.
        backward, _, _ = remove_effect(backward, backward.candidates.index(lag))
        if acts_in_contact(lag.effect):
            turned = replace(lag, effect=Reversed(lag.effect)).active(values)
        else:
            # Between two readings a signal is the mean of both, whichever way it is moved.
            turned = lag.active(tuple(-value for value in values))
        backward = replace(backward, fixed=(*backward.fixed, turned))
    # From where the model stood: a fit of its own may have been given up early.
    without = fit_and_score(regression, smaller)
    squares = (
        without.cross_validated_square,
        best.cross_validated_square,
        fit_model(regression, backward).cross_validated_square,
    )
    before, forward, back = squares
    return without if before - back > BACKWARD * (before - forward) else None


def without_short_delay(
    regression: WhitenedRegression, best: ScoredModel, lags: Sequence[Candidate]
) -> ScoredModel | None:
    """The model without the shortest delay that may be shorter than the signals show; else None.

    One at a time: of two delays that nothing separates both may be short, and one is not.

    Args:
        regression: Data with weights, filter and blocks.
        best: Fitted model with the lags.
        lags: Lags and delays among its effects.

    """
    model = best.model
    std = np.sqrt(best.fitted.covariance.diagonal())
    least = LEAST_DELAY * max(drive.kinematics.cycle_s for drive in regression.data.drives)
    places = [model.candidates.index(lag) for lag in lags if not acts_in_contact(lag.effect)]
    sizes = {place: abs(model.values[place][0]) for place in places}
    short = [
        place
        for place, size in sizes.items()
        if size - NORMAL_95 * std[model.first_parameter(place)] < least
    ]
    if not short:
        return None
    smaller, _, _ = remove_effect(model, min(short, key=lambda place: sizes[place]))
    return fit_and_score(regression, smaller)
