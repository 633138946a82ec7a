"""Delays that a search did not reach.

The sum of squares has several minima along a delay where slips are swept quickly, and a search that
starts without a delay stops at the first one. The delay found is then too short, or a lag fits
better than it.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from adhesion_can.diagnosis.inference.model_comparison import (
    ScoredModel,
    fit_and_score,
    score_model,
)
from adhesion_can.diagnosis.inference.noise_averaging import Reversed
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, remove_effect
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    fit_model,
)
from adhesion_can.physics.effects import acts_in_contact

DELAY_SCALES = (0.8, 1.0, 1.25)
"""Delays at which curves are fitted, relative to the time of a lag: the two are alike where the
slips change slowly."""
LONGER_SCALES, ANOTHER_MINIMUM = (1.3, 1.6, 2.0), 0.95
"""Delays at which curves are fitted beyond one that was found, relative to it; and the share of its
sum of squares below which one of them is at another minimum."""


def with_delay_for_lag(
    regression: WhitenedRegression, best: ScoredModel, delays: Sequence[Candidate]
) -> ScoredModel | None:
    """The model with a delay in the place of a lag that imitates it; None: the lag stays.

    A delay explains the data better than the lag does, by itself or beside the same smoothing
    without a lag.

    Args:
        regression: Data with weights, filter and blocks.
        best: Fitted model with the lag.
        delays: Delays of signals that could be tested.

    """
    model, square = best.model, best.cross_validated_square
    speed = float(np.median(regression.data.observed("speed")))
    for place, lag in enumerate(model.candidates):
        if not (lag.is_lag and acts_in_contact(lag.effect)):
            continue
        smaller, _, values = remove_effect(model, place)
        smoothing = replace(lag, effect=Reversed(lag.effect, symmetric=True)).active(values)
        smoothed = replace(smaller, fixed=(*smaller.fixed, smoothing))
        fits = [
            fitted
            for delay in delays
            if delay not in model.candidates
            for about_s in (-values[0] / speed, values[0] / speed)
            for fitted in (
                fit_model(regression, smoothed.with_effect(delay, (_in_range(delay, about_s),))),
                _fit_delay(regression, smaller, delay, about_s),
            )
        ]
        fitted = min(fits, key=lambda fit: fit.cross_validated_square, default=None)
        if fitted is not None and fitted.cross_validated_square < square:
            delayed = replace(fitted.model, fixed=smaller.fixed)
            return fit_and_score(regression, delayed)
    return None


def with_longer_delay(regression: WhitenedRegression, best: ScoredModel) -> ScoredModel | None:
    """The model with one of its delays at a better minimum beyond it; None: there is none.

    Args:
        regression: Data with weights, filter and blocks.
        best: Fitted model with the delays.

    """
    model, square = best.model, best.cross_validated_square
    for place, delay in enumerate(model.candidates):
        if not delay.is_lag or acts_in_contact(delay.effect):
            continue
        smaller, _, values = remove_effect(model, place)
        fitted = _fit_delay(regression, smaller, delay, values[0], LONGER_SCALES)
        if fitted.cross_validated_square < ANOTHER_MINIMUM * square:
            return score_model(regression, fitted)
    return None


def _fit_delay(
    regression: WhitenedRegression,
    model: Model,
    delay: Candidate,
    about_s: float,
    scales: Sequence[float] = DELAY_SCALES,
) -> FittedModel:
    """A model with a delay of about a given size, s, in addition.

    With the curves of another delay the search may stop where it starts; so the curves are fitted
    at a few given delays first, none of them beyond what a delay may be.
    """
    given = {_in_range(delay, scale * about_s) for scale in scales}
    profile = {
        by_s: fit_model(regression, replace(model, fixed=(*model.fixed, delay.active((by_s,)))))
        for by_s in sorted(given)
    }
    best = min(profile, key=lambda by_s: profile[by_s].cross_validated_square)
    at_best = replace(profile[best].model, fixed=model.fixed)
    return fit_model(regression, at_best.with_effect(delay, (best,)))


def _in_range(delay: Candidate, about_s: float) -> float:
    """The delay nearest to a given one, s, that is within its range.

    A lag of a length takes seconds where the vehicle creeps, and no signal is as late.
    """
    (size,) = delay.free_parameters
    return float(np.clip(about_s, size.lower, size.upper))
