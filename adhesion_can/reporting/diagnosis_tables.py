"""Tables of a diagnosis: causes, curve families, sizes by environment, and the evidence."""

from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

from adhesion_can.diagnosis.cause_result import Cause, EnvironmentSizes
from adhesion_can.diagnosis.diagnose import DiagnosisSettings
from adhesion_can.diagnosis.evidence import ChannelEvidence, Decision, EffectEvidence, Untested
from adhesion_can.diagnosis.formatting import (
    effect_name,
    fixed,
    measured,
    p_equation,
    p_text,
    unit_text,
    value_text,
)
from adhesion_can.diagnosis.inference.equivalent_effects import EQUAL_GAIN
from adhesion_can.diagnosis.inference.model_comparison import LEVEL
from adhesion_can.diagnosis.result import Diagnosis, FamilyResult
from adhesion_can.physics.channels import channel_label
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE
from adhesion_can.plurals import counted
from adhesion_can.result_text import HELD_OUT_RMSE

FAMILY_COLUMNS = (
    "family", "parameters", HELD_OUT_RMSE, "RMSE", "μ_max", "λ_m", "base curve",
)  # fmt: skip
FAMILY_TITLE = "Curve families without effects, fitted to the deciding data"
SHAPE_NOTE = (
    "lambda_m_after and mu_max_after of curve_shape are the peak of the base curve, fitted to all "
    "data together with the other named effects. λ_m and μ_max in this table are those of a family "
    "without any effect. This comparison decides about curve_shape, so Evidence has no row of it."
)
"""What distinguishes the two peaks of a family, where a shape is named."""
ENVIRONMENT_COLUMNS = ("size", "environment", "value", "spread", "p")


def cause_rows(causes: Sequence[Cause]) -> list[tuple[str, ...]]:
    """Cells of a table of causes: effect, parameter, value, meaning; one row a parameter."""
    return [
        (effect_name(c.effect, c.form), v.name, value_text(v), v.meaning)
        for c in causes
        for v in c.parameters
    ]


def family_rows(families: Sequence[FamilyResult]) -> list[tuple[str, ...]]:
    """Cells of a table with `FAMILY_COLUMNS`."""
    return [
        (
            family.title,
            str(family.parameters),
            fixed(family.held_out_rmse, 3),
            fixed(family.rmse, 4),
            fixed(family.mu_max, 4),
            "-" if family.lambda_m is None else fixed(family.lambda_m, 4),
            "yes" if family.chosen else "",
        )
        for family in families
    ]


def environment_rows(environments: Sequence[EnvironmentSizes]) -> list[tuple[str, ...]]:
    """Cells of a table with `ENVIRONMENT_COLUMNS`, one row an environment."""
    return [
        (
            f"{partition.effect}: {partition.parameter}",
            level.level,
            measured(level.value, level.std, partition.unit),
            fixed(100 * partition.spread, 0, " %"),
            p_text(partition.p_value),
        )
        for partition in environments
        for level in partition.levels
    ]


def is_shape_named(diagnosis: Diagnosis) -> bool:
    """Whether another base curve than Burckhardt's is a named cause."""
    return any(cause.effect == CURVE_SHAPE for cause in diagnosis.causes)


EVIDENCE_COLUMNS = (
    "effect", "statistic", "p", "imitated", "most similar", "cosine", "gain alone", "decision",
)  # fmt: skip
EVIDENCE_NOTE = (
    "statistic, p: the effect alone, tested against the plain curve; p is the probability that "
    "noise gives so large a statistic, corrected for all effects tested. imitated: share of the "
    "effect that other values of c1, c2 and c3 imitate. The test uses the remainder, so a high "
    "share needs a large effect or many data. most similar, cosine: the effect whose remainder is "
    "most like this one's, before anything is fitted. 0 is unlike; near 1 or -1 only the fits "
    "distinguish the two. gain alone: reduction of the RMSE "
    "of the adhesion on the deciding data by this effect without others. Causes come "
    "first, then their rivals, then the others by gain alone."
)
"""Meaning of the columns of the evidence, without the decisions."""
CHANNEL_COLUMNS = ("channel", "unit", "p", "gain")


class _Words(NamedTuple):
    """A decision for people.

    Attributes:
        name: The decision in a table or a figure.
        meaning: Its meaning, a clause.

    """

    name: str
    meaning: str


DECISIONS = {
    Decision.NAMED: _Words(
        "named", "a cause; the model with it predicts each block best from the others"
    ),
    Decision.RIVAL: _Words(
        "rival",
        "the data cannot distinguish it from a cause, for one of three reasons. It predicts as "
        f"well; or it has the same signature and at least {100 * EQUAL_GAIN:g} % of the gain; or "
        "only a drive at another speed would show the difference",
    ),
    Decision.OTHER_FORM: _Words("other form", "another form of a cause, or another axle"),
    Decision.WORSE: _Words(
        "worse",
        "without others it predicts each block from the other blocks worse than the causes do "
        f"(paired test, limit p = {LEVEL:g})",
    ),
    Decision.NOT_BETTER: _Words(
        "no better",
        "without others it predicts each block from the other blocks no better than the causes do "
        f"(paired test, not worse for certain: limit p = {LEVEL:g})",
    ),
    Decision.WEAKER: _Words(
        "not fitted",
        "its gain, estimated beforehand, is below that of the effects that were fitted, or 0",
    ),
    Decision.REFUTED: _Words(
        "refuted", "a test rules it out as a cause; the reason is given with its limit"
    ),
    Decision.IMPLAUSIBLE: _Words("impossible size", "it fits only with a size that no vehicle has"),
    Decision.NOT_NAMED: _Words(
        "not named",
        "fitted, but it failed the test in its row. gain: of the RMSE. block gain: of the square "
        "error of each block, predicted from the others. gain p: p of the gain, "
        f"limit p = {LEVEL:g}. unconfirmed: by the held-out data or a test of refutation. "
        "oscillation, cut-off efforts: they hide every effect. more is left: a channel explains "
        "more than the effect",
    ),
    Decision.NOT_SIGNIFICANT: _Words(
        "not significant", f"noise explains it (limit p = {DiagnosisSettings().alpha:g})"
    ),
    Decision.NOT_TESTED: _Words("not tested", "the parameters of the curve imitate it"),
}
"""Each decision for people; JSON has its id."""


def evidence_rows(evidence: Sequence[EffectEvidence]) -> list[tuple[str, ...]]:
    """Cells of a table with `EVIDENCE_COLUMNS`."""
    return [
        (
            effect_name(e.effect, e.form, e.axle),
            fixed(e.statistic, 2),
            p_text(e.p_value),
            fixed(100 * e.absorbed, 0, " %"),
            e.most_similar[0] or "-",
            fixed(e.most_similar[1], 2) if e.most_similar[0] else "-",
            fixed(e.gain_percent, 1, " %"),
            _decision(e),
        )
        for e in evidence
        if e.is_tested
    ]


def _decision(evidence: EffectEvidence) -> str:
    name = DECISIONS[evidence.decision].name
    if evidence.why:
        return f"{name}: {evidence.why}"
    if not isfinite(evidence.worse_p_value):
        return name
    return f"{name}, {p_equation(evidence.worse_p_value)}"


def untested_outcome(untested: Untested, evidence: Sequence[EffectEvidence]) -> str:
    """Outcome for what is no finding: not tested, refuted as in its evidence, or rejected."""
    if not untested.rejected:
        return "not tested"
    refuted = {each.effect for each in evidence if each.decision is Decision.REFUTED}
    return DECISIONS[Decision.REFUTED].name if untested.what in refuted else "rejected"


def evidence_title(evidence: Sequence[EffectEvidence]) -> str:
    """What a table of evidence holds: how many tests of how many effects."""
    tested = [effect for effect in evidence if effect.is_tested]
    effects = len({test.effect for test in tested})
    return (
        f"{counted(len(tested), 'test')} of {counted(effects, 'effect')}: each form of an effect, "
        "and each axle, has a test of its own"
    )


def decision_note(evidence: Sequence[EffectEvidence]) -> str:
    """Meaning of the decisions that a table of evidence holds."""
    there = {effect.decision for effect in evidence if effect.is_tested}
    meanings = [
        f"'{text.name}': {text.meaning}"
        for decision, text in DECISIONS.items()
        if decision in there
    ]
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
