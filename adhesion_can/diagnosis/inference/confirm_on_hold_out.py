"""Step 7, confirm on hold-out: only what predicts the held-out data better becomes a finding.

No cause is selected on held-out data. Blocks that are held out have a part in what removes one, or
parts rivals; recordings that are held out whole have none. A finding whose gain on them may be none
is dropped. A cause that was refuted and gains on them all the same says that something is there
that has no cause.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from adhesion_can.diagnosis.evidence import Untested
from adhesion_can.diagnosis.gain_result import Gain
from adhesion_can.diagnosis.inference.find_residual_channels import ResidualChannel
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.hold_out_gain import compute_hold_out_gain, is_significant
from adhesion_can.diagnosis.inference.model_comparison import LEAST_GAIN
from adhesion_can.diagnosis.inference.shape_finding import ShapeFinding
from adhesion_can.diagnosis.refutation.refuted_cause import RefutedCause
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.model import Model, remove_effect
from adhesion_can.diagnosis.regression.whitened_regression import fit_model
from adhesion_can.diagnosis.sentences import name_with_wave
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE

CLEAR_GAIN = 5.0
"""Gain of another shape, %, that counts although its interval holds 0: some parts of a drive show
nothing of a shape, which widens the interval."""

NOT_CONFIRMED = "the deciding data show it, but the held-out data do not confirm it"

NOT_BESIDE = "in addition to the other causes, it has no certain gain on held-out data"


@dataclass(frozen=True, eq=False)
class ClosestCause:
    """A refuted cause that predicts the held-out data better than the model without it.

    Attributes:
        refuted: Cause with its model and the reason.
        gain: Gain on the held-out data.

    """

    refuted: RefutedCause
    gain: Gain


@dataclass(frozen=True, eq=False)
class ConfirmedFindings:
    """Findings that hold on the held-out data.

    Attributes:
        named: Effects that explain the data; () where none does.
        channel: Channel of an unexplained residual; None where there is none.
        gain: Gain of the effects or the channel on the held-out data.
        rejected: Findings that do not hold on the held-out data, with the reason.
        shape: Base curve of another family; None: it is Burckhardt's.
        closest: Causes that gain and were refuted.

    """

    named: tuple[Candidate, ...]
    channel: ResidualChannel | None
    gain: Gain
    rejected: tuple[Untested, ...]
    shape: ShapeFinding | None = None
    closest: tuple[ClosestCause, ...] = ()


def drop_uncertain(findings: Findings) -> tuple[Findings, tuple[Untested, ...]]:
    """The findings without effects that gain nothing for certain beside the others, and which.

    Together with a true cause, a second one that fits a little noise gains as well.

    Args:
        findings: Findings of steps 2 to 6.

    """
    best, regression = findings.selection.best.model, findings.regression
    if len(findings.named) < 2:
        return findings, ()
    gains = []
    for place in range(len(best.candidates)):
        without = fit_model(regression, remove_effect(best, place)[0]).model
        gains.append(_compute_gain(findings, without, best))
    least = min(range(len(gains)), key=lambda place: gains[place].interval[0])
    if is_significant(gains[least]):
        return findings, ()
    smaller, rejected = drop_uncertain(findings.without_effect(least))
    return smaller, (_reject(best.candidates[least].effect.id, NOT_BESIDE), *rejected)


def confirm_on_hold_out(findings: Findings) -> ConfirmedFindings:
    """Named effects, else an unexplained channel, else nothing: the first that gains.

    Args:
        findings: Findings of steps 2 to 6.

    """
    closest = tuple(_find_closest(findings))
    gaining = [cause.refuted for cause in closest]
    others = (
        Untested(refuted.effect, refuted.reason, rejected=True)
        for refuted in findings.refuted
        if refuted not in gaining
    )
    confirmed = _confirm(findings)
    is_beaten = any(cause.gain.percent > confirmed.gain.percent for cause in closest)
    if is_beaten and confirmed.channel is not None:
        # What a refuted effect explains better is no matter of the channel.
        plain = findings.baseline.model
        confirmed = replace(confirmed, channel=None, gain=_compute_gain(findings, plain, plain))
    return replace(confirmed, closest=closest, rejected=(*confirmed.rejected, *others))


def _find_closest(findings: Findings) -> Iterator[ClosestCause]:
    """Refuted causes that gain on the held-out data."""
    regression = findings.regression
    for refuted in findings.refuted:
        # Their models were fitted to all rows; on those that decide they are fitted anew.
        models = (refuted.without, refuted.fitted.model)
        without, model = (fit_model(regression, model).model for model in models)
        gain = _compute_gain(findings, without, model)
        if is_significant(gain):
            yield ClosestCause(refuted, gain)


def _confirm(findings: Findings) -> ConfirmedFindings:
    plain, best = findings.baseline.model, findings.selection.best.model
    rejected: list[Untested] = []
    if findings.shape is not None and findings.named:
        same = findings.shape.same.model
        # Effects beside it must not carry a shape that gains nothing.
        gain_of_shape = _compute_gain(findings, same, best)
        if not (is_significant(gain_of_shape) or gain_of_shape.percent >= CLEAR_GAIN):
            return ConfirmedFindings((), None, gain_of_shape, (_reject(CURVE_SHAPE),))
    if findings.named or findings.shape is not None:
        gain = _compute_gain(findings, plain, best)
        is_clear = findings.shape is not None and gain.percent >= CLEAR_GAIN
        is_worth = gain.percent >= 100.0 * LEAST_GAIN
        if is_clear or (is_significant(gain) and is_worth):
            return ConfirmedFindings(findings.named, None, gain, (), findings.shape)
        why = NOT_CONFIRMED
        if is_significant(gain):
            why = f"its gain on held-out data is {gain.percent:.2g} %, too small to be named"
        rejected += [_reject(CURVE_SHAPE, why)] * (findings.shape is not None)
        rejected += [_reject(candidate.effect.id, why) for candidate in findings.named]
    channel = findings.unexplained_channel
    if channel is not None:
        gain = _compute_gain(findings, plain, plain, channel)
        if is_significant(gain):
            return ConfirmedFindings((), channel, gain, tuple(rejected))
        rejected.append(_reject(f"a dependence on {name_with_wave(channel.channel)}"))
    gain = _compute_gain(findings, plain, plain)
    return ConfirmedFindings((), None, gain, tuple(rejected))


def _compute_gain(
    findings: Findings,
    smaller: Model,
    extended: Model,
    channel: ResidualChannel | None = None,
) -> Gain:
    return compute_hold_out_gain(
        findings.regression,
        smaller,
        extended,
        channel,
        other_drives=findings.other_drives,
        noise_floor=findings.noise_floor,
        block_length_s=findings.block_length_s,
    )


def _reject(what: str, why: str = NOT_CONFIRMED) -> Untested:
    return Untested(what, why, rejected=True)
