"""Which effects are at work: every one and every two of them, and a confidence set.

Every candidate is tried, not only the one that looks best first. Models are compared by what they
leave in each block when their parameters come from the other blocks; a further effect is taken only
where its gain is sure and worth having, and what cannot be told from the best stays in the set.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.detect_effects import Detection, detect
from adhesion_can.diagnosis.regression.gram_matrices import solve
from adhesion_can.diagnosis.regression.model import Candidate, Model, evaluate
from adhesion_can.diagnosis.regression.whitened_regression import Fit, Stage, fit

SURE = 0.05
"""Level at which a difference between two models counts."""
WORTH, SECOND_WORTH = 0.01, 0.03
"""Share by which the RMSE of the adhesion must fall for an effect to be worth naming, and for one
beside another: what is left of the first one's form must not get a name."""
WORTH_WHITE = 0.005
"""Share by which the whitened sum of squares must fall besides."""
REFINED, PARTNERED, PARTNERS = 6, 4, 4
"""Effects fitted in full; those of them that get partners; partners of each that are fitted."""
DRIFT = "slow_drift"
REACH = 10.0
"""A first step goes no further than this many chords."""
ALIKE = 0.002
"""Models whose sums of squares differ by a smaller share are not told from each other."""


@dataclass(frozen=True, eq=False)
class Scored:
    """A model with what it leaves.

    Attributes:
        fit: see there.
        rmse: of the adhesion, rows that are not kept back.
        added: p-value of the last effect, by sign flips against the model without it.

    """

    fit: Fit
    rmse: float
    added: float = 1.0

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Its effects."""
        return self.fit.model.candidates

    def candidates_without(self, larger: "Scored") -> tuple[Candidate, ...]:
        """Effects that a larger model has and this one does not; all of this one's are in it."""
        if not set(self.candidates) <= set(larger.candidates):
            return ()
        return tuple(c for c in larger.candidates if c not in self.candidates)

    @property
    def ids(self) -> frozenset[str]:
        """Ids of its effects."""
        return frozenset(candidate.effect.id for candidate in self.candidates)


@dataclass(frozen=True, eq=False)
class Naming:
    """What was named.

    Attributes:
        base: without effects.
        best: the model that is taken; `base` where nothing is worth naming.
        alike: models of the same size that cannot be told from it.
        singles: every effect that was fitted alone, best first.
        detection: of each candidate against the plain model.

    """

    base: Scored
    best: Scored
    alike: tuple[Scored, ...]
    singles: tuple[Scored, ...]
    detection: Detection

    def rivals(self, candidate: Candidate) -> tuple[str, ...]:
        """Ids that can stand in for one of the best model's effects."""
        others = self.best.ids - {candidate.effect.id}
        found = {
            effect
            for other in self.alike
            if others <= other.ids
            for effect in other.ids - others
            if effect != candidate.effect.id
        }
        return tuple(sorted(found))

    def p_value(self, candidate: Candidate, tested: Sequence[Candidate]) -> float:
        """That chance alone makes a named effect look so strong, all effects counted.

        Of several tests the smallest value counts, as often as there are tests: sign flips against
        the plain model and against the one without the effect, and how sure the gain over that one
        is, block by block.
        """
        flips = float(self.detection.p_value[list(tested).index(candidate)])
        less = [
            one
            for one in (self.base, *self.singles)
            if one.candidates_without(self.best) == (candidate,)
        ]
        values = [flips, *(_chance(one.fit, self.best.fit) * len(tested) for one in less)]
        if self.best.candidates[-1] == candidate:
            values.append(self.best.added)
        return min(1.0, len(values) * min(values))


def scored(stage: Stage, found: Fit, added: float = 1.0) -> Scored:
    """A fit with its RMSE."""
    left = evaluate(stage.study, found.model.theta, found.model.actives).residual
    return Scored(found, float(np.sqrt(np.mean(left[stage.used] ** 2))), added)


@dataclass(frozen=True, eq=False)
class Proposal:
    """An effect that could be added, with its size to first order.

    Attributes:
        model: with it.
        gain: share of the whitened sum of squares that it would explain.
        p_value: by sign flips, with all candidates counted.

    """

    model: Model
    gain: float
    p_value: float


def proposals(stage: Stage, model: Model, candidates: Sequence[Candidate]) -> list[Proposal]:
    """Every candidate added to a model, to first order, the most promising first."""
    starts = [(c, start, chord) for c in candidates for start in c.starts for chord in c.chords]
    columns = [stage.signature(model, c, start, chord) for c, start, chord in starts]
    slopes = stage.columns(model)
    ledger = stage.ledger(
        np.column_stack([slopes[:, :-1], stage.white(np.column_stack(columns)), slopes[:, -1]])
    )
    whole, p = ledger.total, slopes.shape[1] - 1
    groups = [[p + i] for i in range(len(starts))]
    flips = detect(ledger, list(range(p)), groups, np.random.default_rng(len(starts)))
    chance = dict.fromkeys(candidates, 1.0)
    for (candidate, _, _), p_value in zip(starts, flips.p_value, strict=True):
        chance[candidate] = min(chance[candidate], float(p_value))
    square = max(float(whole[-1, -1]), 1e-300)
    found: dict[Candidate, Proposal] = {}
    for number, (candidate, start, chord) in enumerate(starts):
        of = [*range(p), p + number]
        right = whole[of, -1]
        answer = solve(whole[np.ix_(of, of)], right)
        size = float(np.clip(answer[-1], candidate.limits[0].lower, candidate.limits[0].upper))
        # A step far beyond the chord leaves the range in which it says anything.
        reach = REACH * chord * abs(candidate.limits[0].typical)
        less = solve(whole[:p, :p], right[:p])
        explained = float(right @ answer - right[:p] @ less) if size * answer[-1] > 0 else 0.0
        proposal = Proposal(
            model.with_effect(candidate, (float(np.clip(size, -reach, reach)), *start[1:])),
            explained / square,
            chance[candidate],
        )
        if candidate not in found or proposal.gain > found[candidate].gain:
            found[candidate] = proposal
    return sorted(found.values(), key=lambda proposal: -proposal.gain)


def name(stage: Stage, base: Fit, candidates: Sequence[Candidate], detection: Detection) -> Naming:
    """Name what is at work among the candidates, two at most.

    Args:
        stage: see there.
        base: the plain model's fit.
        candidates: effects that can be tested.
        detection: of each of them.

    """
    plain = scored(stage, base)
    if not candidates:
        return Naming(plain, plain, (), (), detection)
    first = proposals(stage, base.model, candidates)
    singles = sorted(
        (scored(stage, fit(stage, p.model), p.p_value) for p in first[:REFINED] if p.gain > 0.0),
        key=lambda one: one.fit.square,
    )
    best = plain
    alike: tuple[Scored, ...] = ()
    if singles and _better(plain, singles[0], len(candidates)):
        best = singles[0]
        pairs = _pairs(stage, base.square, singles, candidates)
        if pairs and _better(best, pairs[0], len(candidates)):
            best = pairs[0]
            singles += _members(stage, base, best, singles)
        pool = pairs if len(best.candidates) == 2 else singles
        best = _caused(best, [one for one in pool if not _worse(best, one)])
        best = _simplest(best, [one for one in pool if not _worse(best, one)])
        alike = tuple(one for one in pool if one is not best and not _worse(best, one))
    return Naming(plain, best, alike, tuple(singles), detection)


def _pairs(
    stage: Stage, total: float, singles: Sequence[Scored], candidates: Sequence[Candidate]
) -> list[Scored]:
    """Pairs of effects, best first: the most promising partners of the best singles."""
    wanted: list[tuple[float, Proposal]] = []
    for one in singles[:PARTNERED]:
        others = [c for c in candidates if c.effect.id not in one.ids]
        own = 1.0 - one.fit.square / total
        wanted += [
            (own + proposal.gain * (1.0 - own), proposal)
            for proposal in proposals(stage, one.fit.model, others)[:PARTNERS]
            if proposal.gain > WORTH_WHITE
        ]
    wanted.sort(key=lambda pair: -pair[0])
    chosen: dict[frozenset[str], Proposal] = {}
    for _, proposal in wanted:
        chosen.setdefault(frozenset(c.name for c in proposal.model.candidates), proposal)
    fits = (
        scored(stage, fit(stage, proposal.model), proposal.p_value)
        for proposal in list(chosen.values())[: 2 * PARTNERS]
    )
    return sorted(fits, key=lambda pair: pair.fit.square)


def _members(stage: Stage, base: Fit, best: Scored, singles: Sequence[Scored]) -> list[Scored]:
    """The effects of a pair alone, where they were not fitted alone yet."""
    known = {one.candidates for one in singles}
    alone = [c for c in best.candidates if (c,) not in known]
    if not alone:
        return []
    return [scored(stage, fit(stage, p.model)) for p in proposals(stage, base.model, alone)]


def _better(small: Scored, large: Scored, tried: int) -> bool:
    """Whether a larger model's gain is sure, with so many tried, and worth having."""
    least = SECOND_WORTH if small.candidates else WORTH
    worth = large.rmse < (1.0 - least) * small.rmse
    worth &= large.fit.square < (1.0 - WORTH_WHITE) * small.fit.square
    chance = 2.0 * min(large.added, _chance(small.fit, large.fit) * tried)
    return bool(worth and chance <= SURE)


def _caused(best: Scored, alike: Sequence[Scored]) -> Scored:
    """Of models that cannot be told apart one without a mere drift in time, where there is one.

    What goes with a quantity that was measured is the better explanation of the two.
    """
    if DRIFT not in best.ids:
        return best
    return next((one for one in alike if DRIFT not in one.ids), best)


def _simplest(best: Scored, alike: Sequence[Scored]) -> Scored:
    """Of forms of the same effects that cannot be told apart the one with the fewest numbers."""
    same = [best, *(one for one in alike if one.ids == best.ids)]
    return min(same, key=lambda one: sum(c.size for c in one.candidates))


def _worse(best: Scored, other: Scored) -> bool:
    """Whether another model of the same size leaves more for sure."""
    if other.fit.square <= (1.0 + ALIKE) * best.fit.square:
        return False
    each = other.fit.squares - best.fit.squares
    blocks = len(each)
    if blocks < 2:
        return False
    spread = float(each.std(ddof=1)) / np.sqrt(blocks)
    return bool(each.mean() > scipy.stats.t.ppf(1.0 - SURE, blocks - 1) * spread)


def _chance(small: Fit, large: Fit) -> float:
    """One-sided p-value that a larger model's gain over a smaller one is no gain.

    Of two tests of the gains in the blocks, twice the smaller value: of their mean, which a few
    large ones carry, and of their ranks, which many small ones do.
    """
    each = small.squares - large.squares
    blocks = len(each)
    spread = float(each.std(ddof=1)) / np.sqrt(blocks) if blocks > 1 else 0.0
    if spread == 0.0:
        return 1.0
    by_mean = float(scipy.stats.t.sf(each.mean() / spread, blocks - 1))
    by_rank = float(scipy.stats.wilcoxon(each, alternative="greater").pvalue)
    return min(1.0, 2.0 * min(by_mean, by_rank))


def detection_of(
    stage: Stage,
    base: Fit,
    columns: Sequence[Array],
    rng: np.random.Generator,
) -> tuple[Detection, Array, Array]:
    """Test groups of columns against a fitted model's residual.

    Args:
        stage: see there.
        base: the model that is there; its slopes are the nuisance.
        columns: groups, adhesion, shape (n, size) each.
        rng: for the signs.

    Returns:
        Detection; share of each group's first column that the model imitates, shape (groups,);
        cosines between what is left of the first columns, shape (groups, groups).

    """
    slopes = stage.columns(base.model)
    p = slopes.shape[1] - 1
    ends = np.cumsum([p, *(group.shape[1] for group in columns)])
    groups = [list(range(a, b)) for a, b in pairwise(ends)]
    ledger = stage.ledger(
        np.column_stack([slopes[:, :-1], stage.white(np.column_stack(columns)), slopes[:, -1]])
    )
    nuisance = list(range(p))
    firsts = [group[0] for group in groups]
    weights, total = ledger.weights(nuisance, firsts), ledger.total
    own = weights.T @ total @ weights
    left = np.maximum(own.diagonal(), 0.0)
    whole = np.maximum(total[firsts, firsts], 1e-300)
    size = np.sqrt(np.maximum(left, 1e-12 * whole))
    return detect(ledger, nuisance, groups, rng), 1.0 - left / whole, own / np.outer(size, size)
