"""What was found, in plain sentences with sizes and units."""

from collections.abc import Mapping, Sequence

import numpy as np

from adhesion_can.diagnosis.formatting import channel_name, measured, short, unit_text
from adhesion_can.diagnosis.inference.channel_splines import Channel
from adhesion_can.diagnosis.inference.find_residual_channels import Left, Line
from adhesion_can.diagnosis.result import Cause, Gain, Profile

SHOWN: Mapping[str, str] = {
    "speed_dependence": "speed",
    "load_dependence": "axle_load",
    "falling_friction": "creep_speed",
    "wheelset_inertia": "slip_rate",
    "wheel_radius": "axle",
    "speed_scale": "signed_slip",
    "speed_delay": "slip_rate",
    "effort_delay": "slip_rate",
    "effort_bias": "signed_slip",
    "creep_relaxation": "slip_rate",
    "curve_creep": "curvature_per_m",
    "rail_cleaning": "axle",
    "adhesion_recovery": "slip",
    "humidity": "relative_humidity_percent",
    "rail_temperature": "rail_temperature_degC",
    "sanding": "sanding_active",
    "slow_drift": "time",
    "traction_braking_asymmetry": "signed_slip",
}
"""Channel against which an effect is shown."""

_GOES_WITH: Mapping[str, str] = {
    "speed_dependence": "the speed",
    "load_dependence": "the axle load",
    "falling_friction": "creep speed beyond the peak",
    "wheelset_inertia": "the acceleration of spinning wheels",
    "wheel_radius": "coasting of the axle beside the others",
    "speed_scale": "coasting at several speeds",
    "speed_delay": "acceleration of the vehicle",
    "effort_delay": "quick changes of effort at a steady creep",
    "effort_bias": "coasting and braking",
    "creep_relaxation": "quick changes of creep at low and at high speed",
    "curve_creep": "lateral creep",
    "rail_cleaning": "which axle leads",
    "adhesion_recovery": "how long a creep is held",
    "humidity": "the humidity",
    "rail_temperature": "the rail's temperature",
    "sanding": "sanding",
    "slow_drift": "time",
    "traction_braking_asymmetry": "traction and braking at the same creep",
}
_SEPARATE: Mapping[frozenset[str], str] = {
    frozenset({"effort_delay", "creep_relaxation"}): (
        "the same creep sweep at a third and at three times the speed: a delay stays the same in "
        "seconds, a relaxation length in metres"
    ),
    frozenset({"effort_bias", "traction_braking_asymmetry"}): (
        "coasting, where a bias stays and an asymmetry has nothing to act on, and braking and "
        "traction at small and at large creep"
    ),
    frozenset({"effort_bias", "speed_scale"}): (
        "coasting at several speeds: a bias is a force, a scale error a share of the speed"
    ),
    frozenset({"speed_scale", "traction_braking_asymmetry"}): (
        "coasting, and braking beyond the peak, where a small error of the slip does nothing"
    ),
    frozenset({"speed_dependence", "falling_friction"}): (
        "creep swept beyond the peak at low and at high speed: one falls with the speed at the "
        "same slip, the other with creep speed alone"
    ),
    frozenset({"adhesion_recovery", "falling_friction"}): (
        "the same creep held for seconds and passed quickly: recovery needs time"
    ),
    frozenset(
        {"humidity", "slow_drift"}
    ): "a longer drive, in which humidity comes back to where it was",
    frozenset({"rail_temperature", "slow_drift"}): (
        "a longer drive, in which the rail's temperature comes back to where it was"
    ),
    frozenset({"rail_cleaning", "load_dependence"}): (
        "a drive in reverse: the leading axle is another one then, its load is not"
    ),
    frozenset({"rail_cleaning", "wheel_radius"}): "a drive in reverse, and coasting of every axle",
}


def separating(effect: str, rivals: Sequence[str]) -> str:
    """Which manoeuvre or signal would tell an effect from its rivals."""
    words = [_SEPARATE.get(frozenset({effect, rival})) or _apart(effect, rival) for rival in rivals]
    return f"to tell {effect} from {', '.join(rivals)}: " + "; ".join(dict.fromkeys(words))


def _apart(effect: str, rival: str) -> str:
    """A manoeuvre in general: what each of two effects goes with, without the other."""
    mine, theirs = _GOES_WITH.get(effect, effect), _GOES_WITH.get(rival, rival)
    return f"a drive in which {mine} and {theirs} vary independently of each other"


def cause_sentence(cause: Cause) -> str:
    """An effect with its size."""
    sizes = ", ".join(f"{v.name} {measured(v.value, v.std, v.unit)}" for v in cause.parameters)
    return f"{cause.title[0].upper()}{cause.title[1:]} ({sizes})."


def where_sentence(profile: Profile, gain: Gain) -> str:
    """Where the plain model is wrong most, and by how much."""
    lead = (
        f"On data that were held out the simulation misses the adhesion by {gain.rmse_before:.4f} "
        f"(rms)"
    )
    if gain.rmse_after < gain.rmse_before:
        lead += f"; with this in the model {gain.rmse_after:.4f} are left"
    sure = np.abs(profile.before) > 2.0 * profile.before_std
    size = np.where(sure, np.abs(profile.before), 0.0)
    best = int(np.argmax(size)) if len(size) else 0
    if not len(size) or size[best] == 0.0:
        return f"{lead}."
    much = "too little" if profile.before[best] > 0 else "too much"
    at = f"{short(float(profile.at[best]))} {unit_text(profile.unit)}".strip()
    return (
        f"{lead}. It is worst where {channel_name(profile.channel)} is about {at}: "
        f"{size[best]:.4f} {much} there."
    )


def channel_label(channel: Channel) -> str:
    """Name of a channel, with the length of a wave in it."""
    return f"{channel.name}, wave of {channel.period:.1f} m" if channel.period else channel.name


def channel_sentence(left: Left) -> str:
    """What an unexplained residual depends on."""
    share = f"{100 * left.gain:.1f} % of the error (rms) on the data that decided"
    if left.channel.period:
        return (
            f"The adhesion varies along the rail in a wave of {left.channel.period:.1f} m, as no "
            f"known effect does it: {share}."
        )
    return (
        f"The adhesion depends on {channel_name(left.channel.name)} in a way that no known effect "
        f"describes: {share}."
    )


def line_sentence(line: Line) -> str:
    """An oscillation of the drive train."""
    return (
        f"The wheel speeds swing at {line.frequency:.1f} Hz by about {line.amplitude:.3f} rad/s: a "
        f"torsional vibration, which in the force balance is {line.adhesion:.4f} of adhesion (rms)."
    )


def pinned_sentences(found: Sequence[tuple[str, int, float, float]]) -> list[str]:
    """Sensors at their limit: recording, axle, largest effort, share of the readings at it."""
    out = []
    for recording in dict.fromkeys(one[0] for one in found):
        mine = [one for one in found if one[0] == recording]
        axles = ", ".join(str(one[1]) for one in mine)
        most = max(one[2] for one in mine)
        shares = [100 * one[3] for one in mine]
        out.append(
            f"The tractive effort in {recording} is cut off at {most / 1e3:.2f} kN: so stand "
            f"{min(shares):.1f} to {max(shares):.1f} % of the readings (axle {axles})."
        )
    return out
