"""Refutation of the causes of a selected model, the worst one first.

A cause is refuted where it leaves too much in blocks of time (`block_variance`), where its size is
not one size (`invariance`), or where a parameter is at the end of its range. The worst cause is
removed, the others are fitted again, and so on: that keeps a true cause beside an unknown one. In
the end the causes together must explain some of what the sensors' noise does not: beside a large
error of another origin a small gain has no name. And another shape of the curve, which bends to
whatever is left, has none unless noise alone is left.
"""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

from adhesion_can.diagnosis.cause_result import Witness
from adhesion_can.diagnosis.formatting import measured, p_equation, short, unit_text, value_and_unit
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.imitations import find_growth
from adhesion_can.diagnosis.inference.model_comparison import ScoredModel
from adhesion_can.diagnosis.refutation.block_variance import MOST_LEFT, compute_variance_left
from adhesion_can.diagnosis.refutation.environments import Partition, build_partitions
from adhesion_can.diagnosis.refutation.invariance import (
    LEVEL,
    MOST_SPREAD,
    SizesByEnvironment,
    compute_sizes,
    find_refuting,
)
from adhesion_can.diagnosis.refutation.refuted_cause import RefutedCause
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, remove_effect
from adhesion_can.diagnosis.regression.whitened_regression import (
    FittedModel,
    WhitenedRegression,
    fit_model,
)
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE

DECISIVE = 1.0
"""Badness of a reason that has no size of its own, as a parameter at the end of its range."""
LEAST_OF_EXCESS = 0.1
"""Share that the causes must have in what the sensors' noise does not explain."""


class _Reason(NamedTuple):
    """What speaks against a cause.

    Attributes:
        badness: How bad it is: the share that is left, the relative spread of the sizes, or
            `DECISIVE`.
        text: Reason in one clause, with figures.

    """

    badness: float
    text: str


_NO_REASON = _Reason(0.0, "")


@dataclass(frozen=True, eq=False)
class _Trial:
    """What speaks against one cause of a model.

    Attributes:
        place: Place of the effect among the model's.
        reasons: Reasons against it; () where there is none.
        without: Model without the cause, fitted to the same rows.
        sizes: Size of the cause by environment, the largest spread first.

    """

    place: int
    reasons: tuple[_Reason, ...]
    without: Model
    sizes: tuple[SizesByEnvironment, ...]

    @property
    def worst_reason(self) -> _Reason:
        """The worst of the reasons; that without badness where there is none."""
        return max(self.reasons, key=lambda reason: reason.badness, default=_NO_REASON)

    @property
    def badness(self) -> float:
        """How bad the worst of the reasons is; 0 where there is none."""
        return self.worst_reason.badness


def drop_refuted(findings: Findings) -> Findings:
    """The findings without the causes that are refuted, which are kept with their reasons."""
    if not findings.selection.best.candidates:
        return findings
    regression = findings.regression.last_fit
    fitted = fit_model(regression, findings.selection.best.model)
    model = fitted.model
    trials = _try_all(regression, model)
    worst = max(trials, key=lambda trial: trial.badness)
    reason = worst.worst_reason
    if not worst.reasons:
        worst, reason = _find_least_sure(findings, model, trials)
    if reason is _NO_REASON:
        sizes = {model.candidates[trial.place]: trial.sizes for trial in trials}
        findings = replace(findings, sizes_by_environment=sizes)
        if findings.share_of_excess >= LEAST_OF_EXCESS:
            return findings
        without = [trial.without for trial in trials]
        why = (
            f"it explains {100 * findings.share_of_excess:.0f} % of the residual beyond the sensor "
            f"noise; a cause explains at least {100 * LEAST_OF_EXCESS:.0f} %"
        )
        return _refute_all(findings, fitted, without, why)
    candidate = model.candidates[worst.place]
    refuted = RefutedCause.of(
        candidate, worst.place, fitted, worst.without, reason.text, worst.sizes
    )
    smaller = replace(findings.without_effect(worst.place), refuted=(*findings.refuted, refuted))
    return drop_refuted(smaller)


def _find_least_sure(
    findings: Findings, model: Model, trials: Sequence[_Trial]
) -> tuple[_Trial, _Reason]:
    """The cause with the largest p-value, and what that says against it."""
    p_values = [findings.p_value(model.candidates[trial.place]) for trial in trials]
    largest = max(p_values)
    trial = trials[p_values.index(largest)]
    if largest <= findings.alpha:
        return trial, _NO_REASON
    return trial, _Reason(
        DECISIVE,
        f"its p-value is {100 * largest:.1f} %; a cause has at most {100 * findings.alpha:g} %",
    )


def describe_refutation(regression: WhitenedRegression, model: Model) -> str:
    """What speaks most against a cause of a fitted model, a clause; '' where nothing does."""
    if not model.candidates:
        return ""
    return max(_try_all(regression, model), key=lambda trial: trial.badness).worst_reason.text


def refute_shape(shaped: Findings) -> RefutedCause | None:
    """The shape of the curve as a refuted cause; None where it is not refuted.

    It is measured against Burckhardt's curve with the same effects.

    Args:
        shaped: Findings with the curve of another family.

    """
    if shaped.shape is None:
        return None
    regression = shaped.regression.last_fit
    fitted = fit_model(regression, shaped.selection.best.model)
    without = fit_model(regression, shaped.shape.same.model).model
    left = compute_variance_left(regression, fitted.model, without)
    if left.refutes:
        reason = _describe_left(left.share)
    elif shaped.noise.is_exceeded:
        reason = (
            f"with it the residual is still {shaped.noise.usual:.2f} times the sensor noise, and "
            "another curve can fit any residual"
        )
    else:
        return None
    return RefutedCause(CURVE_SHAPE, shaped.shape.family.name, None, fitted, without, reason)


def refute_by_witness(findings: Findings, plain_found: Findings, witness: Witness) -> Findings:
    """The findings without the causes of which a doubt of the service is left.

    Args:
        findings: Findings whose named causes are refuted.
        plain_found: Findings with Burckhardt's curve, which stay where another shape is refuted.
        witness: Doubt before and after.

    """
    reason = (
        f"with it the service still doubts its model {100 * witness.doubt_after:.0f} % of the "
        f"time ({100 * witness.doubt_before:.0f} % without it); a true cause removes the doubt"
    )
    regression = findings.regression.last_fit
    fitted = fit_model(regression, findings.selection.best.model)
    without = [
        fit_model(regression, remove_effect(fitted.model, place)[0]).model
        for place in range(len(fitted.model.candidates))
    ]
    refuted = _refute_all(findings, fitted, without, reason).refuted
    if findings.shape is not None:
        same = fit_model(regression, findings.shape.same.model).model
        family = findings.shape.family.name
        refuted = (*refuted, RefutedCause(CURVE_SHAPE, family, None, fitted, same, reason))
    return replace(plain_found.with_best(plain_found.selection.plain), refuted=refuted)


def _refute_all(
    findings: Findings, fitted: FittedModel, without: Sequence[Model], reason: str
) -> Findings:
    """The findings without any effect: all of the selected model's are refuted for one reason.

    Args:
        findings: Findings.
        fitted: The selected model, fitted to all rows.
        without: Model without each of its effects, fitted to the same rows.
        reason: Reason, a clause.

    """
    sizes = findings.sizes_by_environment
    refuted = [
        RefutedCause.of(candidate, place, fitted, smaller, reason, sizes.get(candidate, ()))
        for place, (candidate, smaller) in enumerate(
            zip(fitted.model.candidates, without, strict=True)
        )
    ]
    without_effects = findings.with_best(findings.selection.plain)
    return replace(without_effects, refuted=(*findings.refuted, *refuted))


def add_implausible_effects(findings: Findings) -> Findings:
    """The findings with the effects that would explain the data by a size that no vehicle has.

    Nothing else is put silently in their place: they are refuted causes with that reason.
    """
    regression = findings.regression.last_fit
    plain = fit_model(regression, findings.selection.plain.model).model
    refuted = [
        RefutedCause.of(
            scored.candidates[0],
            0,
            fit_model(regression, without_bounds(scored.model)),
            plain,
            _describe_implausible(scored),
        )
        for scored in findings.selection.implausible
        if scored.candidates[0] not in findings.selection.best.candidates
    ]
    return replace(findings, refuted=(*findings.refuted, *refuted))


def without_bounds(model: Model) -> Model:
    """A model with one effect whose size may be anything."""
    (candidate,) = model.candidates
    size, *others = candidate.effect.parameters
    free = replace(size, lower=-inf, upper=inf)
    effect = copy(candidate.effect)
    # Effects are frozen values, and those of a distribution may be of any class.
    object.__setattr__(effect, "parameters", (free, *others))
    return replace(model, candidates=(replace(candidate, effect=effect),))


def _describe_implausible(scored: ScoredModel) -> str:
    (candidate,), (value,) = scored.candidates, scored.free_sizes
    size, (low, high) = candidate.free_parameters[0], candidate.plausible
    is_below = value < low
    fitted, limit = (
        f"{short(x)} {unit_text(size.unit)}".strip() for x in (value, low if is_below else high)
    )
    more = "less" if is_below else "more"
    return f"its {size.name} would be about {fitted}, but no such vehicle has {more} than {limit}"


def _try_all(regression: WhitenedRegression, model: Model) -> list[_Trial]:
    """What speaks against each cause of a fitted model."""
    partitions = build_partitions(regression.data, regression.evaluate_corrected(model).slip)
    return [_try(regression, model, place, partitions) for place in range(len(model.candidates))]


def _try(
    regression: WhitenedRegression, model: Model, place: int, partitions: Sequence[Partition]
) -> _Trial:
    """Everything that may refute one cause of a fitted model."""
    without = fit_model(regression, remove_effect(model, place)[0]).model
    sizes = tuple(compute_sizes(regression, model, place, partitions))
    reasons = tuple(_find_reasons(regression, model, place, without, sizes))
    return _Trial(place, reasons, without, sizes)


def _find_reasons(
    regression: WhitenedRegression,
    model: Model,
    place: int,
    without: Model,
    sizes: Sequence[SizesByEnvironment],
) -> Iterator[_Reason]:
    """Reasons against a cause."""
    left = compute_variance_left(regression, model, without)
    if left.refutes:
        yield _Reason(left.share, _describe_left(left.share))
    refuting = find_refuting(sizes)
    if refuting is not None:
        yield _Reason(refuting.spread, _describe_sizes(model.candidates[place], refuting))
    growth = find_growth(regression, model, place, without)
    if growth is not None:
        text = (
            f"a speed error that grows with a time constant of {growth:.0f} s explains as much, "
            "and so would all wheel radii growing as the wheels warm up"
        )
        yield _Reason(DECISIVE, text)
    pairs = zip(model.candidates[place].free_parameters, model.values[place], strict=True)
    for parameter, value in pairs:
        if parameter.is_at_bound(value):
            end = value_and_unit(value, parameter.unit)
            text = f"its {parameter.name} is at the end of its range, {end}"
            yield _Reason(DECISIVE, text)


def _describe_left(share: float) -> str:
    return (
        f"with it {100 * share:.0f} % of the error that the rows of a block share remains; a "
        f"true cause leaves at most {100 * MOST_LEFT:.0f} %"
    )


def _describe_sizes(candidate: Candidate, sizes: SizesByEnvironment) -> str:
    """Largest and smallest value of a parameter, each with its environment."""
    parameter = candidate.free_parameters[sizes.parameter]
    low, high = int(sizes.sizes.argmin()), int(sizes.sizes.argmax())
    texts = [
        f"{measured(float(sizes.sizes[k]), float(sizes.stds[k]), parameter.unit)} "
        f"({sizes.labels[k]})"
        for k in (low, high)
    ]
    return (
        f"its {parameter.name} is not the same everywhere: {texts[0]}, {texts[1]} "
        f"({p_equation(sizes.p_value)}, spread {100 * sizes.spread:.0f} %; limits: {LEVEL:g} and "
        f"{100 * MOST_SPREAD:g} %)"
    )
