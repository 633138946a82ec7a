"""Reports of a diagnosis: sentences, lines and tables for a terminal, and JSON."""

from collections.abc import Iterator
from math import isfinite

from adhesion_can.diagnosis.cause_result import (
    LEAST_DOUBT,
    Cause,
    ClosestExplanation,
    EnvironmentSizes,
)
from adhesion_can.diagnosis.formatting import (
    effect_name,
    fixed,
    p_equation,
    rival_title,
    short,
    sizes,
    three_digits,
)
from adhesion_can.diagnosis.gain_result import Gain
from adhesion_can.diagnosis.result import Diagnosis, Verdict
from adhesion_can.diagnosis.sentences import unexplained_clause
from adhesion_can.physics.channels import channel_label
from adhesion_can.physics.effects.formula import FORMULA
from adhesion_can.reporting.diagnosis_tables import (
    ENVIRONMENT_COLUMNS,
    EVIDENCE_COLUMNS,
    EVIDENCE_NOTE,
    FAMILY_COLUMNS,
    FAMILY_TITLE,
    SHAPE_NOTE,
    cause_rows,
    decision_note,
    environment_rows,
    evidence_rows,
    evidence_title,
    family_rows,
    is_shape_named,
    untested_outcome,
)
from adhesion_can.reporting.text import FittingTable

ABOUT_AS_GOOD = 0.05
"""Share by which a family's held-out score may exceed the best one's to count as about as good."""
APART = 1.1
"""Largest over smallest λ_m of families from which it is said where each has its peak."""
SHOWN = 5
"""Rows of evidence that a terminal shows."""
FLOOR = "a fit with a spline in every channel"
"""What leaves the remainder that no model is expected to go below."""


# ---------------------------------------------------------------------------------- sentences


def verdict_sentences(diagnosis: Diagnosis) -> list[str]:
    """Verdict, p-values and gain; one or two sentences an entry, the verdict first."""
    sentences = list(_verdict(diagnosis))
    if diagnosis.gain is not None:
        sentences.append(gain_sentence(diagnosis.gain, diagnosis))
    sentences += _witness_sentence(diagnosis)
    return [*sentences, *_noise_sentence(diagnosis), *_what_is_left(diagnosis)]


def closest_sentences(diagnosis: Diagnosis) -> list[str]:
    """What helps and is no cause, a sentence each with its size and the reason."""
    return [
        f"{closest.title} ({_name_with_sizes(closest)}) reduces the RMSE on held-out data by "
        f"{closest.gain_percent:.1f} % but is refuted as the cause: {closest.refuted_by}."
        for closest in diagnosis.closest
    ]


def _name_with_sizes(closest: ClosestExplanation) -> str:
    name = effect_name(closest.effect, "" if closest.effect == FORMULA else closest.form)
    return f"{name}: {sizes(closest.parameters)}" if closest.parameters else name


def _noise_sentence(diagnosis: Diagnosis) -> Iterator[str]:
    """How far what is left is above the sensors' noise; none where it is not."""
    noise = diagnosis.noise
    if noise is None or not noise.is_exceeded or noise.sensors is None or noise.ratio is None:
        return
    yield (
        f"Sensor noise explains an RMSE of {three_digits(noise.sensors)}. With every known effect "
        f"and channel the RMSE on the deciding data is {three_digits(noise.floor)}, "
        f"{short(noise.ratio)} times as much: something that the library does not contain acts on "
        "the data."
    )


def _witness_sentence(diagnosis: Diagnosis) -> Iterator[str]:
    """The service's doubt with and without the causes; none where nobody asked."""
    witness = diagnosis.witness
    if witness is None:
        return
    before, after = 100 * witness.doubt_before, 100 * witness.doubt_after
    text = (
        f"Second witness: the service doubts the plain curve {before:.0f} % of the time in "
        f"{witness.recording}, and the model with these causes {after:.0f} % of the time"
    )
    if witness.stays:
        yield f"{text}: the named cause is wrong or incomplete."
    elif witness.doubt_before < LEAST_DOUBT:
        yield f"{text}: too little doubt to confirm or refute the causes."
    else:
        part = "" if 10 * witness.doubt_after <= witness.doubt_before else "part of "
        yield f"{text}: the causes explain {part}its doubt."


def widest_environments(diagnosis: Diagnosis) -> list[EnvironmentSizes]:
    """The partition with the largest spread of each effect; of refuted effects as of named ones."""
    widest: dict[str, EnvironmentSizes] = {}
    for partition in diagnosis.environments:
        widest.setdefault(partition.effect, partition)
    return list(widest.values())


def _what_is_left(diagnosis: Diagnosis) -> Iterator[str]:
    """The channel on which what the named effects leave depends most; none where it is noise."""
    if diagnosis.verdict is Verdict.UNEXPLAINED:
        return  # it says so itself
    left = [channel for channel in diagnosis.channels if channel.is_sure]
    if left:
        most = max(left, key=lambda channel: channel.gain_percent)
        yield (
            f"The residual depends on {channel_label(most.channel)}: a spline in it would reduce "
            f"the RMSE on the deciding data by {most.gain_percent:.1f} % "
            f"({p_equation(most.p_value)})."
        )


def has_extension(diagnosis: Diagnosis) -> bool:
    """Whether there is a model with effects or a spline."""
    model = diagnosis.model
    return model is not None and bool(model.effects or model.splines or model.curve is not None)


def _verdict(diagnosis: Diagnosis) -> Iterator[str]:
    if diagnosis.verdict is Verdict.NAMED:
        yield from (f"Named: {_cause_sentence(cause)}" for cause in diagnosis.causes)
    elif diagnosis.verdict is Verdict.UNEXPLAINED:
        yield _unexplained(diagnosis)
        yield from (f"Also named: {_cause_sentence(cause)}" for cause in diagnosis.causes)
    elif diagnosis.gain is None:
        yield (
            "No verdict: the data are not sufficient. This neither confirms nor refutes the "
            "simulation."
        )
    else:
        yield _nothing(diagnosis)
        yield from _peaks_of_families(diagnosis)


def _cause_sentence(cause: Cause) -> str:
    # The title of a formula is its form.
    name = effect_name(cause.effect, "" if cause.effect == FORMULA else cause.form)
    sentence = f"{cause.title} ({name}: {sizes(cause.parameters)}). {p_clause(cause.p_value)}."
    return f"{sentence} {_rivals(cause)}".strip()


def _rivals(cause: Cause) -> str:
    if cause.other_formulas:
        return f"Formulas that fit as well: {'; '.join(cause.other_formulas)}."
    if not cause.rivals:
        return ""
    rivals = " or ".join(f"{rival} ({rival_title(rival)})" for rival in cause.rivals)
    return f"These data cannot distinguish it from {rivals}."


def _unexplained(diagnosis: Diagnosis) -> str:
    if diagnosis.channel is None:
        return (
            f"Unexplained: {unexplained_clause(diagnosis)}, and neither a known effect nor a "
            "single measured channel explains it."
        )
    # A wave's channel has its length behind the name.
    p_values = [
        c.p_value for c in diagnosis.channels if c.channel.partition(",")[0] == diagnosis.channel
    ]
    sure = f" ({p_clause(min(p_values), 'channels')})" if p_values else ""
    text = (
        f"Unexplained: the residual depends on {channel_label(diagnosis.channel)}{sure}, and no "
        "known effect explains why."
    )
    rejected = (
        f" {untested.what} is not a cause: {untested.why}."
        for untested in diagnosis.untested
        if untested.rejected
    )
    return text + "".join(rejected)


def _nothing(diagnosis: Diagnosis) -> str:
    gain = diagnosis.gain
    if diagnosis.conclusive or gain is None:
        text = (
            "Nothing found: as far as these data show, the residual of the plain curve is "
            "noise. An effect may still be too small to see, or not excited."
        )
    else:
        text = "Undecided: the deciding data show an effect, but it is not certain."
        noise = _noise_below(diagnosis, gain)
        if noise is not None:
            text = (
                "Undecided: on held-out data the plain curve has an RMSE of "
                f"{three_digits(gain.rmse_before)}, {noise}, and no effect or channel explains the "
                "difference with certainty."
            )
    return f"{text} {_strongest(diagnosis)}".strip()


def _noise_below(diagnosis: Diagnosis, gain: Gain) -> str | None:
    """Remainder or noise clearly below what the plain curve leaves, a clause; None: none is."""
    if gain.leaves_much:
        return f"{FLOOR} leaves {three_digits(gain.noise_floor)} on the deciding data"
    noise = diagnosis.noise
    if noise is None or noise.sensors is None or not noise.leaves_more:
        return None
    return f"sensor noise explains {three_digits(noise.sensors)}"


def _strongest(diagnosis: Diagnosis) -> str:
    """The tested effect with the smallest p-value, and why it is not named; '' without any."""
    tested = [effect for effect in diagnosis.evidence if effect.is_tested]
    if not tested:
        return ""
    first = min(tested, key=lambda e: e.p_value if isfinite(e.p_value) else 1.0)
    name = effect_name(first.effect, first.form, first.axle)
    why = [test.why for test in diagnosis.untested if test.rejected and test.what == first.effect]
    return (
        f"The strongest effect is {name}: {p_equation(first.p_value)}, gain alone "
        f"{fixed(first.gain_percent, 1, ' %')}{''.join(f'; {reason}' for reason in why)}."
    )


def _peaks_of_families(diagnosis: Diagnosis) -> Iterator[str]:
    """Where the families have the peak that predict about as well, if that is not one place."""
    best = min((family.held_out_rmse for family in diagnosis.families), default=0.0)
    good = [
        family
        for family in diagnosis.families
        if family.held_out_rmse <= (1.0 + ABOUT_AS_GOOD) * best
    ]
    slips = [family.lambda_m for family in good if family.lambda_m is not None]
    if len(slips) < 2 or max(slips) <= APART * min(slips):
        return
    heights = [family.mu_max for family in good]
    yield (
        f"The peak depends on the form of the curve: {', '.join(family.title for family in good)} "
        f"predict about equally well, with μ_max from {min(heights):.4f} to {max(heights):.4f} "
        f"at slips from {min(slips):.4f} to {max(slips):.4f}. `identify --curve all` compares "
        "them."
    )


def p_clause(p_value: float, tested: str = "effects") -> str:
    """P-value with what it is corrected for, a clause."""
    if not isfinite(p_value):
        return "its p-value is not known"
    return f"{p_equation(p_value)}, corrected for all {tested} tested"


def gain_sentence(gain: Gain, diagnosis: Diagnosis) -> str:
    """Gain of the extension, its interval, and the data that were held out."""
    where = f"Held out: {gain.held_out}."
    extended = has_extension(diagnosis)
    before, after = three_digits(gain.rmse_before), three_digits(gain.rmse_after)
    floor = f"On the deciding data, {FLOOR} leaves an RMSE of {three_digits(gain.noise_floor)}."
    if not extended and gain.rmse_after == gain.rmse_before:
        return (
            "There is no extension. RMSE of the adhesion on held-out data: plain curve "
            f"{before}. {floor} {where}"
        )
    low, high = gain.interval
    interval = (
        f"95 % interval {low:.1f} to {high:.1f} %" if isfinite(low + high) else "interval not known"
    )
    text = (
        f"Gain on held-out data: {gain.percent:.1f} % ({interval}). RMSE of the adhesion on these "
        f"data: plain curve {before}, extended model {after}. {floor}"
    )
    written = gain.as_written
    if written is not None:
        change = f"{abs(written.percent):.1f} % {'below' if written.percent >= 0.0 else 'above'}"
        text += (
            " This is with the curve refitted to the held-out data; the model as written has an "
            f"RMSE of {three_digits(written.rmse)} there, {change} the plain curve."
        )
    if gain.percent <= 0.0:
        text += " On these data the extension is no better than the plain curve."
    elif low <= 0.0:
        text += " The interval includes 0: the gain is not certain."
    if not extended:
        text += (
            " This is the gain of an empirical curve, which a model file cannot hold, so the "
            "plain curve remains."
        )
    return f"{text} {where}"


# ----------------------------------------------------------------------------------- terminal


def terminal(diagnosis: Diagnosis) -> Iterator[str | FittingTable]:
    """Lines and tables for a terminal, in order."""
    yield from verdict_sentences(diagnosis)
    named = {value for cause in diagnosis.causes for value in cause_rows([cause])}
    if named:
        columns = ("effect", "parameter", "value", "meaning")
        yield FittingTable("Causes, ± standard deviation", columns, cause_rows(diagnosis.causes))
    if diagnosis.wrong:
        yield "What the simulation gets wrong:"
        yield from (f"- {sentence}" for sentence in diagnosis.wrong)
    yield from _refutations(diagnosis)
    if diagnosis.families:
        yield FittingTable(FAMILY_TITLE, FAMILY_COLUMNS, family_rows(diagnosis.families))
        if is_shape_named(diagnosis):
            yield SHAPE_NOTE
    yield from _next_steps(diagnosis)
    rows = evidence_rows(diagnosis.evidence)
    if rows:
        few = f"the first {SHOWN} of " if rows[SHOWN:] else ""
        title_ = f"Evidence: {few}{evidence_title(diagnosis.evidence)}"
        yield FittingTable(title_, EVIDENCE_COLUMNS, rows[:SHOWN])
        yield EVIDENCE_NOTE
        yield decision_note([effect for effect in diagnosis.evidence if effect.is_tested][:SHOWN])
    # What was tested says more than what could not be.
    for untested in sorted(diagnosis.untested, key=lambda effect: not effect.rejected):
        yield (
            f"{untested_outcome(untested, diagnosis.evidence).capitalize()}: {untested.what}: "
            f"{untested.why}"
        )


def _refutations(diagnosis: Diagnosis) -> Iterator[str | FittingTable]:
    """What was refuted, and the sizes by environment."""
    if diagnosis.closest:
        yield "Refuted explanations that help:"
        yield from (f"- {sentence}" for sentence in closest_sentences(diagnosis))
    widest = widest_environments(diagnosis)
    if widest:
        rows = environment_rows(widest)
        title_ = "Sizes by environment: the partition in which they differ most"
        yield FittingTable(title_, ENVIRONMENT_COLUMNS, rows)


def needed_sentence(diagnosis: Diagnosis) -> str:
    """The manoeuvre that distinguishes the rivals; '' where none is needed or a plan has it."""
    planned = diagnosis.next_drive
    if not diagnosis.needed or (planned is not None and planned.plan is not None):
        return ""
    can_plan = not diagnosis.tables and planned is None
    how = ", by the plan of --next-drive or by hand" if can_plan else ""
    return f"Needed{how}: {diagnosis.needed}"


def _next_steps(diagnosis: Diagnosis) -> Iterator[str]:
    """What would separate explanations, and what a drive has left of them."""
    needed = needed_sentence(diagnosis)
    if needed:
        yield needed
    if diagnosis.remaining is not None:
        yield diagnosis.remaining.sentence
    # Why there is no plan is in the last line of the command.
    if diagnosis.next_drive is not None and diagnosis.next_drive.plan is not None:
        yield diagnosis.next_drive.sentence
