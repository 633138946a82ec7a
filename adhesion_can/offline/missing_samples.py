"""Why a recording gives no samples, or those of an axle: cycles, standing signals, slow speeds."""

from collections.abc import Mapping

from adhesion_can.bus.roles import cycles_by_role
from adhesion_can.config import UNKNOWN_CYCLE, Configuration
from adhesion_can.offline.scan import SignalRange
from adhesion_can.physics.readings import REQUIRED, ROLE_UNITS, Role

LEAST_READINGS = 10
"""Number of readings from which a value that stays is reported."""
STANDING: Mapping[Role, str] = {
    Role.WHEEL_SPEED: "no axle turns there, or nothing is sent in the signal",
    Role.VEHICLE_SPEED: "the vehicle does not move, or nothing is sent in the signal",
    Role.TRACTIVE_EFFORT: "the drive is off, or nothing is sent in the signal",
}
"""Meaning of a signal that reads 0 throughout, by role."""


def describe_dropped(dropped: Mapping[str, int], configuration: Configuration) -> dict[str, int]:
    """Number of readings without a sample by reason, limits of the configuration with values."""
    v_min = configuration.sampling.v_min
    words = {"below v_min": f"vehicle speed below v_min = {v_min:g} m/s in [sampling]"}
    return {words.get(why, why): count for why, count in dropped.items()}


def unknown_cycles(configuration: Configuration, measured: Mapping[str, float]) -> list[str]:
    """A sentence for each message without a cycle, with the line to write.

    Args:
        configuration: Messages of the roles.
        measured: Mean cycle of messages in the recording, ms, by name.

    """
    what, usual = UNKNOWN_CYCLE
    sentences = []
    for name in configuration.unknown_cycles():
        fix = usual
        if name in measured:
            fix = (
                f"write cycle_ms = {measured[name]:.3g}, as in this recording, at its role, or "
                "GenMsgCycleTime in the database"
            )
        sentences.append(f"{name}: {what}; {fix}")
    return sentences


def explain_no_samples(
    dropped: Mapping[str, int], signals: Mapping[str, SignalRange], configuration: Configuration
) -> list[str]:
    """Why a recording gives no sample at all, a sentence each.

    Args:
        dropped: Number of wheel-speed readings without a sample, by reason.
        signals: Ranges of the signals by the names of their roles.
        configuration: Configuration of the pass.

    """
    stuck = _standing(signals, configuration)
    if silent := _silent(configuration):
        what = (
            f"the cycles of {', '.join(silent)} are"
            if silent[1:]
            else f"the cycle of {silent[0]} is"
        )
        why = (
            f"{what} unknown, so that every reading counts as stale ({sum(dropped.values())} wheel "
            "speeds); write cycle_ms at the roles"
        )
        return [f"no sample could be formed: {why}", *stuck]
    reasons = ", ".join(
        f"{why} ({n})" for why, n in describe_dropped(dropped, configuration).items()
    )
    speed = signals.get(str(Role.VEHICLE_SPEED))
    slow = "below v_min" in dropped and speed is not None and speed.lowest < speed.highest
    if slow and speed is not None:
        place = _place(configuration, str(Role.VEHICLE_SPEED))
        reasons += f"; {place} reads {speed.lowest:.3g} to {speed.highest:.3g} m/s"
    return [*stuck, f"no sample could be formed: {reasons or 'no data'}"]


def _silent(configuration: Configuration) -> list[str]:
    """Messages without a cycle, of needed roles that have none from another message."""
    by_role = cycles_by_role(configuration.messages)
    return [
        message.plan.name
        for message in configuration.messages
        if any(not by_role[role] for role in message.roles & REQUIRED)
    ]


def explain_axle(
    axle: int, signals: Mapping[str, SignalRange], configuration: Configuration
) -> str:
    """Why an axle has no sample though others have, as a sentence.

    Args:
        axle: Number of the axle, from 1.
        signals: Ranges of the signals by the names of their roles.
        configuration: Configuration of the pass.

    """
    axle_signals = {name: seen for name, seen in signals.items() if name.endswith(f".{axle}")}
    why = "; ".join(_standing(axle_signals, configuration))
    return f"axle {axle}: no sample could be formed{f': {why}' if why else ''}"


def _standing(signals: Mapping[str, SignalRange], configuration: Configuration) -> list[str]:
    """A sentence for the needed signals of each role that have one value throughout.

    Of a vehicle without speed no other signal is named: at rest all of them stand still.
    """
    names: dict[tuple[Role, float], list[str]] = {}
    for choice in configuration.choices:
        seen = signals.get(choice.name)
        if choice.role in STANDING and seen is not None and _stands(seen):
            names.setdefault((choice.role, seen.lowest), []).append(choice.name)
    if (Role.VEHICLE_SPEED, 0.0) in names:
        names = {
            key: role_names for key, role_names in names.items() if key[0] is Role.VEHICLE_SPEED
        }
    sentences = []
    for (role, value), role_names in names.items():
        verb = "reads" if len(role_names) == 1 else "read"
        meaning = "the sensor is stuck, or it is another signal" if value else STANDING[role]
        sentences.append(
            f"{', '.join(_place(configuration, name) for name in role_names)} {verb} {value:.4g} "
            f"{ROLE_UNITS[role]} throughout: {meaning}; map one that changes"
        )
    return sentences


def _stands(seen: SignalRange) -> bool:
    available = seen.readings - seen.not_available
    return available >= LEAST_READINGS and seen.lowest == seen.highest


def _place(configuration: Configuration, name: str) -> str:
    """A role with its signal."""
    choice = next(candidate for candidate in configuration.choices if candidate.name == name)
    return f"{name} ({choice.message}.{choice.signal})"
