"""A snapshot as a line of text, and as an object of JSON, for pipes."""

from typing import Any

from adhesion_can.monitoring.snapshot import AxleView, MessageState, MessageView, Snapshot
from adhesion_can.reporting.terminal.words import sentences
from adhesion_can.result_text import plus_minus


def plain_line(snapshot: Snapshot) -> str:
    """One line: time, status, peak, creep setpoint, speed, slips, and what is in trouble."""
    service = snapshot.service
    parts = [f"{snapshot.transport.position_s or snapshot.time_s:.1f} s"]
    if not snapshot.frames:
        return "  ".join([*parts, "nothing received yet"])
    if service is None:
        parts.append("no service")
    else:
        silent = " (ended)" if service.has_ended else " (silent)" if service.is_silent else ""
        parts += [
            f"{service.status.name}{silent}",
            f"mu_max {plus_minus(service.mu_max, service.mu_max_std)}",
            f"lambda_m {plus_minus(service.lambda_m, service.lambda_m_std)}",
            f"creep {_number(service.creep_speed, 3)} m/s",
            f"doubt {service.doubt.json_name or '-'}",
            f"objection {service.objection.json_name or '-'}",
        ]
    speed = None if snapshot.speed is None else 3.6 * snapshot.speed
    observed = snapshot.is_speed_observed
    parts.append("speed observed" if observed else f"speed {_number(speed, 1)} km/h")
    slips = [axle.slip for axle in snapshot.axles if axle.slip is not None]
    parts.append(f"slip {min(slips):.4f} .. {max(slips):.4f}" if slips else "slip -")
    parts.append(f"{snapshot.frame_rate:.0f} frames/s")
    trouble = [
        f"{view.name or view.number} {view.state}"
        for view in snapshot.messages
        if view.state in (MessageState.SILENT, MessageState.FAULTY)
    ]
    if trouble:
        parts.append(f"trouble: {', '.join(trouble)}")
    return "  ".join(parts)


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


DIGITS = 6
"""Significant digits of a measured value in JSON: 16 bits of a signal have five."""


def snapshot_document(snapshot: Snapshot) -> dict[str, Any]:
    """Object of one snapshot, SI units; None means 'not available' and for 'not known'.

    Times are exact to the microsecond, measured values have six digits.
    """
    service, transport = snapshot.service, snapshot.transport
    theta = (None, None, None) if service is None else service.theta or (None, None, None)
    return {
        "time_s": round(snapshot.time_s, 6),
        "bus_time_s": snapshot.t_us / 1e6,
        "position_s": None if transport.is_live else round(transport.position_s, 6),
        "service": None if service is None else transport.origin.name.lower(),
        "status": None if service is None else service.status.name,
        "silent": None if service is None else service.is_silent,
        "ended": None if service is None else service.has_ended,
        **{
            name: None if service is None else _rounded(getattr(service, name))
            for name in ("mu_max", "mu_max_std", "lambda_m", "lambda_m_std")
        },
        "creep_setpoint_mps": None if service is None else _rounded(service.creep_speed),
        **dict(zip(("c1", "c2", "c3"), map(_rounded, theta), strict=True)),
        "doubt": None if service is None else service.doubt.json_name,
        "objection": None if service is None else service.objection.json_name,
        "surface_age_s": None if service is None else _rounded(service.surface_age_s),
        "speed_mps": _rounded(snapshot.speed),
        **({"speed_source": "observed"} if snapshot.is_speed_observed else {}),
        "axles": [_axle(axle) for axle in snapshot.axles],
        "frames": snapshot.frames,
        "frames_per_s": _rounded(snapshot.frame_rate),
        "frames_dropped": transport.dropped,
        "messages": [_message(view) for view in snapshot.messages],
        "words": [sentence.plain for sentence in sentences(snapshot)],
    }


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.{DIGITS}g}")


def _axle(axle: AxleView) -> dict[str, Any]:
    return {
        "axle": axle.axle,
        "slip": _rounded(axle.slip),
        "adhesion": _rounded(axle.adhesion),
        "creep_speed_mps": _rounded(axle.creep_speed),
        "mu_max": _rounded(axle.mu_max),
        "lambda_m": _rounded(axle.lambda_m),
        "creep_setpoint_mps": _rounded(axle.creep_setpoint),
    }


def _message(view: MessageView) -> dict[str, Any]:
    return {
        "name": view.name or None,
        "id": view.number,
        "kind": str(view.kind),
        "state": str(view.state),
        "age_s": None if view.age_us is None else view.age_us / 1e6,
        "rate_per_s": _rounded(view.rate),
        "accepted": view.accepted,
        "rejected": dict(view.rejected),
        "lost": view.lost,
    }
