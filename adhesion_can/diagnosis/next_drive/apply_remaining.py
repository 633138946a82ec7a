"""What a further drive decided holds for the findings on all drives: one rule for all outputs."""

from dataclasses import replace

from adhesion_can.diagnosis.inference.confirm_on_hold_out import (
    ConfirmedFindings,
    confirm_on_hold_out,
)
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.model_comparison import score_model
from adhesion_can.diagnosis.next_drive.remaining import (
    RemainingExplanations,
    effect_keys,
    fit_to_drives,
)
from adhesion_can.diagnosis.refutation.refute import drop_refuted
from adhesion_can.diagnosis.regression.segment_curves import BURCKHARDT


def apply_remaining(
    findings: Findings,
    confirmed: ConfirmedFindings,
    plain_found: Findings,
    remaining: RemainingExplanations | None,
) -> tuple[Findings, ConfirmedFindings]:
    """Findings without what a further drive refuted.

    The explanation that alone is left is named where it holds on the held-out data.

    Args:
        findings: Findings on all drives.
        confirmed: What of them holds on the held-out data.
        plain_found: Findings on all drives with Burckhardt's curve.
        remaining: What the further drive left of the explanations; None: there was none.

    """
    if remaining is None:
        return findings, confirmed
    findings = _drop_refuted_rivals(findings, remaining)
    winner = _select_winner(plain_found, remaining)
    if winner is None or set(winner.selection.best.candidates) == set(confirmed.named):
        return findings, confirmed
    winner = drop_refuted(winner)
    of_winner = confirm_on_hold_out(winner)
    return (winner, of_winner) if of_winner.named else (findings, confirmed)


def _select_winner(findings: Findings, remaining: RemainingExplanations) -> Findings | None:
    """The findings with the explanation that is left selected; None where none is.

    Args:
        findings: Findings on all drives, with Burckhardt's curve.
        remaining: What the drive left of the explanations.

    """
    winner = remaining.winner
    if winner is None or winner.model.curves.family is not BURCKHARDT:
        return None
    regression, selection = findings.regression, findings.selection
    best = score_model(regression, fit_to_drives(regression, findings.prepared, winner.model))
    p_value = remaining.p_value
    return replace(
        findings,
        selection=replace(selection, best=best, indistinguishable=(), planned_p_value=p_value),
    )


def _drop_refuted_rivals(findings: Findings, remaining: RemainingExplanations) -> Findings:
    """The findings without the rivals that a further drive refuted: what refutes is not undone.

    Args:
        findings: Findings on all drives.
        remaining: What the drive left of the explanations.

    """
    selection = findings.selection
    refuted = set(remaining.refuted_effects) - effect_keys(selection.best.candidates)
    left = tuple(
        model
        for model in selection.indistinguishable
        if not refuted & effect_keys(model.candidates)
    )
    # At another axle the same effect may still be a rival.
    ids = {effect for effect, _ in refuted} - {effect for model in left for effect in model.ids}
    known = {
        effect: tuple(rival for rival in rivals if rival not in ids)
        for effect, rivals in selection.known_rivals.items()
    }
    return replace(
        findings, selection=replace(selection, indistinguishable=left, known_rivals=known)
    )
