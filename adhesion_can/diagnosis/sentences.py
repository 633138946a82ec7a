"""What was found, in plain sentences with sizes and units."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from adhesion_can.diagnosis.cause_result import Cause
from adhesion_can.diagnosis.formatting import measured, short, sizes, three_digits, unit_text
from adhesion_can.diagnosis.gain_result import Gain
from adhesion_can.diagnosis.inference.find_residual_channels import ResidualChannel
from adhesion_can.diagnosis.inference.signal_faults import DriveTrainOscillation, SaturatedSensor
from adhesion_can.diagnosis.plot_result import Profile
from adhesion_can.diagnosis.regression.channel_splines import Channel
from adhesion_can.diagnosis.result import Diagnosis
from adhesion_can.physics.channels import channel_label
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.effects import Observability, forms_of_effect
from adhesion_can.physics.effects.formula import FORMULA
from adhesion_can.physics.effects.shape_factor import CURVE_SHAPE
from adhesion_can.physics.effects.shape_factor import OBSERVABILITY as SHAPE_OBSERVABILITY


def separation_sentence(effect: str, rivals: Sequence[str]) -> str:
    """Manoeuvres or signals that would separate an effect from its rivals, all by their ids."""
    ways = [_separation(_observability(effect), _observability(rival)) for rival in rivals]
    what = f"to distinguish {effect} from {' or '.join(rivals)}"
    return f"{what}, record {'; and '.join(map(_with_reason, dict.fromkeys(ways)))}"


def _with_reason(manoeuvre: str) -> str:
    """A manoeuvre with the reason behind its colon in brackets."""
    head, _, reason = manoeuvre.partition(": ")
    return f"{head} ({reason})" if reason else head


class _Shown(NamedTuple):
    """Id of an effect, and how it shows."""

    id: str
    observability: Observability


def _observability(effect: str) -> _Shown:
    if effect == FORMULA:
        return _Shown(effect, Observability(excitation="the channels of the formula"))
    if effect == CURVE_SHAPE:
        return _Shown(effect, SHAPE_OBSERVABILITY)
    forms = [form.observability for form in forms_of_effect(effect)]
    separations = tuple(
        dict.fromkeys(separation for form in forms for separation in form.separations)
    )
    return _Shown(effect, replace(forms[0], separations=separations))


def _separation(effect: _Shown, rival: _Shown) -> str:
    """A manoeuvre that one of two effects states, or else one in general."""
    for shown, other in ((effect, rival), (rival, effect)):
        for separation in shown.observability.separations:
            if separation.rival == other.id:
                return separation.manoeuvre
    mine, theirs = (name.observability.excitation or name.id for name in (effect, rival))
    return f"a drive in which {mine} and {theirs} vary independently of each other"


def cause_sentence(cause: Cause, *, alone: bool) -> str:
    """An effect with its size; `alone`: whether it is the only cause."""
    if cause.effect == CURVE_SHAPE:
        return _shape_sentence(cause, alone=alone)
    return f"{cause.title[0].upper()}{cause.title[1:]} ({sizes(cause.parameters)})."


def _shape_sentence(cause: Cause, *, alone: bool) -> str:
    """The shape of the curve, with what it moves: the peak before and after.

    Where an effect scales the adhesion, as a load dependence does, the curve by itself may be far
    above or below what was measured.
    """
    value = {v.name: measured(v.value, v.std, v.unit) for v in cause.parameters}
    beside = "" if alone else " (of the curve alone; the other effects also change the adhesion)"
    return (
        f"{cause.title[0].upper()}{cause.title[1:]}: {FAMILIES[cause.form].title} fits better. "
        f"The peak moves from {value['mu_max_before']} at slip {value['lambda_m_before']} to "
        f"{value['mu_max_after']} at slip "
        f"{value['lambda_m_after']}{beside}."
    )


def where_sentence(profile: Profile, gain: Gain) -> str:
    """Where the plain model is wrong most, and by how much."""
    lead = f"On held-out data, the RMSE of the adhesion is {three_digits(gain.rmse_before)}"
    if gain.rmse_after < gain.rmse_before:
        lead += f" with the plain curve and {three_digits(gain.rmse_after)} with this in the model"
    sure = np.abs(profile.before) > 2.0 * profile.before_std
    size = np.where(sure, np.abs(profile.before), 0.0)
    best = int(np.argmax(size)) if len(size) else 0
    if not len(size) or size[best] == 0.0:
        return f"{lead}."
    side = "low" if profile.before[best] > 0 else "high"
    at = f"{short(float(profile.at[best]))} {unit_text(profile.unit)}".strip()
    return (
        f"{lead}. In all data, the mean error of the plain curve is largest where "
        f"{channel_label(profile.channel)} is about {at}: there the simulated adhesion is "
        f"{three_digits(float(size[best]))} too {side}."
    )


def name_with_wave(channel: Channel) -> str:
    """Name of a channel, with the length of a wave in it."""
    return f"{channel.name}, wave of {channel.period:.1f} m" if channel.period else channel.name


def unexplained_clause(diagnosis: Diagnosis) -> str:
    """What no known effect explains, a clause: the residual depends on no single channel."""
    if diagnosis.oscillates:
        return "the wheel speeds oscillate"
    if diagnosis.noise is not None and diagnosis.noise.is_exceeded:
        return "more is left than sensor noise explains"
    if diagnosis.closest:
        return "an effect that helps is refuted as the cause"
    return "the plain curve does not explain the data"


def channel_sentence(residual_channel: ResidualChannel) -> str:
    """What an unexplained residual depends on."""
    channel = residual_channel.channel
    share = f"{100 * residual_channel.gain:.1f} % of the RMSE on the deciding data"
    if channel.period:
        return (
            f"The adhesion varies along the rail in a wave of {channel.period:.1f} m, which no "
            f"known effect explains: {share}."
        )
    return (
        f"The adhesion depends on {channel_label(channel.name)} in a way that no known effect "
        f"describes: {share}."
    )


def oscillation_sentence(oscillation: DriveTrainOscillation) -> str:
    """An oscillation of the drive train."""
    return (
        f"The wheel speeds oscillate at {oscillation.frequency:.1f} Hz by about "
        f"{oscillation.amplitude:.3f} rad/s: a torsional vibration of {oscillation.adhesion:.4f} "
        "of adhesion in the force balance (RMS)."
    )


def saturation_sentences(sensors: Sequence[SaturatedSensor]) -> list[str]:
    """A sentence for each recording with sensors that are cut off at a limit."""
    out = []
    for recording in dict.fromkeys(sensor.recording for sensor in sensors):
        recording_sensors = [sensor for sensor in sensors if sensor.recording == recording]
        axles = ", ".join(str(sensor.axle) for sensor in recording_sensors)
        most = max(sensor.effort for sensor in recording_sensors)
        shares = [100 * sensor.share for sensor in recording_sensors]
        least, other = (f"{share:.1f}" for share in (min(shares), max(shares)))
        share = least if least == other else f"{least} to {other}"
        whose = f"axle {axles}" if len(recording_sensors) == 1 else f"axles {axles}"
        out.append(
            f"The tractive effort in {recording} is cut off at {most / 1e3:.2f} kN: {share} % of "
            f"the readings of {whose} are at this limit."
        )
    return out
