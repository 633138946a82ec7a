"""Which effects promise most beside a model: each of them added to it, with a linearised size."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.detect_effects import sign_flip_test
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.gram_matrices import solve_normal_equations
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression

MOST_CHORDS = 10.0
"""Largest first step of a size, in chords."""


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

    @property
    def sign_flips(self) -> Mapping[frozenset[Candidate], float]:
        """The p-value by the effects to which the last one is added."""
        return {frozenset(self.model.candidates[:-1]): self.p_value}


class _Start(NamedTuple):
    """A candidate, its start values, and the size of the chord of its signature."""

    candidate: Candidate
    values: tuple[float, ...]
    chord: float


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
    tried = ((start, regression.compute_signature(model, *start, known)) for start in starts)
    # A user's formula may have no value at some of its starts: it is searched from the others.
    there = [(start, signature) for start, signature in tried if np.isfinite(signature).all()]
    if not there:
        return []
    starts, signatures = (list(column) for column in zip(*there, strict=True))
    columns = regression.build_columns(model)
    white = regression.whiten(np.column_stack(signatures))
    grams = regression.compute_grams(np.column_stack([columns[:, :-1], white, columns[:, -1]]))
    p = columns.shape[1] - 1
    groups = [[p + number] for number in range(len(starts))]
    test = sign_flip_test(grams, list(range(p)), groups, np.random.default_rng(len(starts)))
    p_values = dict.fromkeys(candidates, 1.0)
    for start, p_value in zip(starts, test.p_value, strict=True):
        p_values[start.candidate] = min(p_values[start.candidate], float(p_value))
    proposals: dict[Candidate, EffectProposal] = {}
    for number, start in enumerate(starts):
        places = [*range(p), p + number, -1]
        gram = grams.total[np.ix_(places, places)]
        proposal = _build_proposal(model, start, gram, p_values[start.candidate])
        if start.candidate not in proposals or proposal.gain > proposals[start.candidate].gain:
            proposals[start.candidate] = proposal
    return sorted(proposals.values(), key=lambda proposal: -proposal.gain)


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
