"""Tables of the evidence for effects and channels: what was tested, and what decided."""

from collections.abc import Sequence
from math import isfinite

from adhesion_can.diagnosis.evidence import DECISIONS, ChannelEvidence, Evidence
from adhesion_can.diagnosis.formatting import effect_name, fixed, p_equation, p_text, unit_text
from adhesion_can.physics.channels import channel_label
from adhesion_can.plurals import counted

EVIDENCE_COLUMNS = (
    "effect", "statistic", "p", "absorbed", "most alike", "cosine", "gain", "decision",
)  # fmt: skip
CHANNEL_COLUMNS = ("channel", "unit", "p", "gain")


def evidence_rows(evidence: Sequence[Evidence]) -> list[tuple[str, ...]]:
    """Cells of a table with `EVIDENCE_COLUMNS`."""
    return [
        (
            effect_name(e.effect, e.form, e.axle),
            fixed(e.statistic, 2),
            p_text(e.p_value),
            fixed(100 * e.absorbed, 0, " %"),
            e.most_alike[0] or "-",
            fixed(e.most_alike[1], 2) if e.most_alike[0] else "-",
            fixed(e.gain_percent, 1, " %"),
            _decision(e),
        )
        for e in evidence
        if e.is_tested
    ]


def _decision(evidence: Evidence) -> str:
    if not isfinite(evidence.worse_p_value):
        return evidence.decision.value
    return f"{evidence.decision.value}, {p_equation(evidence.worse_p_value)}"


def evidence_title(evidence: Sequence[Evidence]) -> str:
    """What a table of evidence holds: how many tests of how many effects."""
    tested = [one for one in evidence if one.is_tested]
    effects = len({one.effect for one in tested})
    return (
        f"{counted(len(tested), 'test')} of {counted(effects, 'effect')}: each form of an effect, "
        "and each axle, has a test of its own"
    )


def decision_note(evidence: Sequence[Evidence]) -> str:
    """Meaning of the decisions that a table of evidence holds."""
    there = {one.decision for one in evidence if one.is_tested}
    meanings = [f"{one.value}: {text}" for one, text in DECISIONS.items() if one in there]
    return f"decision: {'; '.join(meanings)}."


def channel_rows(channels: Sequence[ChannelEvidence]) -> list[tuple[str, ...]]:
    """Cells of a table with `CHANNEL_COLUMNS`, smallest p-value first."""
    ranked = sorted(channels, key=lambda c: (c.p_value, -c.gain_percent))
    return [
        (
            channel_label(c.channel),
            unit_text(c.unit),
            p_text(c.p_value),
            fixed(c.gain_percent, 1, " %"),
        )
        for c in ranked
    ]
