"""A model is proposed whose causes the whole record and both of its halves name with one size.

A cause that is an accident of some minutes has no reason to come again in others, with the same
size. The halves have no reading in common.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot

from adhesion_can.diagnosis.cause_result import Cause, ParameterValue
from adhesion_can.diagnosis.formatting import value_text
from adhesion_can.diagnosis.result import Diagnosis, Verdict
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.learning.report import LearnedCause
from adhesion_can.learning.sentences import describe_causes
from adhesion_can.result_text import TimeScale

MOST_APART = 3.0
"""Largest difference of two sizes in standard deviations of that difference."""
FORM_TOLERANCE = 0.1
"""Difference of two sizes, relative to the larger one, that a small error of form makes, as a
regression's standard deviations do not contain it."""


@dataclass(frozen=True, slots=True)
class LearnedModel:
    """A model that a record proposes, or proposed to an earlier service.

    Attributes:
        name: Ids of its causes joined by '+', the main one first.
        found: What was learned, a clause.
        sizes: Size of each cause, in the same order.
        model: Extended model of the whole record.
        record: Length and start of the record, in words.

    """

    name: str
    found: str
    sizes: tuple[LearnedCause, ...]
    model: ExtendedModel
    record: str


def propose_model(whole: Diagnosis, from_us: int, to_us: int) -> LearnedModel:
    """Model of a diagnosis without objection.

    Args:
        whole: Diagnosis of the whole record.
        from_us: Start of the record, µs.
        to_us: End of the record, µs.

    """
    if whole.model is None:
        raise ValueError("a diagnosis without a model")
    begin = TimeScale.beginning_at(from_us).begin or "the start"
    return LearnedModel(
        "+".join(cause.effect for cause in whole.causes),
        describe_causes(whole.causes),
        tuple(_main_size(cause) for cause in whole.causes),
        whole.model,
        f"{(to_us - from_us) / 1e6:.0f} s from {begin}",
    )


def _main_size(cause: Cause) -> LearnedCause:
    """First parameter of a cause."""
    value = cause.parameters[0]
    return LearnedCause(cause.effect, value.value, value.std, value.unit)


def find_objection(whole: Diagnosis) -> str:
    """Reason why a record alone proposes nothing, a clause; '' where its halves are to be asked."""
    if not whole.causes:
        return f"the record names no cause ({whole.verdict.value.replace('_', ' ')})"
    if whole.verdict is not Verdict.NAMED or whole.model is None or whole.model.splines:
        return "the record names a cause, but leaves something unexplained beside it"
    at_bound = [
        cause.effect for cause in whole.causes for value in cause.parameters if value.at_bound
    ]
    if at_bound:
        return f"{at_bound[0]} is at the end of its range"
    rivals = [cause for cause in whole.causes if cause.rivals]
    if rivals:
        return f"{rivals[0].effect} cannot be distinguished from {' or '.join(rivals[0].rivals)}"
    return ""


def find_disagreement(whole: Diagnosis, halves: Sequence[Diagnosis]) -> str:
    """Reason why the halves of a record do not bear out its causes, a clause; '' where they do.

    Args:
        whole: Diagnosis of the whole record, without objection.
        halves: Diagnoses of its two halves.

    """
    main = _key(whole.causes[0])
    for place, half in zip(("first", "second"), halves, strict=True):
        if not half.causes or half.verdict is not Verdict.NAMED:
            return f"the {place} half names no cause"
        if _key(half.causes[0]) != main:
            other = half.causes[0].effect
            return f"the {place} half names {other}, not {whole.causes[0].effect}"
    for cause in whole.causes:
        pair = [_find(half, cause) for half in halves]
        named = [half_cause for half_cause in pair if half_cause is not None]
        if len(named) < len(pair):
            return f"only one half names {cause.effect}"
        reason = _compare_sizes(cause, *named)
        if reason:
            return reason
    return ""


def _key(cause: Cause) -> tuple[str, str]:
    return cause.effect, cause.form


def _find(half: Diagnosis, cause: Cause) -> Cause | None:
    """The same cause in a half's diagnosis; None where it does not name it."""
    return next((named for named in half.causes if _key(named) == _key(cause)), None)


def _compare_sizes(cause: Cause, first: Cause, second: Cause) -> str:
    """Reason why two causes have different sizes, a clause; '' where they have the same."""
    for value, other in zip(first.parameters, second.parameters, strict=True):
        if not _is_same(value, other):
            texts = f"{value_text(value)} and {value_text(other)}"
            return f"the halves give {cause.effect} different sizes: {value.name} {texts}"
    return ""


def _is_same(value: ParameterValue, other: ParameterValue) -> bool:
    if value.at_bound or other.at_bound:
        return False
    if value.std is None or other.std is None:
        return value.value == other.value
    tolerance = FORM_TOLERANCE * max(abs(value.value), abs(other.value))
    return abs(value.value - other.value) <= MOST_APART * hypot(value.std, other.std) + tolerance
