"""What to do after `check`, `calibrate`, `replay`, `identify` and `evaluate`."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from adhesion_can.calibration.agreement import differs
from adhesion_can.calibration.fit import AxleRadius, Calibration
from adhesion_can.diagnosis.model_worth import ModelWorth, describe_gain, judge_model
from adhesion_can.estimation.batch_result import BatchResult, Segment
from adhesion_can.offline.check import CheckResult
from adhesion_can.offline.check_table import TableCheck
from adhesion_can.offline.recording_fit import BusMisfit
from adhesion_can.physics.doubt import DESCRIPTIONS, Doubt
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.objection import NEEDS_RELIEF, WORDINGS, Objection
from adhesion_can.reporting.check_words import WRONG
from adhesion_can.reporting.next_steps.next_step import LIVE, NextStep, Typed
from adhesion_can.reporting.objections import ObjectionLog, Stretch
from adhesion_can.result_text import TimeScale

if TYPE_CHECKING:
    # `check` and `replay` end here too, and need none of what an evaluation imports.
    from adhesion_can.diagnosis.evaluate import Evaluation

BEYOND = "record a drive that sweeps the slip beyond the peak in traction and in braking"


def after_check(results: Sequence[CheckResult | TableCheck], typed: Typed) -> NextStep:
    """Whether the data are usable, and what to do next."""
    failures = WRONG.lines(results)
    for misfit in (result.misfit for result in results if isinstance(result, CheckResult)):
        if misfit is not None:
            return _after_misfit(misfit, typed)
    if failures:
        which = "this fault" if len(failures) == 1 else f"these {len(failures)} faults"
        return NextStep(
            "The data are not usable yet.",
            f"fix {which}, then {typed.on_inputs('check')}",
        )
    fits = [result.fit for result in results if result.fit is not None]
    if not fits:
        return NextStep(
            "The data are readable, but adhesion cannot be computed from them.",
            "add the missing roles or columns, then " + typed.on_inputs("check"),
        )
    if not any(segment.estimate.identifiable.both for fit in fits for segment in fit.segments):
        if any(_is_hidden(segment) for fit in fits for segment in fit.segments):
            return NextStep(
                "The data are readable, but no peak is identifiable.", typed.on_inputs("diagnose")
            )
        return NextStep(
            "The data are readable, but no peak is identifiable.",
            f"{BEYOND}, then {typed.command('check', typed.new_file('NEW'))}",
        )
    name = "identify" if typed.tables else "replay"
    return NextStep("The data are usable, and a peak is identifiable.", typed.on_inputs(name))


def after_identification(result: BatchResult, typed: Typed) -> NextStep:
    """The peak where there is one, and what to do next."""
    known = [segment.estimate for segment in result.segments if segment.estimate.identifiable.both]
    if not known and not any(map(_is_hidden, result.segments)):
        again = typed.command("identify", typed.new_file("NEW"))
        return NextStep("The data do not show a peak.", f"{BEYOND}, then {again}")
    if not known:
        return NextStep("No peak is identifiable.", typed.on_inputs("diagnose"))
    count = f"{len(known)} of {len(result.segments)} surfaces have a peak"
    finding = f"{_peak(known[0])}." if len(result.segments) == 1 else f"{count}."
    if typed.model is not None:
        return NextStep(finding, typed.on_inputs("evaluate", "--model", typed.model))
    return NextStep(finding, typed.on_inputs("diagnose"))


def after_replay(
    last: Estimate | None,
    doubts: Sequence[Doubt],
    objections: ObjectionLog,
    typed: Typed,
    dropped: Mapping[str, int] | None = None,
) -> NextStep:
    """What the service ended with, and what to do next.

    Args:
        last: Last estimate; None: there is none.
        doubts: What the service doubted, the most frequent first.
        objections: Objections of the drive.
        typed: What the user typed.
        dropped: Number of wheel speeds that gave no sample, by reason, where none gave one.

    """
    if objections.foremost is not None:
        return _after_objection(objections.foremost, objections.times, typed)
    doubt = next((doubted for doubted in doubts if doubted in DESCRIPTIONS), None)
    if doubt is not None:
        finding = f"The service doubts its curve: {DESCRIPTIONS[doubt]}."
        if typed.model is None:
            return NextStep(finding, typed.on_inputs("diagnose"))
        # The diagnosis of these data has made the model: it would say the same again.
        again = typed.command("evaluate", typed.new_file("OTHER"), *_model(typed))
        return NextStep(f"With the model too: {finding}", f"test it on another drive: {again}")
    if last is None:
        reasons = ", ".join(f"{why} ({count})" for why, count in (dropped or {}).items())
        why = f": no sample could be formed: {reasons}" if reasons else ""
        return NextStep(f"The service found no curve{why}.", typed.on_inputs("check"))
    if not last.identifiable.both:
        return NextStep("The drive ends without an identifiable peak.", typed.on_inputs("identify"))
    return NextStep(
        f"{_peak(last)}, and the service has no doubt.",
        typed.command("run", *LIVE, *_model(typed)),
    )


def after_evaluation(evaluation: "Evaluation", typed: Typed) -> NextStep:
    """What the model is worth on these data, and what to do next.

    Args:
        evaluation: Result of the evaluation.
        typed: What the user typed; with a model.

    """
    refitted = evaluation.total.refitted
    worth = judge_model(refitted)
    finding = f"{worth.finding}: gain {describe_gain(refitted)}."
    model = _model(typed)
    again = typed.command("evaluate", typed.new_file("OTHER"), *model)
    actions = {
        ModelWorth.USEFUL: (
            typed.command("run", *LIVE, *model)
            if typed.tables
            else typed.on_inputs("replay", *model)
        ),
        ModelWorth.SMALL: f"record a drive in which they act, then {again}",
        ModelWorth.UNKNOWN: f"record a longer drive, then {again}",
    }
    return NextStep(
        finding, actions.get(worth) or typed.on_inputs("diagnose", "--extended", "NEW.toml")
    )


def _after_objection(longest: Stretch, times: TimeScale, typed: Typed) -> NextStep:
    """What is objected to, and the instrument or setting to check; `check` would see no more."""
    objection = longest.objection
    when = times.span(longest.from_us, longest.to_us)
    finding = f"The service objects to the readings, longest at {when} s: "
    again = typed.command("replay", typed.new_file("NEW"), *_model(typed))
    if objection in NEEDS_RELIEF:
        action = f"record a drive with more reliefs ({WORDINGS[objection].fix}), then {again}"
    elif objection in _INSTRUMENTS:
        action = f"check {_INSTRUMENTS[objection]} at this time, record again, then {again}"
    else:
        action = f"{WORDINGS[objection].fix}, then {typed.on_inputs('replay', *_model(typed))}"
    return NextStep(f"{finding}{WORDINGS[objection].what}.", action)


_INSTRUMENTS = {
    Objection.SPEED_JUMP: "the vehicle speed's instrument",
    Objection.WHEELS_JUMP: "the wheel-speed sensors",
    Objection.EFFORTS_JUMP: "the source of the tractive efforts",
    Objection.LOADS_JUMP: "the axle-load sensors",
    Objection.SPEED_DEVIATES: "the vehicle speed's instrument",
    Objection.SLIPS_BEYOND_MODEL: "the wheel-speed sensors and the vehicle speed's instrument",
}
"""What measures the readings of an objection; a setting is to be checked for the others."""


def _model(typed: Typed) -> tuple[Path | str, ...]:
    """Option of the model that was used."""
    return () if typed.model is None else ("--model", typed.model)


def _after_misfit(misfit: BusMisfit, typed: Typed) -> NextStep:
    finding = (
        "The recording is of another bus than the configuration."
        if misfit.of_other_bus
        else "The recording lacks messages that are needed."
    )
    if misfit.of_other_bus and not typed.configuration:
        again = typed.on_inputs("check", "--config", "F")
        made = typed.command("init", "--dbc", "YOUR.dbc", "--out", "F")
        return NextStep(finding, f"{again} (F: this vehicle's configuration; {made} writes it)")
    return NextStep(finding, f"{misfit.fix}, then {typed.on_inputs('check')}")


def _is_hidden(segment: Segment) -> bool:
    """Whether slips reach a peak that an error of an instrument or of the model may hide."""
    return segment.missing.by_noise or bool(segment.directions.sentence)


def _peak(estimate: Estimate) -> str:
    return f"The peak is {estimate.mu_max:.3f} at slip {estimate.lambda_m:.3f}"


CALIBRATED = "calibrated.toml"
"""Name of the configuration that the user has not named."""


def after_calibration(calibration: Calibration, typed: Typed, rim: Collection[int]) -> NextStep:
    """Whether the radii agree with the configuration, and what to do next.

    Args:
        calibration: Result of the calibration.
        typed: What the user typed.
        rim: Axles whose wheel speed is given as speed of the rim.

    """
    differing = [axle for axle in calibration.axles if differs(axle, calibration)]
    target = typed.outputs.get("--out")
    if not differing:
        return NextStep("The radii agree with the configuration.", typed.on_inputs("diagnose"))
    finding = " ".join(_describe(axle, rim) for axle in differing)
    if target is None:
        return NextStep(finding, typed.on_inputs("calibrate", "--out", CALIBRATED))
    # The database is in the new configuration.
    renewed = typed.with_configuration(target)
    return NextStep(finding, renewed.on_inputs("diagnose"))


def _describe(axle: AxleRadius, rim: Collection[int]) -> str:
    percent = 100.0 * (axle.ratio - 1.0)
    share = f"{abs(percent):.2f} % {'smaller' if percent < 0 else 'larger'} than configured"
    if axle.axle in rim:
        return f"Axle {axle.axle}'s wheel is {share} (its signal is a rim speed)."
    return (
        f"Axle {axle.axle}'s wheel is {share}: {axle.configured * axle.ratio:.4f} m, not "
        f"{axle.configured:.4f}."
    )
