"""Which of the models that describe the data alike is selected."""

from collections.abc import Sequence

from adhesion_can.diagnosis.inference.model_comparison import ScoredModel
from adhesion_can.physics.effects import acts_in_contact
from adhesion_can.physics.effects.channel_factor import PREFIX

DRIFT_SHARE = 0.7
"""Share of what a mere drift explains, from which a channel of the user's takes its place."""
SAME_WORDS = 0.01
"""Difference of what two models explain, relative to it, up to which they are the same."""


def prefer_measured_cause(best: ScoredModel, equal: Sequence[ScoredModel]) -> ScoredModel:
    """Of indistinguishable models one without a mere drift in time, where there is one.

    A dependence on a measured quantity is the better explanation of the two.
    """
    if not best.drifts:
        return best
    return next((model for model in equal if not model.drifts), best)


def channel_for_drift(
    best: ScoredModel, pool: Sequence[ScoredModel], smaller: Sequence[ScoredModel]
) -> ScoredModel | None:
    """The model with a channel of the user's in place of a mere drift; None where none does.

    What varies along with the time is the better explanation of most of a drift, although a drift
    that is smooth where the channel steps may fit better. The drift stays its rival.

    Args:
        best: Selected model.
        pool: Models of the same size, best first.
        smaller: Models with an effect less.

    """
    rest = {c for c in best.candidates if not c.effect.observability.drift}
    without = next((model for model in smaller if set(model.candidates) == rest), None)
    if not best.drifts or without is None:
        return None
    square = without.cross_validated_square
    least = DRIFT_SHARE * (square - best.cross_validated_square)
    for model in pool:
        added = set(model.candidates) - rest
        by_channel = len(added) == 1 and next(iter(added)).effect.id.startswith(PREFIX)
        if by_channel and square - model.cross_validated_square >= least:
            return model
    return None


def prefer_fewest_parameters(best: ScoredModel, equal: Sequence[ScoredModel]) -> ScoredModel:
    """Of indistinguishable forms of the same effects the one with the fewest parameters."""
    same = [best, *(model for model in equal if model.ids == best.ids)]
    return min(same, key=lambda one: sum(c.size for c in one.candidates))


def prefer_contact(
    best: ScoredModel, pool: Sequence[ScoredModel], plain: ScoredModel
) -> ScoredModel:
    """Of models that are the same in other words the one whose effects act in the contact.

    A share of the braking force that is not measured is an asymmetry of the adhesion: which of them
    fits better by a hundredth of what both explain would be chance.
    """
    square = plain.cross_validated_square
    explained = square - best.cross_validated_square
    twins = [
        model
        for model in pool
        if len(model.candidates) == len(best.candidates)
        and square - model.cross_validated_square >= (1.0 - SAME_WORDS) * explained
    ]
    return max(
        [best, *twins], key=lambda one: sum(acts_in_contact(c.effect) for c in one.candidates)
    )
