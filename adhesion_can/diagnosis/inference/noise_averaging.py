"""Whether a lag or a delay only averages noise of the slip.

A lag smooths the slips with which the curve is entered, and a delay interpolates between readings.
Where the curve bends sharply, or is steep, smoothing noisy slips gains by itself. It does so in
either direction of time; what a contact does follows its slip and does not run ahead of it.
"""

from dataclasses import dataclass, replace

import numpy as np

from adhesion_can.diagnosis.inference.model_comparison import ScoredModel
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, remove_effect
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression, fit_model
from adhesion_can.physics.effects import (
    Change,
    Contact,
    ContactEffect,
    LagStates,
    Parameter,
    acts_in_contact,
)
from adhesion_can.physics.effects.base import Observability, Requirements

BACKWARD = 0.3
"""Share of a lag's gain from which the same lag backwards in time makes it an average of noise."""


@dataclass(frozen=True, slots=True)
class Reversed:
    """An effect in the contact with time running backwards.

    Attributes:
        effect: Effect as it is.

    """

    effect: ContactEffect

    @property
    def id(self) -> str:
        """Id of the effect: it stands in its place in the order of effects."""
        return self.effect.id

    @property
    def form(self) -> str:
        """Form of the effect."""
        return self.effect.form

    @property
    def title(self) -> str:
        """Title of the effect."""
        return self.effect.title

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the effect."""
        return self.effect.parameters

    @property
    def literature(self) -> str:
        """Reference of the effect."""
        return self.effect.literature

    @property
    def requires(self) -> Requirements:
        """Requirements of the effect."""
        return self.effect.requires

    @property
    def observability(self) -> Observability:
        """How the effect shows."""
        return self.effect.observability

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts, rows of one axle in the order of time."""
        back = replace(
            contact,
            slip=contact.slip[::-1],
            creep_speed=contact.creep_speed[::-1],
            speed=contact.speed[::-1],
            load=contact.load[::-1],
            time_s=-contact.time_s[::-1],
            axle=contact.axle[::-1],
            place=contact.place[::-1],
            adhesion=contact.adhesion[::-1],
            covariates={name: x[::-1] for name, x in contact.covariates.items()},
        )
        found = self.effect.change(back, values, LagStates())
        factor = found.factor
        return Change(found.slip[::-1], factor[::-1] if isinstance(factor, np.ndarray) else factor)


def averages_noise(
    regression: WhitenedRegression, best: ScoredModel, candidate: Candidate, without: ScoredModel
) -> bool:
    """Whether a lag gains about as much backwards in time.

    Args:
        regression: Data with weights, filter and blocks.
        best: Fitted model with the lag.
        candidate: The lag.
        without: Fitted model without it.

    """
    model = best.fitted.model
    place = model.candidates.index(candidate)
    if acts_in_contact(candidate.effect):
        backward = replace(candidate, effect=Reversed(candidate.effect))
        candidates = (*model.candidates[:place], backward, *model.candidates[place + 1 :])
        tried = Model(model.curves, candidates, model.values, model.fixed)
    else:
        # Between two readings a signal is the mean of both, whichever way it is moved.
        smaller, _, values = remove_effect(model, place)
        mirrored = candidate.active(tuple(-value for value in values))
        tried = replace(smaller, fixed=(*smaller.fixed, mirrored))
    fitted = fit_model(regression, tried)
    squares = (one.cross_validated_square for one in (without.fitted, best.fitted, fitted))
    before, forward, back = squares
    return before - back > BACKWARD * (before - forward)
