"""Channels of the user's beside the selected effects, and the effects that they make needless."""

from collections.abc import Sequence
from dataclasses import replace

from adhesion_can.diagnosis.inference.model_comparison import (
    LEAST_WHITENED_GAIN,
    LEVEL,
    ScoredModel,
    fit_and_score,
    gain_p_value,
    is_improvement,
)
from adhesion_can.diagnosis.inference.model_selection import ModelSelection
from adhesion_can.diagnosis.inference.propose_effects import propose_effects
from adhesion_can.diagnosis.inference.race_models import PARTNERS, race
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import remove_effect
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression
from adhesion_can.physics.effects.channel_factor import PREFIX

MOST_CHANNELS = 2
"""Largest number of channels of the user's beside the selected effects."""


def with_further_channels(
    regression: WhitenedRegression, selection: ModelSelection, candidates: Sequence[Candidate]
) -> ModelSelection:
    """The selection with channels of the user's beside its effects.

    What the library knows to act on a vehicle may act beside what a user brought: the two do not
    take each other's place.
    """
    best = selection.best
    for _ in range(MOST_CHANNELS):
        channels = [c for c in candidates if c.effect.id.startswith(PREFIX) and best.admits(c)]
        if not channels or not best.candidates:
            break
        proposals = propose_effects(regression, best.model, channels)[:PARTNERS]
        fits = race(
            regression, [proposal for proposal in proposals if proposal.gain > LEAST_WHITENED_GAIN]
        )
        if not fits or not is_improvement(best, fits[0], selection.test.independent):
            break
        best = fits[0]
    if best is selection.best:
        return selection
    best, smaller = drop_needless(regression, best, selection.test.independent)
    known = selection.all_rivals()
    return replace(selection, best=best, indistinguishable=(), smaller=smaller, known_rivals=known)


def drop_needless(
    regression: WhitenedRegression, best: ScoredModel, tested: float
) -> tuple[ScoredModel, tuple[ScoredModel, ...]]:
    """A model without the effects that gain nothing beside its last one, and those one smaller.

    What a channel explains better is no longer an effect's.

    Args:
        regression: Data with weights, filter and blocks.
        best: Fitted model whose last effect is a channel's.
        tested: Effective number of effects tested.

    """
    smaller = _fit_smaller(regression, best)
    while True:
        last = best.candidates[-1]
        needless = [
            model
            for model in smaller
            if last in model.candidates and gain_p_value(model.fitted, best.fitted) * tested > LEVEL
        ]
        if not needless:
            return best, smaller
        least = min(needless, key=lambda model: model.cross_validated_square)
        # What was tested beside a needless effect holds without it.
        by_signs = best.sign_flips.get(frozenset(best.candidates) - {last}, 1.0)
        best = replace(least, sign_flips={frozenset(least.candidates) - {last}: by_signs})
        smaller = _fit_smaller(regression, best)


def _fit_smaller(regression: WhitenedRegression, best: ScoredModel) -> tuple[ScoredModel, ...]:
    """Models with one effect less."""
    models = (remove_effect(best.model, k)[0] for k in range(len(best.candidates)))
    return tuple(fit_and_score(regression, model) for model in models)
