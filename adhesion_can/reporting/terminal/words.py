"""What a snapshot says in words: status, why, what is needed, doubt, what is silent."""

from collections.abc import Iterator
from math import isfinite

from rich.text import Text

from adhesion_can.monitoring.snapshot import (
    MessageRole,
    MessageState,
    Origin,
    ServiceView,
    Snapshot,
    Transport,
)
from adhesion_can.physics.doubt import doubt_sentence
from adhesion_can.physics.objection import Objection, objection_sentence
from adhesion_can.physics.status import DESCRIPTIONS, Status
from adhesion_can.plurals import counted
from adhesion_can.result_text import plus_minus

STATUS_STYLES = {
    Status.INIT: "cyan",
    Status.TRACKING: "green",
    Status.LOW_EXCITATION: "yellow",
    Status.SURFACE_CHANGE: "magenta",
    Status.STALE_INPUT: "red",
    Status.FAULT: "bold white on red",
}
STATUS_LETTERS = {
    Status.INIT: "i",
    Status.TRACKING: "T",
    Status.LOW_EXCITATION: "l",
    Status.SURFACE_CHANGE: "C",
    Status.STALE_INPUT: "s",
    Status.FAULT: "F",
}
"""Letter of each status where a column has room for one; colour says the same again."""
SAMPLE_AGE_US = 2_000_000
"""Age of the latest sample from which it is said why there are none, µs."""
NARROW_STD = 0.05
"""Largest relative standard deviation of a peak that counts as narrow."""
WELL_BEYOND = 1.3
"""Slip over λ_m from which the fall of the curve is seen."""
HELD = 0.2
"""Largest relative distance from the creep setpoint of an axle that holds it."""
SHOWN_SILENT = 4
"""Largest number of silent messages that are named."""


def sentences(snapshot: Snapshot) -> list[Text]:
    """All sentences, the most important first."""
    return list(_sentences(snapshot))


def _sentences(snapshot: Snapshot) -> Iterator[Text]:
    transport, service = snapshot.transport, snapshot.service
    if transport.is_live and not transport.is_open:
        yield Text("The bus is down; it is reopened as soon as possible.", "bold red")
    if transport.catching_up_s is not None:
        yield Text(
            f"Catching up to {_time(transport.catching_up_s)}: at "
            f"{_time(transport.position_s)}; what is shown is from there.",
            "yellow",
        )
        if not snapshot.frames:
            return
    yield from _service_sentences(snapshot, service)
    if snapshot.true_peak is not None:
        true = snapshot.true_peak
        yield Text(
            f"Truth: {true.surface} rail, mu_max {true.mu_max:.4f}, lambda_m {true.lambda_m:.4f}."
        )
    yield from _input_sentences(snapshot)
    if transport.dropped:
        yield Text(
            f"The monitor dropped {transport.dropped} frames: they arrived too fast.", "yellow"
        )
    if transport.recording:
        yield Text(f"Recording to {transport.recording}: {transport.recorded} frames.")
    for note in reversed(transport.notes):
        yield Text(f"Note: {note}", "dim")


def _service_sentences(snapshot: Snapshot, service: ServiceView | None) -> Iterator[Text]:
    transport = snapshot.transport
    if service is None:
        yield Text(_no_service(snapshot, transport), "yellow")
        yield from map(Text, snapshot.remarks)
        return
    silent_s = (snapshot.t_us - service.t_us) / 1e6
    if service.has_ended:
        yield Text(
            f"The service ended {silent_s:.1f} s ago: it took back its setpoint. "
            "Start `adhesion-can run` for new ones.",
            "bold red",
        )
        yield from map(Text, snapshot.remarks)
        return
    if service.is_silent:
        yield Text(
            f"The service has been silent for {silent_s:.1f} s, and did not sign off: it was "
            "killed, or its bus is cut. Its values below are old.",
            "bold red",
        )
    style = STATUS_STYLES[service.status]
    here = ", estimated here" if transport.origin is Origin.ESTIMATED_HERE else ""
    peak = (
        f"mu_max {plus_minus(service.mu_max, service.mu_max_std)}, "
        f"lambda_m {plus_minus(service.lambda_m, service.lambda_m_std)}"
    )
    values = f"; {peak}" if service.mu_max is not None else ""
    yield Text.assemble(
        (service.status.name, style), f"{here}: {DESCRIPTIONS[service.status]}{values}."
    )
    reason = _reason(snapshot, service)
    if reason:
        yield Text(reason, style if service.status is Status.STALE_INPUT else "")
    for sentence in (objection_sentence(service.objection), doubt_sentence(service.doubt)):
        if sentence:
            yield Text(f"{sentence[:1].upper()}{sentence[1:]}.", "magenta")
    if snapshot.is_speed_observed:
        yield Text(
            "The service observes the vehicle speed by wheels and efforts; it is not on the bus, "
            "so no slips are shown here."
        )
    yield from map(Text, snapshot.remarks)
    if service.creep_speed is not None and snapshot.speed is not None:
        yield Text(_held(snapshot, service.creep_speed, snapshot.speed))


def _time(seconds: float) -> str:
    """A time after the first frame; of a minute and more also as m:ss."""
    text = f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{text} ({minutes}:{rest:02d})" if minutes else text


def _held(snapshot: Snapshot, wanted: float, speed: float) -> str:
    """The creep setpoint, and how many axles hold it."""
    slip = wanted / max(speed, snapshot.v_min)
    setpoint = f"Creep setpoint {wanted:.3f} m/s, slip {slip:.4f}"
    creeps = [axle.creep_speed for axle in snapshot.axles if axle.creep_speed is not None]
    if not creeps:
        return f"{setpoint}."
    held = sum(abs(creep / wanted - 1.0) <= HELD for creep in creeps) if wanted else 0
    others = "" if held == len(creeps) else "; the others probe, coast or slip"
    return f"{setpoint}: {held} of {len(creeps)} axles hold it{others}."


def _no_service(snapshot: Snapshot, transport: Transport) -> str:
    if transport.origin is Origin.ESTIMATED_HERE:
        return "No estimate here yet: it starts with the first accepted input."
    if not snapshot.frames:
        return "Nothing received yet: is this the vehicle's bus, and is it active?"
    where = "on this bus" if transport.is_live else "in this recording so far"
    return (
        f"No service {where}: no AdhesionSetpoint received. Start `adhesion-can run`, or pass "
        "--estimate."
    )


def _reason(snapshot: Snapshot, service: ServiceView) -> str:
    """Why the status is what it is, and what is needed."""
    if service.status is Status.STALE_INPUT:
        return _silent_inputs(snapshot)
    if service.status not in (Status.LOW_EXCITATION, Status.INIT, Status.SURFACE_CHANGE):
        return ""
    if service.objection is not Objection.NONE:
        return ""  # the objection says it, and more creep would not help
    if snapshot.is_speed_derived:
        return (
            "The vehicle speed is derived from driven axles, so the slip is hardly known: use "
            "radar, GNSS or a trailing axle."
        )
    no_samples = "" if snapshot.is_speed_observed else _no_samples(snapshot)
    return no_samples or _needed_creep(snapshot, service)


def _no_samples(snapshot: Snapshot) -> str:
    """Why there are no samples; '' where there are."""
    latest = snapshot.last_sample_us
    if latest is not None and snapshot.t_us - latest <= SAMPLE_AGE_US:
        return ""
    if snapshot.missing:
        return f"No samples: no role gives {' or '.join(snapshot.missing)}."
    if snapshot.speed is None:
        return "No samples: the vehicle speed is not available."
    if snapshot.speed < snapshot.v_min:
        return f"No samples: the vehicle speed is below {snapshot.v_min:g} m/s."
    if snapshot.first_us is not None and snapshot.t_us - snapshot.first_us <= SAMPLE_AGE_US:
        return ""
    return "No samples: wheel speeds and efforts are not available at the same time."


def _needed_creep(snapshot: Snapshot, service: ServiceView) -> str:
    """What the data lack for the peak."""
    if not snapshot.points:
        return ""
    # A few samples stray far; what most of the largest slips reach counts.
    slips = sorted(point.slip for point in snapshot.points)
    reached = slips[int(0.98 * (len(slips) - 1))]
    if service.lambda_m is None:
        return f"It needs creep beyond the peak; slip reached {reached:.3f} in the last 5 s."
    near = f"slip reached {reached:.3f} in the last 5 s, the peak is expected near"
    if reached < service.lambda_m:
        return f"To find the peak, it needs more creep: {near} {service.lambda_m:.3f}."
    if snapshot.only_direction and reached > WELL_BEYOND * service.lambda_m:
        other = "brake" if snapshot.only_direction == "traction" else "pull"
        return (
            f"Only {snapshot.only_direction} so far, which shows no common error of speed or "
            f"efforts: {other} or coast once, or state smaller errors in [instruments]."
        )
    if _is_narrow(service.mu_max, service.mu_max_std) and not _is_narrow(
        service.lambda_m, service.lambda_m_std
    ):
        return (
            f"To find the peak, it needs more creep beyond {service.lambda_m:.3f}; slip reached "
            f"{reached:.3f} in the last 5 s."
        )
    return (
        f"It needs more samples on both sides of the peak near {service.lambda_m:.3f}; "
        f"slip reached {reached:.3f} in the last 5 s."
    )


def _is_narrow(value: float | None, std: float | None) -> bool:
    return bool(value) and std is not None and isfinite(std) and std <= NARROW_STD * (value or 0.0)


def _silent_inputs(snapshot: Snapshot) -> str:
    silent = [
        f"{view.name} for {(view.age_us or 0) / 1e6:.1f} s"
        for view in snapshot.messages
        if view.kind is MessageRole.INPUT and view.state is MessageState.SILENT
    ]
    if not silent:
        return ""
    more = f" and {len(silent) - SHOWN_SILENT} more" if len(silent) > SHOWN_SILENT else ""
    return f"Silent: {', '.join(silent[:SHOWN_SILENT])}{more}."


def _input_sentences(snapshot: Snapshot) -> Iterator[Text]:
    inputs = [view for view in snapshot.messages if view.kind is MessageRole.INPUT]
    if snapshot.time_s > 2.0 and inputs and all(v.state is MessageState.NEVER for v in inputs):
        yield Text(
            "No configured message received: are bus, --dbc and --config right?",
            "bold red",
        )
        return
    status = None if snapshot.service is None else snapshot.service.status
    if status is not Status.STALE_INPUT:
        silent = _silent_inputs(snapshot)
        if silent:
            yield Text(silent, "yellow")
    faulty = [view for view in snapshot.messages if view.state is MessageState.FAULTY]
    if faulty:
        worst = max(faulty, key=lambda view: view.recent_faults)
        reasons = ", ".join(f"{n} {reason}" for reason, n in worst.rejected.items())
        faults = " and ".join(filter(None, (reasons, f"{worst.lost} lost" if worst.lost else "")))
        rest = len(faulty) - 1
        others = f"; also in {counted(rest, 'other message')}" if rest else ""
        yield Text(f"Faults in {worst.name} since the start: {faults}{others}.", "yellow")
    if snapshot.missing and snapshot.service is None:
        yield Text(f"No adhesion: no role gives {' or '.join(snapshot.missing)}.")
