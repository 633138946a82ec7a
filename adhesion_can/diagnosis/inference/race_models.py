"""Race of the most promising models with one effect and with two, fitted in full."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from adhesion_can.diagnosis.inference.model_comparison import (
    LEAST_WHITENED_GAIN,
    ScoredModel,
    fit_and_score,
    score_model,
)
from adhesion_can.diagnosis.inference.propose_effects import EffectProposal, propose_effects
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    fit_model,
)

FITTED_SINGLES, PAIRED_SINGLES, PARTNERS = 6, 4, 4
"""Effects fitted in full; those of them that get partners; partners of each that are fitted."""
FAR_BEHIND = 2.0
"""Sum of squares over the least one so far, beyond which a fit is given up early."""


def fit_singles(
    regression: WhitenedRegression, plain: FittedModel, candidates: Sequence[Candidate]
) -> list[ScoredModel]:
    """Models with one effect, best first: the most promising effects, fitted in full.

    Args:
        regression: Data with weights, filter and blocks.
        plain: Fit without effects.
        candidates: Effects that can be tested.

    """
    proposals = propose_effects(regression, plain.model, candidates)[:FITTED_SINGLES]
    return race(regression, [proposal for proposal in proposals if proposal.gain > 0.0])


def fit_pairs(
    regression: WhitenedRegression,
    plain_square: float,
    singles: Sequence[ScoredModel],
    candidates: Sequence[Candidate],
) -> list[ScoredModel]:
    """Models with two effects, best first: the most promising partners of the best singles.

    Args:
        regression: Data with weights, filter and blocks.
        plain_square: Cross-validated whitened sum of squares without effects.
        singles: Models with one effect, best first.
        candidates: Effects that can be tested.

    """
    ranked: list[tuple[float, EffectProposal]] = []
    for single in singles[:PAIRED_SINGLES]:
        others = [c for c in candidates if single.admits(c)]
        gain_of_single = 1.0 - single.cross_validated_square / plain_square
        ranked += [
            (gain_of_single + proposal.gain * (1.0 - gain_of_single), proposal)
            for proposal in propose_effects(regression, single.model, others)[:PARTNERS]
            if proposal.gain > LEAST_WHITENED_GAIN
        ]
    ranked.sort(key=lambda pair: -pair[0])
    chosen: dict[frozenset[Candidate], EffectProposal] = {}
    # A pair that two singles propose starts from the more promising, and was tested beside both.
    sign_flips: dict[frozenset[Candidate], dict[frozenset[Candidate], float]] = {}
    for _, proposal in ranked:
        pair = frozenset(proposal.model.candidates)
        chosen.setdefault(pair, proposal)
        sign_flips.setdefault(pair, {}).update(proposal.sign_flips)
    fits = race(regression, list(chosen.values())[: 2 * PARTNERS])
    return [replace(fit, sign_flips=sign_flips[frozenset(fit.candidates)]) for fit in fits]


def fit_members(
    regression: WhitenedRegression,
    plain: FittedModel,
    pair: ScoredModel,
    singles: Sequence[ScoredModel],
) -> list[ScoredModel]:
    """Models with one effect of a pair each, where they were not fitted yet.

    Args:
        regression: Data with weights, filter and blocks.
        plain: Fit without effects.
        pair: Model with two effects.
        singles: Models with one effect that were fitted.

    """
    known = {single.candidates for single in singles}
    missing = [c for c in pair.candidates if (c,) not in known]
    if not missing:
        return []
    return [
        fit_and_score(regression, proposal.model)
        for proposal in propose_effects(regression, plain.model, missing)
    ]


def race(regression: WhitenedRegression, proposals: Sequence[EffectProposal]) -> list[ScoredModel]:
    """Proposals fitted in full, best first; one that falls far behind is given up early.

    Args:
        regression: Data with weights, filter and blocks.
        proposals: Effects beside a model, the most promising first.

    """
    fits: list[ScoredModel] = []
    best = inf
    for proposal in proposals:
        fitted = fit_model(regression, proposal.model, hopeless=FAR_BEHIND * best)
        best = min(best, fitted.grams.square)
        fits.append(score_model(regression, fitted, proposal.sign_flips))
    return sorted(fits, key=lambda fit: fit.cross_validated_square)
