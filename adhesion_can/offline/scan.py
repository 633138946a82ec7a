"""One pass over a recording: its readings, its samples, and what became of its frames."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.bus.block import Block
from adhesion_can.config import Configuration
from adhesion_can.offline.extract_samples import SampleExtractor
from adhesion_can.offline.fault_history import FaultHistory
from adhesion_can.offline.load_traces import LoadedTraces
from adhesion_can.physics.readings import Role, role_name
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.column_former import Readings
from adhesion_can.sampling.drive_signals import DriveSignals


@dataclass(slots=True)
class SignalRange:
    """Range of a signal's readings.

    Attributes:
        lowest: Smallest value, SI unit of the role; inf where none is available.
        highest: Largest value, SI unit of the role; -inf where none is available.
        readings: Number of readings.
        not_available: Number of readings that carry 'not available'.
        unit: SI unit of the role, or the unit of the user's channel; '' where it has none.

    """

    lowest: float = np.inf
    highest: float = -np.inf
    readings: int = 0
    not_available: int = 0
    unit: str = ""

    def add(self, values: Array) -> None:
        """Add readings, SI unit of the role, NaN where not available; shape (n,)."""
        available = values[np.isfinite(values)]
        self.readings += len(values)
        self.not_available += len(values) - len(available)
        self.lowest = float(available.min(initial=self.lowest))
        self.highest = float(available.max(initial=self.highest))


@dataclass(frozen=True, slots=True)
class Scan:
    """Contents of a recording.

    Attributes:
        extractor: Receiver of the frames, with their counts and stamps.
        samples: Samples formed from the frames.
        traces: Readings of the roles that were asked for.
        signals: Ranges of the signals by the names of their roles.
        faults: Frames that were accepted, rejected and lost over time.
        drive_signals: Readings and slips over time, thinned; None where they were not asked for.

    """

    extractor: SampleExtractor
    samples: Samples
    traces: LoadedTraces
    signals: dict[str, SignalRange]
    faults: FaultHistory
    drive_signals: DriveSignals | None = None

    @property
    def duration_s(self) -> float:
        """Time from the first to the last frame, s."""
        return (self.extractor.last_us - (self.extractor.first_us or 0)) / 1e6


def scan(
    blocks: Iterable[Block],
    configuration: Configuration,
    roles: Collection[Role] = tuple(Role),
    drive_signals: DriveSignals | None = None,
) -> Scan:
    """Pass a recording through receiver and sample former.

    Args:
        blocks: Frames of the recording; marks are ignored.
        configuration: Messages, roles and settings.
        roles: Roles whose readings are kept.
        drive_signals: Collector of readings and slips over time; None: they are not collected.

    """
    signals = {
        choice.name: SignalRange(unit=configuration.signal_unit(choice.role, choice.axle))
        for choice in configuration.choices
    }
    traces, faults = LoadedTraces(), FaultHistory()

    def add_readings(readings: Readings) -> None:
        if drive_signals is not None:
            drive_signals.add(readings)
        traces.add({key: columns for key, columns in readings.items() if key[0] in roles})
        for (role, axle), (_, values) in readings.items():
            signals[role_name(role, axle)].add(values)

    extractor = SampleExtractor(configuration, add_readings, faults.add)
    samples = extractor.run(blocks)
    if drive_signals is not None:
        drive_signals.add_samples(samples)
    traces.backwards = extractor.counts["clamped"]
    traces.rejected = extractor.receiver.rejected
    return Scan(extractor, samples, traces, signals, faults, drive_signals)
