"""Step 5, select effects: one or two of them, and the models that are indistinguishable from it.

Every effect and every pair of effects is considered, since stepwise forward selection names the
wrong effect where two resemble each other. A further effect is selected only where its gain is
significant and worth it. The models of the same size that a one-sided paired test cannot call worse
than the best one form a confidence set, in the sense of the Model Confidence Set of Hansen, Lunde
and Nason (Econometrica 79 (2011)), in its simplest form: each one is compared with the best alone.
"""

from collections.abc import Sequence
from itertools import takewhile

from adhesion_can.diagnosis.inference.detect_effects import SignFlipTest
from adhesion_can.diagnosis.inference.further_channels import with_further_channels
from adhesion_can.diagnosis.inference.model_comparison import (
    ScoredModel,
    is_improvement,
    is_worse,
    score_model,
)
from adhesion_can.diagnosis.inference.model_selection import ModelSelection
from adhesion_can.diagnosis.inference.race_models import fit_members, fit_pairs, fit_singles
from adhesion_can.diagnosis.regression.prepare_regression import PreparedRegression
from adhesion_can.physics.effects import acts_in_contact
from adhesion_can.physics.effects.channel_factor import PREFIX

MOST_EFFECTS = 2
"""Largest number of effects that are selected."""


def select_effects(
    prepared: PreparedRegression, test: SignFlipTest, most: int = MOST_EFFECTS
) -> ModelSelection:
    """Select the effects that are at work among the candidates, two at most.

    Args:
        prepared: Whitened regression with the plain fit and the candidates.
        test: Sign-flip test of every candidate against the plain model.
        most: Largest number of effects that are selected.

    """
    regression, candidates = prepared.regression, prepared.candidates
    plain = score_model(regression, prepared.plain)
    if not candidates or most < 1:
        return ModelSelection(plain, plain, (), (), test)
    fitted = fit_singles(regression, prepared.plain, candidates)
    singles = [scored for scored in fitted if scored.is_plausible]
    # A size that no vehicle has is no explanation, however well it fits.
    implausible = tuple(
        scored
        for scored in takewhile(lambda scored: not scored.is_plausible, fitted)
        if is_improvement(plain, scored, test.independent)
    )
    # The best in whitened noise may only smooth it, and miss the adhesion as much as before.
    improving = [single for single in singles if is_improvement(plain, single, test.independent)]
    if not improving:
        return ModelSelection(plain, plain, (), tuple(singles), test, implausible=implausible)
    best, pool = improving[0], improving
    fitted_pairs: list[ScoredModel] = []
    if most > 1:
        square = plain.cross_validated_square
        fitted_pairs = fit_pairs(regression, square, fitted, candidates)
    pairs = [pair for pair in fitted_pairs if pair.is_plausible]
    if (
        pairs
        and is_improvement(best, pairs[0], test.independent)
        and not _is_imitation(pairs[0], [*fitted, *fitted_pairs])
    ):
        best, pool = pairs[0], pairs
        singles += fit_members(regression, prepared.plain, best, singles)
    elif _is_imitation(best, fitted):
        return ModelSelection(plain, plain, (), tuple(singles), test, implausible=implausible)
    best = prefer_measured_cause(best, [model for model in pool if not is_worse(best, model)])
    measured = channel_for_drift(best, pool, [plain, *singles])
    drift = () if measured is None else (best,)
    best = measured or best
    best = prefer_fewest_parameters(best, [model for model in pool if not is_worse(best, model)])
    best = prefer_contact(best, pool, plain)
    equal = tuple(
        model for model in pool if model not in (best, *drift) and not is_worse(best, model)
    )
    equal += drift
    selection = ModelSelection(plain, best, equal, tuple(singles), test, implausible=implausible)
    return (
        selection
        if most < MOST_EFFECTS
        else with_further_channels(regression, selection, candidates)
    )


def _is_imitation(best: ScoredModel, fitted: Sequence[ScoredModel]) -> bool:
    """Whether a size that no vehicle has describes the data certainly better.

    What is there is then none of the effects that were tried.
    """
    return any(not scored.is_plausible and is_worse(scored, best) for scored in fitted)


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
    return min(same, key=lambda model: sum(c.size for c in model.candidates))


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
        [best, *twins], key=lambda model: sum(acts_in_contact(c.effect) for c in model.candidates)
    )
