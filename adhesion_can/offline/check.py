"""Is this recording usable: what is in it, what is wrong with it, what it can tell."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.bus.block import Block
from adhesion_can.bus.message_record import MessageRecord
from adhesion_can.bus.receiver import Receiver
from adhesion_can.config import Configuration
from adhesion_can.estimation.batch_fit import identify
from adhesion_can.offline.extract_samples import Extraction
from adhesion_can.physics.readings import Role, role_name
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.column_former import Readings

RATE_TOLERANCE = 0.1
"""A message's mean cycle may be off by this share of its nominal one."""


@dataclass(slots=True)
class SignalRange:
    """What a role's signal was seen to do, in SI units."""

    lowest: float = np.inf
    highest: float = -np.inf
    readings: int = 0
    not_available: int = 0

    def note(self, values: Array) -> None:
        """Readings, NaN where not available."""
        told = values[np.isfinite(values)]
        self.readings += len(values)
        self.not_available += len(values) - len(told)
        self.lowest = float(told.min(initial=self.lowest))
        self.highest = float(told.max(initial=self.highest))


@dataclass(frozen=True)
class CheckResult:
    """A checked recording.

    Attributes:
        receiver: what was heard, by message.
        signals: ranges by role name.
        frames: in the recording.
        unknown: frames of ids that nobody listens to.
        clamped: frames stamped before the one in front of them.
        duration_s: from the first to the last frame.
        samples: formed.
        dropped: wheel-speed readings that gave no sample, by reason.
        failures: what is wrong, a sentence each.
        limits: what cannot be known from this recording, and why.
        findings: what can.

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

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "usable": not self.failures,
            "failures": self.failures,
            "limits": self.limits,
            "findings": self.findings,
            "frames": self.frames,
            "frames_unknown": self.unknown,
            "frames_backwards": self.clamped,
            "duration_s": self.duration_s,
            "samples": len(self.samples),
            "samples_dropped": self.dropped,
            "messages": [message_json(record) for record in self.receiver.records],
            "signals": {
                name: {
                    "min": None if seen.lowest == np.inf else seen.lowest,
                    "max": None if seen.highest == -np.inf else seen.highest,
                    "readings": seen.readings,
                    "not_available": seen.not_available,
                }
                for name, seen in self.signals.items()
            },
        }


def message_json(record: MessageRecord) -> dict[str, Any]:
    """What was heard of one message."""
    return {
        "name": record.message.plan.name,
        "id": record.message.plan.frame_id,
        "frames": record.frames,
        "accepted": record.accepted,
        "lost": record.lost,
        "rejected": {str(reason): count for reason, count in record.rejected.items()},
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
    """Go through a recording as the service would, and judge it.

    Args:
        blocks: frames; marks are passed over.
        configuration: roles may be missing: what they would tell is named among the limits.

    """
    signals = {choice.name: SignalRange() for choice in configuration.choices}

    def note(readings: Readings) -> None:
        for (role, axle), (_, values) in readings.items():
            signals[role_name(role, axle)].note(values)

    extraction = Extraction(configuration, note)
    samples = extraction.run(blocks)
    counts = extraction.counts
    result = CheckResult(
        extraction.receiver,
        signals,
        counts["frames"],
        counts["unknown"],
        counts["clamped"],
        (extraction.last_us - (extraction.first_us or 0)) / 1e6,
        samples,
        extraction.dropped,
    )
    _judge_messages(result)
    _judge_signals(result)
    _judge_excitation(result, configuration)
    return result


def _judge_messages(result: CheckResult) -> None:
    for record in result.receiver.records:
        name = f"{record.message.plan.name} ({record.message.plan.frame_id:#x})"
        if not record.frames:
            required = record.message.roles & {
                Role.WHEEL_SPEED,
                Role.VEHICLE_SPEED,
                Role.TRACTIVE_EFFORT,
            }
            words = result.failures if required else result.limits
            words.append(f"{name}: not one frame in the recording")
            continue
        for reason, count in record.rejected.items():
            result.failures.append(f"{name}: {count} of {record.frames} frames rejected: {reason}")
        if record.lost:
            result.failures.append(f"{name}: {record.lost} frames lost by its counter")
        if record.late:
            at = (record.gap_at_us or 0) / 1e6
            result.failures.append(
                f"{name}: {record.late} gaps of more than three cycles, the longest "
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
    if result.clamped:
        result.failures.append(
            f"{result.clamped} frames are stamped before the one in front of them"
        )


def _judge_signals(result: CheckResult) -> None:
    for name, seen in result.signals.items():
        if seen.not_available:
            share = 100 * seen.not_available / seen.readings
            result.limits.append(f"{name}: not available in {share:.1f} % of its frames")


def _judge_excitation(result: CheckResult, configuration: Configuration) -> None:
    missing = configuration.missing_for_identification()
    if missing:
        result.limits.append(
            f"no role gives {' or '.join(missing)}: the adhesion coefficient, and with it mu_max "
            "and lambda_m, cannot be estimated"
        )
        heard = configuration.roles()
        if {Role.WHEEL_SPEED, Role.VEHICLE_SPEED} <= heard:
            result.findings.append("slip ratios can be formed: wheel and vehicle speed are there")
        elif Role.WHEEL_SPEED in heard:
            result.findings.append(
                "wheel speeds can be compared with each other and with a reference"
            )
        return
    if not len(result.samples):
        reasons = ", ".join(f"{why} ({n})" for why, n in result.dropped.items()) or "no data"
        result.failures.append(f"not one sample could be formed: {reasons}")
        return
    fitted = identify(result.samples, configuration.estimators.identifiability)
    if fitted is None:
        result.failures.append("every sample lies outside the slips that the curve is valid for")
        return
    sizes = np.abs(result.samples.slip)
    low, high = np.quantile(sizes, [0.05, 0.98])
    result.findings.append(
        f"{len(result.samples)} samples, |slip| from {low:.4f} to {high:.4f} (5 % to 98 %)"
    )
    known = [s for s in fitted.segments if s.estimate.identifiable.both]
    text = f"{len(known)} of {len(fitted.segments)} stretches of constant rail tell their peak"
    (result.findings if known else result.limits).append(
        text if known else f"{text}: the slip never goes far enough beyond it"
    )
