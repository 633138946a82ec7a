"""Step 5, select effects: one or two of them, and the models that are indistinguishable from it.

Every effect and every pair of effects is considered, since stepwise forward selection names the
wrong effect where two resemble each other. A further effect is selected only where its gain is
significant and worth it. The models of the same size that a one-sided paired test cannot call worse
than the best one form a confidence set, in the sense of the Model Confidence Set of Hansen, Lunde
and Nason (Econometrica 79 (2011)), in its simplest form: each one is compared with the best alone.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile
from math import inf
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.detect_effects import SignFlipTest, sign_flip_test
from adhesion_can.diagnosis.inference.model_comparison import (
    LEAST_WHITENED_GAIN,
    LEVEL,
    ScoredModel,
    gain_p_value,
    is_improvement,
    is_worse,
    score_model,
)
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.model import Model, remove_effect
from adhesion_can.diagnosis.regression.prepare_regression import PreparedRegression
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    fit_model,
)
from adhesion_can.physics.effects import acts_in_contact
from adhesion_can.physics.effects.channel_factor import PREFIX

MOST_EFFECTS, MOST_CHANNELS = 2, 2
"""Largest number of effects that are selected, and of channels of the user's beside them."""
FITTED_SINGLES, PAIRED_SINGLES, PARTNERS = 6, 4, 4
"""Effects fitted in full; those of them that get partners; partners of each that are fitted."""
FAR_BEHIND = 2.0
"""Sum of squares over the least one so far, beyond which a fit is given up early."""
DRIFT_SHARE = 0.7
"""Share of what a mere drift explains, from which a channel of the user's stands in its place."""
SAME_WORDS = 0.01
"""Difference of what two models explain, relative to it, up to which they are the same."""
MOST_CHORDS = 10.0
"""Largest first step of a size, in chords."""


@dataclass(frozen=True, eq=False)
class ModelSelection:
    """Selected model and its competitors.

    Attributes:
        plain: Model without effects.
        best: Selected model; `plain` where no effect is worth naming.
        indistinguishable: Models of the same size that the data cannot call worse than `best`.
        singles: Models with one effect that were fitted, best first.
        test: Sign-flip test of every candidate against the plain model.
        smaller: Models with one effect less than `best`, where that has more than two.
        implausible: Models with one effect that fitted better than any of `singles`, of a size that
            no vehicle has.
        formulas: Formulas that describe the data as well as an effect of `best`, as text, by its
            id.
        known_rivals: Rivals of effects of `best` that were found before it was extended, by id.
        planned_p_value: P-value of `best` against the explanations that were there before the drive
            that decided, where it is one of them: nothing was searched then. None: it was searched.

    """

    plain: ScoredModel
    best: ScoredModel
    indistinguishable: tuple[ScoredModel, ...]
    singles: tuple[ScoredModel, ...]
    test: SignFlipTest
    smaller: tuple[ScoredModel, ...] = ()
    implausible: tuple[ScoredModel, ...] = ()
    formulas: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    known_rivals: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    planned_p_value: float | None = None

    def rivals(self, candidate: Candidate) -> tuple[str, ...]:
        """Effect ids that can replace one of the best model's effects."""
        others = self.best.ids - {candidate.effect.id}
        found = {
            effect
            for other in self.indistinguishable
            if others <= other.ids
            for effect in other.ids - others
            if effect != candidate.effect.id
        }
        known = set(self.known_rivals.get(candidate.effect.id, ())) - self.best.ids
        return tuple(sorted(found | known))

    def all_rivals(self) -> dict[str, tuple[str, ...]]:
        """Rivals of every effect of the best model, by id."""
        return {one.effect.id: self.rivals(one) for one in self.best.candidates}

    def p_value(self, candidate: Candidate, tested: Sequence[Candidate]) -> float:
        """P-value of a selected effect, all effects counted.

        Of several tests the smallest p-value counts, times the number of tests (Bonferroni): sign
        flips against the plain model and against the model without the effect, and the gain over
        that model, block by block.

        Args:
            candidate: Effect of the best model.
            tested: Effects that were tested.

        """
        if self.planned_p_value is not None:
            return self.planned_p_value
        # A formula was proposed for what the tested effects left.
        by_signs = (
            [float(self.test.p_value[list(tested).index(candidate)])] if candidate in tested else []
        )
        smaller = [
            one
            for one in (self.plain, *self.singles, *self.smaller)
            if one.candidates_missing_from(self.best) == (candidate,)
        ]
        values = [
            *by_signs,
            *(
                gain_p_value(one.fitted, self.best.fitted) * self.test.independent
                for one in smaller
            ),
        ]
        if self.best.candidates[-1] == candidate:
            values.append(self.best.sign_flip_p_value)
        return min(1.0, len(values) * min(values))


@dataclass(frozen=True, eq=False)
class EffectProposal:
    """An effect that could be added to a model, with its linearised size.

    Attributes:
        model: Model with the effect.
        gain: Share of the whitened sum of squares that the effect would explain.
        p_value: P-value by sign flips, all candidates counted.

    """

    model: Model
    gain: float
    p_value: float


class _Start(NamedTuple):
    """A candidate, its start values, and the size of the chord of its signature."""

    candidate: Candidate
    values: tuple[float, ...]
    chord: float


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
    fitted = _fit_singles(regression, prepared.plain, candidates)
    singles = [one for one in fitted if one.is_plausible]
    # A size that no vehicle has is no explanation, however well it fits.
    implausible = tuple(
        one
        for one in takewhile(lambda one: not one.is_plausible, fitted)
        if is_improvement(plain, one, test.independent)
    )
    # The best in whitened noise may only smooth it, and miss the adhesion as much as before.
    improving = [one for one in singles if is_improvement(plain, one, test.independent)]
    if not improving:
        return ModelSelection(plain, plain, (), tuple(singles), test, implausible=implausible)
    best, pool = improving[0], improving
    fitted_pairs: list[ScoredModel] = []
    if most > 1:
        square = plain.fitted.cross_validated_square
        fitted_pairs = _fit_pairs(regression, square, fitted, candidates)
    pairs = [one for one in fitted_pairs if one.is_plausible]
    if (
        pairs
        and is_improvement(best, pairs[0], test.independent)
        and not _is_imitation(pairs[0], [*fitted, *fitted_pairs])
    ):
        best, pool = pairs[0], pairs
        singles += _fit_members(regression, prepared.plain, best, singles)
    elif _is_imitation(best, fitted):
        return ModelSelection(plain, plain, (), tuple(singles), test, implausible=implausible)
    best = _prefer_measured_cause(best, [one for one in pool if not is_worse(best, one)])
    measured = _channel_for_drift(best, pool, [plain, *singles])
    drift = () if measured is None else (best,)
    best = measured or best
    best = _prefer_fewest_parameters(best, [one for one in pool if not is_worse(best, one)])
    best = _prefer_contact(best, pool, plain)
    equal = tuple(one for one in pool if one not in (best, *drift) and not is_worse(best, one))
    equal += drift
    found = ModelSelection(plain, best, equal, tuple(singles), test, implausible=implausible)
    return found if most < MOST_EFFECTS else _with_further_channels(regression, found, candidates)


def _is_imitation(best: ScoredModel, fitted: Sequence[ScoredModel]) -> bool:
    """Whether a size that no vehicle has describes the data certainly better.

    What is there is then none of the effects that were tried.
    """
    return any(not one.is_plausible and is_worse(one, best) for one in fitted)


def _with_further_channels(
    regression: WhitenedRegression, found: ModelSelection, candidates: Sequence[Candidate]
) -> ModelSelection:
    """The selection with channels of the user's beside its effects.

    What the library knows to act on a vehicle may act beside what a user brought: the two do not
    take each other's place.
    """
    best = found.best
    for _ in range(MOST_CHANNELS):
        channels = [c for c in candidates if c.effect.id.startswith(PREFIX) and best.admits(c)]
        if not channels or not best.candidates:
            break
        proposals = propose_effects(regression, best.fitted.model, channels)[:PARTNERS]
        fits = _race(regression, [one for one in proposals if one.gain > LEAST_WHITENED_GAIN])
        if not fits or not is_improvement(best, fits[0], found.test.independent):
            break
        best = fits[0]
    if best is found.best:
        return found
    best, smaller = drop_needless(regression, best, found.test.independent)
    known = found.all_rivals()
    return replace(found, best=best, indistinguishable=(), smaller=smaller, known_rivals=known)


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
            one
            for one in smaller
            if last in one.candidates and gain_p_value(one.fitted, best.fitted) * tested > LEVEL
        ]
        if not needless:
            return best, smaller
        least = min(needless, key=lambda one: one.fitted.cross_validated_square)
        best = replace(least, sign_flip_p_value=best.sign_flip_p_value)
        smaller = _fit_smaller(regression, best)


def _fit_smaller(regression: WhitenedRegression, best: ScoredModel) -> tuple[ScoredModel, ...]:
    """Models with one effect less."""
    models = (remove_effect(best.fitted.model, k)[0] for k in range(len(best.candidates)))
    return tuple(score_model(regression, fit_model(regression, model)) for model in models)


def propose_effects(
    regression: WhitenedRegression, model: Model, candidates: Sequence[Candidate]
) -> list[EffectProposal]:
    """Every candidate added to a model, linearised; the most promising first.

    Args:
        regression: Data with weights, filter and blocks.
        model: Model without the candidates.
        candidates: Effects that could be added.

    """
    starts = [
        _Start(candidate, values, chord)
        for candidate in candidates
        for values in candidate.start_values
        for chord in candidate.chord_sizes
    ]
    known = regression.evaluate_corrected(model)
    signatures = [regression.compute_signature(model, *start, known) for start in starts]
    columns = regression.build_columns(model)
    white = regression.whiten(np.column_stack(signatures))
    grams = regression.compute_grams(np.column_stack([columns[:, :-1], white, columns[:, -1]]))
    p = columns.shape[1] - 1
    groups = [[p + number] for number in range(len(starts))]
    test = sign_flip_test(grams, list(range(p)), groups, np.random.default_rng(len(starts)))
    p_values = dict.fromkeys(candidates, 1.0)
    for start, p_value in zip(starts, test.p_value, strict=True):
        p_values[start.candidate] = min(p_values[start.candidate], float(p_value))
    found: dict[Candidate, EffectProposal] = {}
    for number, start in enumerate(starts):
        places = [*range(p), p + number, -1]
        gram = grams.total[np.ix_(places, places)]
        proposal = _build_proposal(model, start, gram, p_values[start.candidate])
        if start.candidate not in found or proposal.gain > found[start.candidate].gain:
            found[start.candidate] = proposal
    return sorted(found.values(), key=lambda proposal: -proposal.gain)


def _build_proposal(model: Model, start: _Start, gram: Array, p_value: float) -> EffectProposal:
    """Add an effect with its linearised size.

    Args:
        model: Model without the effect.
        start: Effect, its start values and the size of the chord of its signature.
        gram: Gram matrix of the model's Jacobian, the signature and the residual; (p + 2, p + 2).
        p_value: P-value of the effect by sign flips.

    """
    right = np.ascontiguousarray(gram[:-1, -1])
    answer = solve_normal_equations(gram[:-1, :-1], right)
    without = solve_normal_equations(gram[:-2, :-2], right[:-1])
    first = start.candidate.free_parameters[0]
    size = float(np.clip(answer[-1], first.lower, first.upper))
    explained = float(right @ answer - right[:-1] @ without) if size * answer[-1] > 0 else 0.0
    # Far beyond the chord the linearisation no longer holds.
    reach = MOST_CHORDS * start.chord * abs(first.typical)
    size = float(np.clip(size, -reach, reach))
    return EffectProposal(
        model.with_effect(start.candidate, (size, *start.values[1:])),
        explained / max(float(gram[-1, -1]), 1e-300),
        p_value,
    )


def _fit_singles(
    regression: WhitenedRegression, plain: FittedModel, candidates: Sequence[Candidate]
) -> list[ScoredModel]:
    """Models with one effect, best first: the most promising effects, fitted in full."""
    proposals = propose_effects(regression, plain.model, candidates)[:FITTED_SINGLES]
    return _race(regression, [proposal for proposal in proposals if proposal.gain > 0.0])


def _fit_pairs(
    regression: WhitenedRegression,
    plain_square: float,
    singles: Sequence[ScoredModel],
    candidates: Sequence[Candidate],
) -> list[ScoredModel]:
    """Models with two effects, best first: the most promising partners of the best singles."""
    ranked: list[tuple[float, EffectProposal]] = []
    for one in singles[:PAIRED_SINGLES]:
        others = [c for c in candidates if one.admits(c)]
        own = 1.0 - one.fitted.cross_validated_square / plain_square
        ranked += [
            (own + proposal.gain * (1.0 - own), proposal)
            for proposal in propose_effects(regression, one.fitted.model, others)[:PARTNERS]
            if proposal.gain > LEAST_WHITENED_GAIN
        ]
    ranked.sort(key=lambda pair: -pair[0])
    chosen: dict[frozenset[str], EffectProposal] = {}
    for _, proposal in ranked:
        chosen.setdefault(frozenset(c.name for c in proposal.model.candidates), proposal)
    return _race(regression, list(chosen.values())[: 2 * PARTNERS])


def _race(regression: WhitenedRegression, proposals: Sequence[EffectProposal]) -> list[ScoredModel]:
    """Proposals fitted in full, best first; one that falls far behind is given up early."""
    fits: list[ScoredModel] = []
    best = inf
    for proposal in proposals:
        fitted = fit_model(regression, proposal.model, hopeless=FAR_BEHIND * best)
        best = min(best, fitted.grams.square)
        fits.append(score_model(regression, fitted, proposal.p_value))
    return sorted(fits, key=lambda one: one.fitted.cross_validated_square)


def _fit_members(
    regression: WhitenedRegression,
    plain: FittedModel,
    pair: ScoredModel,
    singles: Sequence[ScoredModel],
) -> list[ScoredModel]:
    """Models with one effect of a pair each, where they were not fitted yet."""
    known = {one.candidates for one in singles}
    missing = [c for c in pair.candidates if (c,) not in known]
    if not missing:
        return []
    return [
        score_model(regression, fit_model(regression, proposal.model))
        for proposal in propose_effects(regression, plain.model, missing)
    ]


def _prefer_measured_cause(best: ScoredModel, equal: Sequence[ScoredModel]) -> ScoredModel:
    """Of indistinguishable models one without a mere drift in time, where there is one.

    A dependence on a measured quantity is the better explanation of the two.
    """
    if not best.drifts:
        return best
    return next((one for one in equal if not one.drifts), best)


def _channel_for_drift(
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
    without = next((one for one in smaller if set(one.candidates) == rest), None)
    if not best.drifts or without is None:
        return None
    square = without.fitted.cross_validated_square
    least = DRIFT_SHARE * (square - best.fitted.cross_validated_square)
    for one in pool:
        added = set(one.candidates) - rest
        by_channel = len(added) == 1 and next(iter(added)).effect.id.startswith(PREFIX)
        if by_channel and square - one.fitted.cross_validated_square >= least:
            return one
    return None


def _prefer_fewest_parameters(best: ScoredModel, equal: Sequence[ScoredModel]) -> ScoredModel:
    """Of indistinguishable forms of the same effects the one with the fewest parameters."""
    same = [best, *(one for one in equal if one.ids == best.ids)]
    return min(same, key=lambda one: sum(c.size for c in one.candidates))


def _prefer_contact(
    best: ScoredModel, pool: Sequence[ScoredModel], plain: ScoredModel
) -> ScoredModel:
    """Of models that are the same in other words the one whose effects act in the contact.

    A share of the braking force that is not measured is an asymmetry of the adhesion: which of them
    fits better by a hundredth of what both explain would be chance.
    """
    square = plain.fitted.cross_validated_square
    explained = square - best.fitted.cross_validated_square
    twins = [
        one
        for one in pool
        if len(one.candidates) == len(best.candidates)
        and square - one.fitted.cross_validated_square >= (1.0 - SAME_WORDS) * explained
    ]
    return max(
        [best, *twins], key=lambda one: sum(acts_in_contact(c.effect) for c in one.candidates)
    )
