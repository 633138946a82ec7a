"""Build the diagnosis from confirmed findings: sentences, model, evidence and plot data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.build_evidence import build_evidence, build_model_scores
from adhesion_can.diagnosis.cause_result import Cause
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.evaluate import evaluate_held_out
from adhesion_can.diagnosis.evidence import ChannelEvidence, Untested
from adhesion_can.diagnosis.extended_model import (
    SegmentFits,
    build_extended_model,
    build_spline,
    estimate_segments,
    refit_with_spline,
)
from adhesion_can.diagnosis.formatting import effect_name
from adhesion_can.diagnosis.gain_result import Gain, GainMethod
from adhesion_can.diagnosis.inference.candidates import UNTESTABLE_SHARE
from adhesion_can.diagnosis.inference.confirm_on_hold_out import ConfirmedFindings
from adhesion_can.diagnosis.inference.equivalent_effects import find_equivalent_effects
from adhesion_can.diagnosis.inference.findings import Findings
from adhesion_can.diagnosis.inference.one_speed import find_rivals_at_one_speed, is_at_one_speed
from adhesion_can.diagnosis.next_drive.remaining import RemainingExplanations
from adhesion_can.diagnosis.parameter_values import effect_title, parameter_values
from adhesion_can.diagnosis.peak_spread import compare_peaks, fit_other_forms
from adhesion_can.diagnosis.plot_data import build_plots, build_profile, find_plotted_channel
from adhesion_can.diagnosis.plot_result import Profile
from adhesion_can.diagnosis.refutation_result import build_closest, build_environments
from adhesion_can.diagnosis.regression.candidate import Candidate
from adhesion_can.diagnosis.regression.channel_splines import Channel, build_channels
from adhesion_can.diagnosis.regression.model import Model, evaluate_model
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel, fit_model
from adhesion_can.diagnosis.result import Diagnosis, Verdict
from adhesion_can.diagnosis.sentences import (
    cause_sentence,
    channel_sentence,
    name_with_wave,
    oscillation_sentence,
    saturation_sentences,
    separation_sentence,
    where_sentence,
)
from adhesion_can.diagnosis.shape_result import (
    build_family_results,
    build_shape_cause,
    find_conditions,
)
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.physics.effects.empirical import Empirical


def build_empty_diagnosis(drives: Sequence[DriveData], untested: Sequence[Untested]) -> Diagnosis:
    """Diagnosis of data that allow none."""
    return _with_inputs(Diagnosis(verdict=Verdict.NOTHING, untested=tuple(untested)), drives)


def build_diagnosis(
    drives: Sequence[DriveData],
    findings: Findings,
    confirmed: ConfirmedFindings,
    untested: Sequence[Untested],
    *,
    remaining: RemainingExplanations | None = None,
) -> Diagnosis:
    """Build the diagnosis.

    Args:
        drives: Every row of every drive, in the order of the regression's drives.
        findings: Findings of steps 2 to 6.
        confirmed: Findings that hold on the held-out data.
        untested: Effects and quantities that could not be tested, with the reason.
        remaining: What a further drive left of the explanations; None: there was no such drive.

    """
    data = findings.regression.data
    plain = findings.baseline.model
    verdict = _choose_verdict(findings, confirmed)
    extended = _fit_extension(findings, confirmed)
    profile = _build_profile(findings, confirmed, extended.model)
    refuted_effects = {} if remaining is None else remaining.refuted_effects
    causes = tuple(
        _build_cause(findings, candidate, extended.fitted, refuted_effects)
        for candidate in _sort_by_gain(findings, confirmed.named)
    )
    separations = [separation_sentence(c.effect, c.rivals) for c in causes if c.rivals]
    surfaces, longest, (drive_number, surface) = estimate_segments(
        data, findings.change_times, extended.model, extended.segment_fits
    )
    conditions = find_conditions(data, surface)
    if confirmed.shape is not None and longest is not None:
        cause = build_shape_cause(confirmed.shape, extended.fitted, surface, longest)
        causes = (cause, *causes)
    draw = partial(
        build_plots,
        data,
        drives[drive_number],
        surface,
        plain,
        extended.model,
        with_simulations=verdict is not Verdict.NOTHING,
    )
    model = build_extended_model(
        extended.model,
        extended.fitted,
        surface,
        extended.spline,
        conditions,
        compare_peaks(extended.model, extended.segment_fits.other_forms, surface, conditions),
    )
    if model is None and causes:
        # A verdict that no model file can follow is none.
        why = "it explains the data, but no curve with a peak can be fitted together with it"
        untested = [*untested, *(Untested(cause.effect, why, rejected=True) for cause in causes)]
        causes, verdict = (), Verdict.UNEXPLAINED
    gain = confirmed.gain
    if findings.other_drives and model is not None and model.actives:
        gain = _measure_on_held_out(findings, gain, model)
    confirmed = replace(confirmed, gain=gain)
    evidence = build_evidence(findings, causes, refuted_effects)
    diagnosis = Diagnosis(
        verdict=verdict,
        causes=causes,
        channel=_name_channel(findings, confirmed) if verdict is Verdict.UNEXPLAINED else None,
        wrong=tuple(_describe_findings(findings, confirmed, causes, profile)),
        gain=gain,
        evidence=evidence,
        models=build_model_scores(findings, evidence),
        channels=tuple(
            ChannelEvidence(
                name_with_wave(dependence.channel),
                dependence.channel.unit,
                dependence.p_value,
                100 * dependence.gain,
            )
            for dependence in findings.channels_of_best
        ),
        needed="; ".join(separations) or None,
        untested=(*untested, *confirmed.rejected, *_list_imitated_effects(findings)),
        surfaces=surfaces,
        model=model,
        profile=profile,
        draw=draw,
        families=build_family_results(findings, surface),
        closest=build_closest(confirmed, data),
        environments=build_environments(findings, confirmed, causes, extended.fitted.model),
        noise=findings.noise,
        saturated=bool(findings.saturated),
        oscillates=findings.oscillates,
    )
    return _with_inputs(diagnosis, drives)


def _measure_on_held_out(findings: Findings, gain: Gain, model: ExtendedModel) -> Gain:
    """The gain on whole drives as `evaluate` measures it: refitted, and as written."""
    regression = findings.regression
    blocks = regression.data.split(regression.block)
    held = np.array([bool((block < 0).all()) for block in blocks])
    part = evaluate_held_out(regression.data, held, model)
    if gain.method is not GainMethod.PLAIN:
        return replace(gain, as_written=part.as_written)
    return replace(
        gain,
        rmse_before=part.plain,
        rmse_after=part.refitted.rmse,
        percent=part.refitted.percent,
        interval=part.refitted.interval,
        as_written=part.as_written,
    )


@dataclass(frozen=True, eq=False)
class _Extension:
    """The extended model, fitted to all rows that may be used.

    Attributes:
        fitted: Fit of curves and named effects.
        spline: Spline of an unexplained channel; None: no such channel, or no model can have it.
        model: Model with effects and spline.
        segment_fits: Fits from which the curves of the segments are taken.

    """

    fitted: FittedModel
    spline: Empirical | None
    model: Model
    segment_fits: SegmentFits


def _fit_extension(findings: Findings, confirmed: ConfirmedFindings) -> _Extension:
    """Fit the extended model to all rows but those of other drives that were held out."""
    regression = findings.regression.last_fit
    named = confirmed.named or confirmed.shape is not None
    selected = findings.selection.best if named else findings.selection.plain
    fitted = plain = fit_model(regression, selected.model)
    if selected is not findings.baseline:
        plain = fit_model(regression, findings.baseline.model)
    spline = None if confirmed.channel is None else build_spline(confirmed.channel)
    model = fitted.model
    if spline is not None:
        model = refit_with_spline(findings.prepared, model, spline)
    fits = SegmentFits(plain, fitted, fit_other_forms(regression, fitted))
    return _Extension(fitted, spline, model, fits)


def _choose_verdict(findings: Findings, confirmed: ConfirmedFindings) -> Verdict:
    if confirmed.named or confirmed.shape is not None:
        return Verdict.NAMED
    if (
        findings.oscillates
        or findings.saturated
        or confirmed.channel is not None
        or confirmed.closest
    ):
        return Verdict.UNEXPLAINED
    return Verdict.UNEXPLAINED if findings.noise.is_exceeded else Verdict.NOTHING


def _build_profile(
    findings: Findings, confirmed: ConfirmedFindings, model: Model
) -> Profile | None:
    """Residual over the channel that matters, before and after; None where there is none."""
    data = findings.regression.data
    before = evaluate_model(data, findings.baseline.model.curves)
    channel: Channel | None = None
    if confirmed.shape is not None:
        slips = (channel for channel in build_channels(data, before) if channel.name == "slip")
        channel = next(slips, None)
    elif confirmed.named:
        channels = build_channels(data, before)
        channel = find_plotted_channel(data, confirmed.named[0].effect, channels)
    elif confirmed.channel is not None:
        channel = confirmed.channel.channel
    if channel is None:
        return None
    after = _compute_residual_after(findings, confirmed, model)
    change = before.residual - after
    return build_profile(data, channel, before.residual, after, change, before.predicted)


def _compute_residual_after(
    findings: Findings, confirmed: ConfirmedFindings, model: Model
) -> Array:
    """Residual of the extended model, adhesion; shape (n,)."""
    data = findings.regression.data
    channel = confirmed.channel
    if channel is not None and build_spline(channel) is None:
        # No model can have this channel: its fitted spline stands for the extension.
        before = evaluate_model(data, findings.baseline.model.curves)
        return before.residual - channel.prediction_change
    return evaluate_model(data, model.curves, model.active_effects).residual


def _with_inputs(diagnosis: Diagnosis, drives: Sequence[DriveData]) -> Diagnosis:
    """The diagnosis with the fields that describe its drives."""
    return replace(
        diagnosis,
        samples={drive.name: len(drive) for drive in drives},
        lost={
            f"{drive.name}: {reason}": count
            for drive in drives
            for reason, count in drive.lost.items()
            if count
        },
        begins={drive.name: drive.first_us for drive in drives},
        tables=any(drive.table for drive in drives),
    )


def _sort_by_gain(findings: Findings, named: Sequence[Candidate]) -> list[Candidate]:
    """Named effects, the one that alone gains most first."""
    alone = {
        single.candidates[0]: single.cross_validated_square for single in findings.selection.singles
    }
    return sorted(named, key=lambda candidate: alone.get(candidate, np.inf))


def _build_cause(
    findings: Findings,
    candidate: Candidate,
    final: FittedModel,
    refuted: Mapping[tuple[str, int], float],
) -> Cause:
    """A named effect with the parameters of the final fit."""
    effect = candidate.effect
    has_load = any(drive.has_load for drive in findings.regression.data.drives)
    place = final.model.candidates.index(candidate)
    values = parameter_values(final, place, has_load=has_load)
    return Cause(
        effect.id,
        effect.form,
        effect_title(effect, values[0]),
        effect.literature,
        values,
        findings.p_value(candidate),
        _find_rivals(findings, candidate, values[0].value, refuted),
        findings.selection.formulas.get(effect.id, ()),
    )


def _find_rivals(
    findings: Findings, candidate: Candidate, size: float, refuted: Mapping[tuple[str, int], float]
) -> tuple[str, ...]:
    """Ids of the effects that the data cannot distinguish from a named one.

    What a further drive refuted is none of them.
    """
    selected = set(findings.selection.rivals(candidate))
    contradicted = {effect for effect, _ in refuted} - selected
    rivals = selected | (set(find_equivalent_effects(findings, candidate)) - contradicted)
    if is_at_one_speed(findings.regression.data.drives):
        known = findings.selection.best.ids
        rivals |= find_rivals_at_one_speed(candidate, size, findings.prepared.candidates) - known
    return tuple(sorted(rivals))


def _list_imitated_effects(findings: Findings) -> list[Untested]:
    """Effects that the curve imitates so well that the data do not identify them."""
    out = {}
    absorbed_shares = findings.detection.absorbed
    pairs = list(zip(findings.prepared.candidates, absorbed_shares, strict=True))
    shown = {candidate.effect.id for candidate, absorbed in pairs if absorbed < UNTESTABLE_SHARE}
    for candidate, absorbed in pairs:
        effect = candidate.effect
        if absorbed >= UNTESTABLE_SHARE and candidate not in findings.selection.best.candidates:
            out[effect_name(effect.id, effect.form if effect.id in shown else "")] = (
                f"the parameters of the curve can imitate {100 * absorbed:.1f} % of it in these "
                "data"
            )
    return [Untested(what, why) for what, why in out.items()]


def _name_channel(findings: Findings, confirmed: ConfirmedFindings) -> str | None:
    """Channel of an unexplained residual; None where it is not a matter of one channel."""
    if findings.saturated:
        return "tractive_effort"
    if findings.oscillates or confirmed.channel is None:
        return None
    return confirmed.channel.channel.name


def _describe_findings(
    findings: Findings,
    confirmed: ConfirmedFindings,
    causes: Sequence[Cause],
    profile: Profile | None,
) -> list[str]:
    """A sentence for each finding, and one about where the plain model is wrong most."""
    out = [cause_sentence(cause, alone=len(causes) == 1) for cause in causes]
    out += saturation_sentences(findings.saturated)
    if findings.oscillates and findings.oscillation is not None:
        out.append(oscillation_sentence(findings.oscillation))
    if confirmed.channel is not None:
        out.append(channel_sentence(confirmed.channel))
    if out and profile is not None:
        out.append(where_sentence(profile, confirmed.gain))
    return out
