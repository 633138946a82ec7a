"""Check of a recording: its contents, its faults, and what can be estimated from it."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from adhesion_can.bus.block import Block
from adhesion_can.bus.j1939 import parameter_group, source_address
from adhesion_can.bus.message_record import MessageRecord
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.estimation.batch_fit import identify
from adhesion_can.estimation.batch_result import BatchResult
from adhesion_can.offline.compare_noise import NOISY_ROLES, ComparedNoise, compare_noise
from adhesion_can.offline.excitation import describe_excitation
from adhesion_can.offline.extract_samples import Hole
from adhesion_can.offline.fault_history import FaultHistory
from adhesion_can.offline.instrument_errors import propose_instruments
from adhesion_can.offline.missing_samples import (
    explain_axle,
    explain_no_samples,
    unknown_cycles,
)
from adhesion_can.offline.plausibility import inspect_samples
from adhesion_can.offline.recording_fit import BusMisfit, find_misfit
from adhesion_can.offline.scan import Scan, SignalRange, scan
from adhesion_can.offline.vehicle_numbers import inspect_numbers
from adhesion_can.offline.watch_samples import ObjectionSpan, watch_samples
from adhesion_can.physics.readings import REQUIRED, Role, role_name
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.plurals import counted
from adhesion_can.recordings.drive_time import hole_us
from adhesion_can.result_text import TimeScale
from adhesion_can.sampling.drive_signals import DriveSignals

RATE_TOLERANCE = 0.1
"""Largest share by which a message's mean cycle may differ from its nominal one."""
LOAD_TOLERANCE = 1.5
"""Factor by which a configured axle load may lie beyond the measured ones."""


@dataclass
class CheckResult:
    """Result of the check of a recording.

    Attributes:
        receiver: Receiver with the records of all input messages.
        signals: Ranges of the signals by the names of their roles.
        frames: Number of frames.
        unknown: Number of frames whose id belongs to no input message.
        clamped: Number of frames stamped before the one in front of them.
        duration_s: Time from the first to the last frame, s.
        samples: Samples formed from the frames.
        dropped: Number of wheel-speed readings that gave no sample, by reason.
        failures: Faults of the recording, a sentence each.
        limits: Quantities that cannot be estimated from it, with the reason, a sentence each.
        findings: Quantities that can be estimated from it, a sentence each.
        warnings: Settings that the recording contradicts, a sentence each.
        noise: Noise of the sensors as their readings show it, beside the configured one.
        faults: Frames that were accepted, rejected and lost over time.
        objections: Times in which the service would object to the readings.
        first_us: Stamp of the first frame, µs: time 0 of the sentences.
        drive_signals: Readings and slips over time; None where they were not collected.
        fit: Batch fit of the samples; None where none is usable or adhesion cannot be computed.
        shows_peak: Whether a segment shows its peak.
        misfit: What the recording lacks of the configured bus; None where nothing that is needed.

    """

    receiver: Receiver
    signals: dict[str, SignalRange]
    frames: int
    unknown: int
    clamped: int
    duration_s: float
    samples: Samples
    dropped: dict[str, int]
    failures: list[str] = field(default_factory=list)
    limits: list[str] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    noise: tuple[ComparedNoise, ...] = ()
    faults: FaultHistory = field(default_factory=FaultHistory)
    fit: BatchResult | None = None
    objections: tuple[ObjectionSpan, ...] = ()
    first_us: int = 0
    drive_signals: DriveSignals | None = None
    shows_peak: bool = False
    misfit: BusMisfit | None = None

    @property
    def times(self) -> TimeScale:
        """Scale of its times for people, from its first frame on."""
        return TimeScale.beginning_at(self.first_us)

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "usable": not self.failures,
            "shows_peak": self.shows_peak,
            "failures": self.failures,
            "limits": self.limits,
            "findings": self.findings,
            "warnings": self.warnings,
            "objections": [objection.to_dict() for objection in self.objections],
            "noise": {noise.key: noise.to_dict() for noise in self.noise},
            "frames": self.frames,
            "frames_unknown": self.unknown,
            "frames_backwards": self.clamped,
            "duration_s": self.duration_s,
            "samples": len(self.samples),
            "samples_dropped": self.dropped,
            "messages": [message_json(record) for record in self.receiver.records],
            "signals": {
                name: {
                    "unit": seen.unit,
                    "min": None if seen.lowest == np.inf else seen.lowest,
                    "max": None if seen.highest == -np.inf else seen.highest,
                    "readings": seen.readings,
                    "not_available": seen.not_available,
                }
                for name, seen in self.signals.items()
            },
        }


def message_json(record: MessageRecord) -> dict[str, Any]:
    """Entry of one input message for `--json`."""
    return {
        "name": record.message.plan.name,
        "id": record.message.plan.frame_id,
        "frames": record.frames,
        "accepted": record.accepted,
        "lost": record.lost,
        "rejected": {str(reason): count for reason, count in record.rejected.items()},
        "stuck": record.stuck,
        "cycle_ms": mean_cycle_ms(record),
        "nominal_cycle_ms": record.message.cycle_us and record.message.cycle_us / 1e3,
        "longest_gap_ms": record.longest_gap_us / 1e3,
        "longest_gap_at_s": None if record.gap_at_us is None else record.gap_at_us / 1e6,
        "gaps": record.late,
    }


def mean_cycle_ms(record: MessageRecord) -> float | None:
    """Mean time between accepted frames, ms."""
    if record.first_us is None or record.last_us is None or record.accepted < 2:
        return None
    return (record.last_us - record.first_us) / (record.accepted - 1) / 1e3


def check(blocks: Iterable[Block], configuration: Configuration) -> CheckResult:
    """Pass a recording through receiver and sample former, and check it.

    Args:
        blocks: Frames of the recording; marks are ignored.
        configuration: Messages, roles and settings; a missing role becomes one of the limits.

    """
    contents = scan(blocks, configuration, NOISY_ROLES, DriveSignals())
    return check_scan(contents, configuration)


def check_scan(contents: Scan, configuration: Configuration) -> CheckResult:
    """Check what a pass over a recording gave.

    Args:
        contents: Contents of the recording, with the readings of `NOISY_ROLES` at least.
        configuration: Configuration of the pass.

    """
    extractor, samples = contents.extractor, contents.samples
    counts = extractor.counts
    fitted = _fit(samples, configuration)
    watched = _watch(samples, fitted, configuration)
    result = CheckResult(
        extractor.receiver,
        contents.signals,
        counts["frames"],
        counts["unknown"],
        counts["clamped"],
        contents.duration_s,
        samples,
        extractor.dropped,
        noise=compare_noise(contents.traces, configuration),
        faults=contents.faults,
        fit=fitted,
        objections=watched,
        first_us=extractor.first_us or 0,
        drive_signals=contents.drive_signals,
    )
    receiver, seen = extractor.receiver, extractor.seen
    misfit = result.misfit = find_misfit(receiver, seen, configuration, samples=len(samples))
    if misfit is not None:
        result.failures.append(f"{misfit.what}; {misfit.fix}")
        if misfit.of_other_bus and not receiver.unmarked:
            return result  # what else would be said follows from it
    restart_s = configuration.service.restart_s
    length_us = extractor.hole.length_us
    # Between the stretches of a clock that was set back is no hole: the reader tells of them.
    is_hole = length_us > restart_s * 1e6 and length_us != hole_us(restart_s)
    hole = extractor.hole if is_hole else None
    times = TimeScale.beginning_at(extractor.first_us or 0)
    _check_messages(result, hole, extractor.holes, times)
    _check_senders(result)
    result.warnings.extend(result.receiver.unmarked)
    _check_signals(result)
    _check_axles(result, configuration)
    _check_loads(result, configuration)
    _check_vehicle(result, configuration)
    _check_excitation(result, configuration)
    result.warnings.extend(noise.warning for noise in result.noise if noise.warning)
    result.warnings.extend(objection.sentence(times) for objection in watched)
    return result


def _check_messages(result: CheckResult, hole: Hole | None, holes: int, times: TimeScale) -> None:
    """Rates, gaps and faults of each message.

    Args:
        result: Result to which the sentences are added.
        hole: Longest time without any frame, reported once and not message by message; None: there
            is none beyond which the service starts again, but between stretches.
        holes: Number of such times, and of those between stretches: a gap of each message.
        times: Scale of the times in the sentences.

    """
    if hole is not None:
        result.failures.append(
            f"no frames for {hole.length_us / 1e6:.0f} s, from "
            f"{times.seconds(hole.from_us / 1e6):.3f} s on: the file holds two recordings, or its "
            "clock was set; check the parts separately"
        )
    for record in result.receiver.records:
        name = f"{record.message.plan.name} ({record.message.plan.frame_id:#x})"
        if not record.frames:
            required = record.message.roles & REQUIRED
            if required and result.misfit is not None:
                continue  # it has named it
            sentences = result.failures if required else result.limits
            wrong = record.wrong_channel or ("no frames in the recording",)
            sentences.append(f"{name}: {'; '.join(wrong)}")
            continue
        for reason, count in record.rejected.items():
            result.failures.append(f"{name}: {count} of {record.frames} frames rejected: {reason}")
        if record.lost:
            result.failures.append(f"{name}: {counted(record.lost, 'frame')} lost by its counter")
        if record.late > holes:
            at = times.seconds((record.gap_at_us or 0) / 1e6)
            result.failures.append(
                f"{name}: {counted(record.late, 'gap')} of more than three cycles, the longest "
                f"{record.longest_gap_us / 1e3:.0f} ms at {at:.3f} s"
            )
        cycle, nominal = mean_cycle_ms(record), record.message.cycle_us
        if (
            cycle
            and nominal
            and abs(cycle * 1e3 / nominal - 1) > RATE_TOLERANCE
            and not record.late
        ):
            result.failures.append(
                f"{name}: cycle {cycle:.1f} ms instead of {nominal / 1e3:.0f} ms"
            )
    result.failures.extend(result.receiver.stuck_sentences)
    if result.clamped:
        result.failures.append(
            f"{counted(result.clamped, 'frame')} stamped earlier than the previous frame"
        )


def _check_senders(result: CheckResult) -> None:
    """Whose J1939 messages were taken, where that is not the sender of the database."""
    names = {r.message.plan.frame_id: r.message.plan.name for r in result.receiver.records}
    senders = result.receiver.senders
    for named, heard in senders.heard.items():
        others = ", ".join(f"{k:#04x}" for k in sorted(senders.others.get(named, ())))
        further = f"; ignored: the same message from {others}" if others else ""
        if heard != source_address(named) or others:
            result.warnings.append(
                f"{names[named]}: parameter group {parameter_group(named)} is read from source "
                f"address {heard:#04x}; the database names {source_address(named):#04x}{further}"
            )


def _check_loads(result: CheckResult, configuration: Configuration) -> None:
    """Whether the configured axle loads agree with the measured ones, whose gaps they fill."""
    for axle, load in enumerate(configuration.vehicle.axle_load, start=1):
        seen = result.signals.get(role_name(Role.AXLE_LOAD, axle))
        if seen is None or seen.readings == seen.not_available:
            continue
        if not seen.lowest / LOAD_TOLERANCE <= load <= seen.highest * LOAD_TOLERANCE:
            result.failures.append(
                f"axle {axle}: axle_load_N = {load:g} in [vehicle], but {seen.lowest:.6g} to "
                f"{seen.highest:.6g} N is measured; correct it, or the unit of the role"
            )


def _check_vehicle(result: CheckResult, configuration: Configuration) -> None:
    """Which data of another vehicle than the default one were not given, or disagree."""
    default, vehicle = Locomotive(), configuration.vehicle
    result.warnings.extend(inspect_numbers(vehicle))
    if vehicle == default:
        return
    places = (
        ("wheel_radius_m", default.wheel_radius[0], vehicle.wheel_radius),
        ("axle_load_N", default.axle_load[0], vehicle.axle_load),
        ("wheelset_inertia_kgm2", default.wheelset_inertia, (vehicle.wheelset_inertia,)),
    )
    kept = [
        f"{key} = {value:g}"
        for key, value, configured in places
        if set(configured) == {value} and key not in configuration.vehicle_keys
    ]
    if kept:
        result.warnings.append(
            f"{', '.join(kept)}: taken from the default locomotive, a heavy Co-Co; write your "
            "vehicle's values into [vehicle]"
        )


def _check_signals(result: CheckResult) -> None:
    for name, seen in result.signals.items():
        if seen.not_available:
            share = 100 * seen.not_available / seen.readings
            result.limits.append(f"{name}: not available in {share:.1f} % of its frames")


def _check_axles(result: CheckResult, configuration: Configuration) -> None:
    """Whether slip and adhesion of every axle come out plausible."""
    result.failures.extend("; ".join(pair) for pair in configuration.shared_signals())
    records = result.receiver.records
    cycles = {record.message.plan.name: ms for record in records if (ms := mean_cycle_ms(record))}
    result.warnings.extend(unknown_cycles(configuration, cycles))
    by_axle = (Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT)
    mapped = {role: {c.axle for c in configuration.choices if c.role is role} for role in by_axle}
    for axle in range(1, configuration.vehicle.axles + 1):
        lacking = [str(role) for role in by_axle if mapped[role] and axle not in mapped[role]]
        if lacking:
            result.failures.append(
                f"axle {axle} of {configuration.vehicle.axles}: no role gives "
                f"{' or '.join(lacking)}; map it, or write the number of axles in [vehicle]"
            )
        elif len(result.samples) and not np.any(result.samples.axle == axle):
            result.failures.append(explain_axle(axle, result.signals, configuration))
    for finding in inspect_samples(result.samples, table=False, vehicle=configuration.vehicle):
        is_wrong = finding.fatal and not configuration.assume_plausible
        (result.failures if is_wrong else result.warnings).append(finding.sentence)


def _check_excitation(result: CheckResult, configuration: Configuration) -> None:
    missing = configuration.missing_for_identification()
    if missing:
        result.failures.append(
            f"no role gives {' or '.join(missing)}, so adhesion, mu_max and lambda_m cannot be "
            "estimated"
        )
        roles = configuration.roles()
        if {Role.WHEEL_SPEED, Role.VEHICLE_SPEED} <= roles:
            result.findings.append("slip ratios: wheel and vehicle speed are available")
        elif Role.WHEEL_SPEED in roles:
            result.findings.append("wheel speeds, compared with each other and with a reference")
        return
    if result.misfit is not None:
        return
    if not len(result.samples):
        result.failures += explain_no_samples(result.dropped, result.signals, configuration)
        return
    if result.fit is None:
        result.failures.append("every sample lies outside the slip range of the curve")
        return
    result.shows_peak = describe_excitation(
        result.samples, result.fit, result.findings, result.limits, result.times
    )
    result.findings.extend(propose_instruments(result.samples, result.fit, configuration))


def _fit(samples: Samples, configuration: Configuration) -> BatchResult | None:
    """Batch fit of samples; None where none is usable or a role for adhesion is missing."""
    if configuration.missing_for_identification() or not len(samples):
        return None
    estimators = configuration.estimators
    # Judged as `identify` does, so that both say the same of a peak.
    return identify(samples, estimators.identifiability, noise=estimators.noise, judge_family=True)


def _watch(
    samples: Samples, fitted: BatchResult | None, configuration: Configuration
) -> tuple[ObjectionSpan, ...]:
    """Objections to samples; none where the watch is off or no curve was fitted."""
    settings = configuration.estimators.plausibility
    if fitted is None or not settings.enabled:
        return ()
    return tuple(watch_samples(samples, fitted.segments, configuration.vehicle, settings))
