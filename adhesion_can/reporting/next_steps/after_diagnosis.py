"""What to do after a diagnosis."""

import keyword
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from adhesion_can.bus.roles import packaged_choices
from adhesion_can.config import Configuration
from adhesion_can.diagnosis.result import Diagnosis, Verdict
from adhesion_can.diagnosis.sentences import unexplained_clause
from adhesion_can.physics.channels import channel_label, model_channel
from adhesion_can.physics.effects.expression import FUNCTIONS, LAG
from adhesion_can.physics.effects.formula import CONTACT_CHANNELS
from adhesion_can.reporting.next_steps.next_step import LIVE, NextStep, Typed
from adhesion_can.reporting.next_steps.quantities import Meaning, describe_cause

WHEEL_RADIUS = "wheel_radius"
PLAN, MODEL, CALIBRATED = "plan.toml", "model.toml", "calibrated.toml"
"""Names of files that the user has not named."""
_SIZE = "a"
"""Constant of a law that is proposed."""
_NO_FORMULA = ("time_s", "axle")
"""Channels of a contact that no formula for the adhesion has."""
DRIVE = "record a drive that sweeps the slip in traction and braking for four minutes"


def after_diagnosis(diagnosis: Diagnosis, typed: Typed, configuration: Configuration) -> NextStep:
    """What was found, and what to do next."""
    if diagnosis.gain is None:
        finding = "These data allow no verdict."
        return NextStep(finding, f"{DRIVE}, then {typed.command('diagnose', _new(typed))}")
    meanings = [
        describe_cause(cause, configuration, alone=len(diagnosis.causes) == 1, tables=typed.tables)
        for cause in diagnosis.causes
    ]
    finding = " ".join([*(meaning.text for meaning in meanings), *_reservations(diagnosis)])
    return NextStep(finding, _action(diagnosis, typed, meanings, configuration))


def _new(typed: Typed) -> str:
    return typed.new_file("NEW")


# ----------------------------------------------------------------------------------- findings


def _reservations(diagnosis: Diagnosis) -> list[str]:
    """Rivals, what is unexplained, and why there is no plan: sentences behind the causes."""
    said = [
        f"These data cannot distinguish {cause.effect} from {' or '.join(cause.rivals)}."
        for cause in diagnosis.causes
        if cause.rivals
    ]
    if diagnosis.verdict is Verdict.UNEXPLAINED:
        said.append(_unexplained(diagnosis))
    elif diagnosis.verdict is Verdict.NOTHING and diagnosis.conclusive:
        said.append("The residual of the plain curve is noise.")
    elif diagnosis.verdict is Verdict.NOTHING:
        said.append("These data cannot show whether the plain curve is right.")
    planned = diagnosis.next_drive
    if planned is not None and planned.plan is None:
        said.append(planned.sentence)
    return said


def _unexplained(diagnosis: Diagnosis) -> str:
    if diagnosis.channel is None:
        what = unexplained_clause(diagnosis)
        return f"{what[0].upper()}{what[1:]}, and no known effect explains it."
    return (
        f"The error of the plain curve depends on {channel_label(diagnosis.channel)}, and no known "
        "effect explains it."
    )


# ------------------------------------------------------------------------------------ actions


def _action(
    diagnosis: Diagnosis, typed: Typed, meanings: list[Meaning], configuration: Configuration
) -> str:
    planned = diagnosis.next_drive
    if planned is not None and planned.plan is not None:
        plan = typed.outputs.get("--next-drive", PLAN)
        drive = typed.command("control", "--plan", plan, *LIVE)
        return (
            f"drive the plan with {drive} (simulated: {_simulated(plan, typed)}), "
            f"then {_together(typed)}"
        )
    if diagnosis.verdict is Verdict.UNEXPLAINED:
        return _after_unexplained(diagnosis, typed)
    if diagnosis.verdict is Verdict.NAMED:
        return _after_named(diagnosis, typed, meanings, configuration)
    if diagnosis.conclusive:
        # The curve explains these data: nothing is left to look for.
        return typed.on_inputs("identify") if typed.tables else typed.command("run", *LIVE)
    return f"record a longer drive with more excitation, then {_together(typed)}"


def _after_named(
    diagnosis: Diagnosis, typed: Typed, meanings: list[Meaning], configuration: Configuration
) -> str:
    if any(cause.rivals for cause in diagnosis.causes):
        return _distinguish(diagnosis, typed)
    if all(meaning.setting for meaning in meanings) and not _lacks_roles(meanings, configuration):
        return _correct(diagnosis, typed, meanings)
    use = _use_model(typed)
    late = any(cause.effect.endswith("_delay") for cause in diagnosis.causes)
    return f"{use} (no key of the configuration corrects a delay)" if late else use


def _lacks_roles(meanings: list[Meaning], configuration: Configuration) -> bool:
    """Whether a default role is to be corrected: one role in a file replaces all of them."""
    is_default = set(configuration.choices) == set(packaged_choices())
    return is_default and any(meaning.in_roles for meaning in meanings)


def _simulated(plan: Path | str, typed: Typed) -> str:
    """The same drive on the simulated locomotive."""
    drive = ("--scenario", "sweep", "--closed-loop", "--plan", plan)
    return typed.command("simulate", *drive, "--log", typed.new_file("NEW"))


def _distinguish(diagnosis: Diagnosis, typed: Typed) -> str:
    """The drive that distinguishes what is left."""
    if diagnosis.next_drive is None and not typed.tables:
        return typed.on_inputs("diagnose", "--next-drive", PLAN)
    if diagnosis.needed:
        return f"{diagnosis.needed}; then {_together(typed)}"
    return f"record a longer drive under other conditions, then {_together(typed)}"


def _after_unexplained(diagnosis: Diagnosis, typed: Typed) -> str:
    if diagnosis.saturated:
        return "widen the range of the clipped effort signals, and record the drive again"
    if diagnosis.closest:
        return _distinguish(diagnosis, typed)
    if diagnosis.oscillates:
        return f"find what makes the wheels oscillate, record again, then {_diagnose_new(typed)}"
    law = _linear_law(diagnosis)
    if law is not None and not any(law.name in formula for formula in typed.formulas):
        tested = typed.on_inputs("diagnose", "--formula", law.text)
        return f"test a law of your own in {law.label} (the formula is an example): {tested}"
    if diagnosis.next_drive is None and not typed.tables:
        return typed.on_inputs("diagnose", "--next-drive", PLAN)
    source = "a column" if typed.tables else "a signal under [channels]"
    return f"record the quantity that may be the cause as {source}, then {_diagnose_new(typed)}"


class _Law(NamedTuple):
    """A linear law of the channel on which the residual depends.

    Attributes:
        name: Name of the channel in formulas.
        label: Label of the channel in sentences.
        text: Formula that can be typed.

    """

    name: str
    label: str
    text: str


def _linear_law(diagnosis: Diagnosis) -> _Law | None:
    """The law to try first; None where the residual depends on nothing that a formula can have."""
    channel = diagnosis.channel
    if channel is None:
        return None
    in_contact = {known: name for name, known in CONTACT_CHANNELS.items()}
    name = in_contact.get(channel) or model_channel(channel)
    if not name or name in _NO_FORMULA:
        return None
    profile = diagnosis.profile
    reach = 0.0
    if profile is not None and profile.channel == channel and len(profile.at):
        reach = float(np.abs(profile.at).max())
    # A tenth of the adhesion at the end of the range: the fit starts from there.
    start = 0.1 / reach if reach > 0.0 else 0.01
    is_word = name.isidentifier() and not keyword.iskeyword(name)
    term = name if is_word and name not in (_SIZE, LAG, *FUNCTIONS) else f'"{name}"'
    text = f"1 + {_SIZE} * {term} where {_SIZE}={start:.1g}"
    return _Law(name, channel_label(channel), text)


def _diagnose_new(typed: Typed) -> str:
    """The diagnosis of a further drive on its own."""
    return replace(typed, inputs=(Path(_new(typed)),)).on_inputs("diagnose")


def _correct(diagnosis: Diagnosis, typed: Typed, meanings: list[Meaning]) -> str:
    """Correct the configuration, by `calibrate` where it measures what is wrong."""
    settings = " and ".join(meaning.setting for meaning in meanings)
    write = f"write {settings} in the configuration"
    if all(cause.effect == WHEEL_RADIUS for cause in diagnosis.causes):
        return f"{typed.on_inputs('calibrate', '--out', CALIBRATED)}, or {write}"
    return f"{write}, then {typed.on_inputs('diagnose')}"


def _use_model(typed: Typed) -> str:
    """Write the extended model, confirm it on another drive, use it: what is not yet done."""
    written = typed.outputs.get("--extended")
    model = written or Path(MODEL)
    if typed.holdout:
        other = replace(typed, inputs=typed.holdout[:1])
        use = other.on_inputs("identify" if typed.tables else "replay", "--model", model)
    else:
        other = replace(typed, inputs=(Path(typed.new_file("OTHER")),))
        use = f"confirm it on another drive: {other.on_inputs('evaluate', '--model', model)}"
    return use if written else f"{typed.on_inputs('diagnose', '--extended', model)}, then {use}"


def _together(typed: Typed) -> str:
    """The diagnosis of the inputs together with a further drive."""
    return typed.on_inputs("diagnose", _new(typed))
