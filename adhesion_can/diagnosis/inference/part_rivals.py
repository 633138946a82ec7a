"""Which of the rivals is left once all rows of several drives are asked.

A drive that was made to distinguish rivals is short, and a part of it is held out for the gain. The
choice between models of one size needs no rows that were held out: every row of the drives that
decide is used, and a rival that is significantly worse is dropped.
"""

from dataclasses import replace

from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.model_comparison import ScoredModel, fit_and_score, is_worse


def part_rivals(findings: Findings) -> Findings:
    """The findings with the rivals that all rows of all drives leave, the best one selected.

    Args:
        findings: Findings of steps 2 to 6; of a single drive they stay as they are.

    """
    regression, selection = findings.regression, findings.selection
    rivals = (selection.best, *selection.indistinguishable)
    if len(regression.data.drives) < 2 or len(rivals) < 2 or not selection.best.candidates:
        return findings
    everything = regression.last_fit
    fits = [fit_and_score(everything, rival.model) for rival in rivals]
    place = min(range(len(fits)), key=lambda k: fits[k].cross_validated_square)
    left: list[ScoredModel] = [
        one
        for k, (one, fit) in enumerate(zip(rivals, fits, strict=True))
        if k != place and not is_worse(fits[place], fit)
    ]
    # The selected model stays where it is as good: it was preferred for a reason.
    best = selection.best if selection.best in left else rivals[place]
    others = tuple(model for model in (rivals[place], *left) if model is not best)
    return replace(findings, selection=replace(selection, best=best, indistinguishable=others))
