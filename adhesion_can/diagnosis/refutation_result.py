"""What was refuted, and the sizes of causes by environment, as values of the result."""

from collections.abc import Iterable, Iterator, Sequence

from adhesion_can.diagnosis.cause_result import (
    Cause,
    ClosestExplanation,
    EnvironmentSizes,
    SizeLevel,
)
from adhesion_can.diagnosis.formatting import title
from adhesion_can.diagnosis.inference.confirm_on_hold_out import ClosestCause, ConfirmedFindings
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.parameter_values import effect_title, parameter_values
from adhesion_can.diagnosis.refutation.invariance import SizesByEnvironment
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, RegressionData


def build_closest(
    confirmed: ConfirmedFindings, data: RegressionData
) -> tuple[ClosestExplanation, ...]:
    """Refuted effects that gain on held-out data, the largest gain first.

    Args:
        confirmed: Findings that hold on the held-out data.
        data: Rows of all drives.

    """
    has_load = any(drive.has_load for drive in data.drives)
    ranked = sorted(confirmed.closest, key=lambda cause: -cause.gain.percent)
    return tuple(_build_closest(cause, has_load=has_load) for cause in ranked)


def _build_closest(closest: ClosestCause, *, has_load: bool) -> ClosestExplanation:
    refuted = closest.refuted
    name, percent = title(refuted.effect), closest.gain.percent
    if refuted.place is None:
        return ClosestExplanation(refuted.effect, refuted.form, name, (), percent, refuted.reason)
    effect = refuted.fitted.model.candidates[refuted.place].effect
    values = parameter_values(refuted.fitted, refuted.place, has_load=has_load)
    name = effect_title(effect, values[0])
    return ClosestExplanation(refuted.effect, refuted.form, name, values, percent, refuted.reason)


def build_environments(
    findings: Findings, confirmed: ConfirmedFindings, causes: Sequence[Cause], model: Model
) -> tuple[EnvironmentSizes, ...]:
    """Sizes by environment of the named effects, and of refuted ones where they refute.

    Args:
        findings: Findings of steps 2 to 6.
        confirmed: Findings that hold on the held-out data.
        causes: Named causes.
        model: Final model, whose sizes are those of the causes.

    """
    named = {cause.effect for cause in causes}
    out: list[EnvironmentSizes] = []
    for place, candidate in enumerate(model.candidates):
        if candidate.effect.id in named:
            sizes = findings.sizes_by_environment.get(candidate, ())
            out += _describe_sizes(candidate, model.values[place], sizes)
    for closest in confirmed.closest:
        refuted = closest.refuted
        if refuted.place is not None:
            candidate = refuted.fitted.model.candidates[refuted.place]
            values = refuted.fitted.model.values[refuted.place]
            out += _describe_sizes(
                candidate, values, (sizes_of for sizes_of in refuted.sizes if sizes_of.refutes)
            )
    return tuple(out)


def _describe_sizes(
    candidate: Candidate, values: Sequence[float], sizes: Iterable[SizesByEnvironment]
) -> Iterator[EnvironmentSizes]:
    for sizes_of in sizes:
        levels = zip(sizes_of.labels, sizes_of.sizes.tolist(), sizes_of.stds.tolist(), strict=True)
        yield EnvironmentSizes(
            candidate.effect.id,
            candidate.free_parameters[sizes_of.parameter].name,
            sizes_of.partition,
            candidate.free_parameters[sizes_of.parameter].unit,
            values[sizes_of.parameter],
            tuple(SizeLevel(label, value, std) for label, value, std in levels),
            sizes_of.p_value,
            sizes_of.spread,
            sizes_of.refutes,
        )
