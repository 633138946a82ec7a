"""Effects that the data cannot distinguish from a named one: the same signature, and the same gain.

A paired test over blocks may prefer one of two explanations that differ by a hundredth of what
either of them explains. Errors of the curve's form are larger than that, so such a preference names
nothing: the two are one cause with the other as its rival.
"""

from collections.abc import Iterator

import numpy as np

from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.imitations import imitates_load
from adhesion_can.diagnosis.inference.model_comparison import ScoredModel, fit_and_score
from adhesion_can.diagnosis.inference.propose_effects import propose_effects
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import remove_effect
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from adhesion_can.physics.effects.contact_factors import LOAD_DEPENDENCE
from adhesion_can.physics.effects.effort_gain import EFFORT_GAIN

LEAST_COSINE = 0.95
"""Cosine of two signatures, curves projected out, from which they count as the same."""
EQUAL_GAIN = 0.98
"""Share of what the named effect explains, from which a gain counts as the same."""


def find_equivalent_effects(findings: Findings, candidate: Candidate) -> tuple[str, ...]:
    """Ids of the effects with the signature and the gain of a named one, in alphabetical order.

    Args:
        findings: Findings of steps 2 to 6.
        candidate: Effect of the selected model.

    """
    alike = list(_find_alike(findings, candidate))
    if not alike and candidate.effect.id != LOAD_DEPENDENCE:
        return ()
    regression, best = findings.regression, findings.selection.best
    place = best.candidates.index(candidate)
    smaller = fit_model(regression, remove_effect(best.model, place)[0])
    square = smaller.cross_validated_square
    explained = square - best.cross_validated_square
    fits = (
        fit_and_score(regression, proposal.model)
        for proposal in propose_effects(regression, smaller.model, alike)
    )
    equal = {fit.candidates[-1].effect.id for fit in fits if _is_equal(fit, square, explained)}
    if imitates_load(regression, smaller.model, candidate):
        equal |= {EFFORT_GAIN} - best.ids
    return tuple(sorted(equal))


def _find_alike(findings: Findings, candidate: Candidate) -> Iterator[Candidate]:
    """Candidates with the signature of another one."""
    candidates = findings.prepared.candidates
    if candidate not in candidates:
        return
    known = findings.selection.best.ids
    cosines = np.abs(findings.detection.cosines[candidates.index(candidate)])
    for other, cosine in zip(candidates, cosines.tolist(), strict=True):
        if cosine > LEAST_COSINE and other.effect.id not in known:
            yield other


def _is_equal(scored: ScoredModel, square: float, explained: float) -> bool:
    """Whether a plausible model explains as much as the named effect does."""
    gain = square - scored.cross_validated_square
    return scored.is_plausible and gain >= EQUAL_GAIN * explained
