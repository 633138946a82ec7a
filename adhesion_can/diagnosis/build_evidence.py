"""Evidence of every tested effect, with the comparison that decided about it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan

import numpy as np

from adhesion_can.diagnosis.cause_result import Cause
from adhesion_can.diagnosis.evidence import Decision, EffectEvidence, ModelScore
from adhesion_can.diagnosis.formatting import effect_name
from adhesion_can.diagnosis.inference.candidates import UNTESTABLE_SHARE
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.model_comparison import (
    ScoredModel,
    find_shortfall,
    fit_and_score,
    is_worse,
    worse_p_value,
)
from adhesion_can.diagnosis.regression.candidate import Candidate

PLAIN = "plain curve"
"""Name of the model without effects in a list of scores."""
_COMPARED = (Decision.WORSE, Decision.NOT_BETTER)
"""Decisions by a comparison with the causes."""
_OPEN = (
    *_COMPARED, Decision.RIVAL, Decision.WEAKER, Decision.NOT_NAMED, Decision.NOT_SIGNIFICANT,
)  # fmt: skip
"""Decisions that a further drive overrules: it tested the effect with all drives."""
_FIRST = (Decision.NAMED, Decision.RIVAL)
"""Decisions whose evidence comes first, in this order."""


def build_evidence(
    findings: Findings, causes: Sequence[Cause], refuted: Mapping[tuple[str, int], float]
) -> tuple[EffectEvidence, ...]:
    """Evidence of every tested effect: named ones, their rivals, then by gain.

    Args:
        findings: Findings of steps 2 to 6.
        causes: Named causes.
        refuted: P-value of each effect that a further drive refuted, by its id and axle; NaN where
            no test of the fits did.

    """
    candidates, detection = findings.prepared.candidates, findings.detection
    plain = findings.selection.plain
    fits = _fits_alone(findings)
    out = []
    for place, candidate in enumerate(candidates):
        cosines = np.abs(detection.cosines[place])
        # What the curve imitates leaves round-off, whose cosines mean nothing.
        others = [
            i
            for i, c in enumerate(candidates)
            if c.effect.id != candidate.effect.id and detection.absorbed[i] < UNTESTABLE_SHARE
        ]
        most_similar = int(others[int(np.argmax(cosines[others]))]) if others else place
        fit = fits.get(candidate)
        gain = 50.0 * float(detection.test.gain[place])
        decision, worse = _decide(findings, candidate, place, causes, fit)
        out.append(
            EffectEvidence(
                candidate.effect.id,
                candidate.effect.form,
                candidate.axle,
                float(detection.test.statistic[place]),
                float(detection.test.p_value[place]),
                float(np.clip(detection.absorbed[place], 0.0, 1.0)),
                (candidates[most_similar].effect.id, float(detection.cosines[place, most_similar])),
                gain if fit is None else 100.0 * (1.0 - fit.rmse / plain.rmse),
                decision,
                worse,
                _why_not_named(findings, fit) if decision is Decision.NOT_NAMED else "",
            )
        )
    out = _mark_refuted(_mark_rivals(out, causes), refuted)
    return tuple(sorted(out, key=lambda e: (_rank(e.decision), -e.gain_percent, e.p_value)))


def build_model_scores(
    findings: Findings, evidence: Sequence[EffectEvidence]
) -> tuple[ModelScore, ...]:
    """Held-out scores of the models that were compared, the smallest first.

    Args:
        findings: Findings of steps 2 to 6.
        evidence: Evidence of every tested effect.

    """
    decisions = {(e.effect, e.form, e.axle): e.decision for e in evidence}
    best, plain = findings.selection.best, findings.selection.plain
    scores = [ModelScore(PLAIN, plain.held_out_rmse, None)]
    if best is not plain:
        name = " with ".join(_name(candidate) for candidate in best.candidates)
        selected = [decisions.get(_key(candidate)) for candidate in best.candidates]
        decision = Decision.NAMED if Decision.NAMED in selected else None
        scores.append(ModelScore(name, best.held_out_rmse, decision))
    scores += [
        ModelScore(_name(candidate), fit.held_out_rmse, decisions.get(_key(candidate)))
        for candidate, fit in _fits_alone(findings).items()
        if best.candidates != (candidate,)
    ]
    return tuple(sorted(scores, key=lambda score: score.held_out_rmse))


def _fits_alone(findings: Findings) -> Mapping[Candidate, ScoredModel]:
    """Models with one effect that were fitted, by their effect."""
    selection = findings.selection
    fits = (*selection.singles, *selection.implausible)
    out = {fit.candidates[0]: fit for fit in fits}
    if len(selection.best.candidates) == 1:
        out[selection.best.candidates[0]] = selection.best
    return out


def _decide(
    findings: Findings,
    candidate: Candidate,
    place: int,
    causes: Sequence[Cause],
    fit: ScoredModel | None,
) -> tuple[Decision, float]:
    """The decision about an effect, rivals apart, and the p-value of being worse; NaN for none."""
    best, effect = findings.selection.best, candidate.effect.id
    named = effect in {cause.effect for cause in causes}
    # The first one that holds decided.
    steps = (
        (named and candidate in best.candidates, Decision.NAMED),
        (named, Decision.OTHER_FORM),
        (findings.detection.absorbed[place] >= UNTESTABLE_SHARE, Decision.NOT_TESTED),
        (any(effect == refuted.effect for refuted in findings.refuted), Decision.REFUTED),
        (findings.detection.test.p_value[place] > findings.alpha, Decision.NOT_SIGNIFICANT),
        (fit is None, Decision.WEAKER),
        (fit is not None and not fit.is_plausible, Decision.IMPLAUSIBLE),
        (not causes or not set(best.candidates) - {candidate}, Decision.NOT_NAMED),
    )
    decision = next((decision for holds, decision in steps if holds), None)
    if fit is None or decision is not None:
        return decision or Decision.WEAKER, nan
    return _compare(findings, best, fit)


def _why_not_named(findings: Findings, fit: ScoredModel | None) -> str:
    """The test that an effect failed which was fitted where nothing else was named, a clause."""
    selection = findings.selection
    lacking = (
        "" if fit is None else find_shortfall(selection.plain, fit, selection.test.independent)
    )
    if lacking:
        return lacking
    if findings.oscillates:
        return "oscillation"
    if findings.saturated:
        return "cut-off efforts"
    return "more is left" if not findings.explains else "unconfirmed"


def _compare(findings: Findings, best: ScoredModel, fit: ScoredModel) -> tuple[Decision, float]:
    """Whether an effect alone predicts worse than the causes, and the p-value of that.

    Of several drives all rows are asked, as in the choice between rivals (`part_rivals`).
    """
    regression = findings.regression
    if len(regression.data.drives) > 1:
        rows = regression.last_fit
        best, fit = (fit_and_score(rows, scored.model) for scored in (best, fit))
    decision = Decision.WORSE if is_worse(best, fit) else Decision.NOT_BETTER
    return decision, worse_p_value(best.fitted, fit.fitted)


def _mark_refuted(
    evidence: Sequence[EffectEvidence], refuted: Mapping[tuple[str, int], float]
) -> list[EffectEvidence]:
    """The same with what a further drive refuted as refuted, by the p-value of that test."""
    return [
        replace(
            tested,
            decision=Decision.REFUTED,
            worse_p_value=refuted[tested.effect, tested.axle],
            why="",
        )
        if tested.decision in _OPEN and (tested.effect, tested.axle) in refuted
        else tested
        for tested in evidence
    ]


def _mark_rivals(
    evidence: Sequence[EffectEvidence], causes: Sequence[Cause]
) -> list[EffectEvidence]:
    """The same with the strongest form of each rival as rival, and the others that were fitted."""
    out = list(evidence)
    for rival in {rival for cause in causes for rival in cause.rivals}:
        places = [
            place for place, effect_evidence in enumerate(out) if effect_evidence.effect == rival
        ]
        strongest = max(places, key=lambda k: out[k].gain_percent, default=None)
        for place in places:
            if place == strongest or out[place].decision in _COMPARED:
                out[place] = replace(out[place], decision=Decision.RIVAL, worse_p_value=nan, why="")
    return out


def _rank(decision: Decision) -> int:
    return _FIRST.index(decision) if decision in _FIRST else len(_FIRST)


def _key(candidate: Candidate) -> tuple[str, str, int]:
    return candidate.effect.id, candidate.effect.form, candidate.axle


def _name(candidate: Candidate) -> str:
    return effect_name(*_key(candidate))
