"""What a report of a drive needs, collected while the service goes through it.

The memory that this takes does not grow with the drive but for the lists of surfaces and of
objections, a few hundred bytes each.
"""

from dataclasses import dataclass

from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.status import Status
from adhesion_can.reporting.drive.history import History, HistoryRecorder
from adhesion_can.reporting.drive.surfaces import SurfaceRecorder, SurfaceSpan
from adhesion_can.reporting.setpoint_counts import SetpointCounts
from adhesion_can.sampling.column_former import Readings
from adhesion_can.sampling.drive_signals import DriveSignals
from adhesion_can.service.outputs import Outputs

MOST_CHANGES = 2000
"""Number of changes of status, doubt or objection that are kept, the first; all are counted."""


@dataclass(frozen=True, slots=True)
class StateChange:
    """Start of a span with one status, one doubt and one objection.

    Attributes:
        t_us: Stamp of the first setpoint of the span, µs.
        distance: Distance travelled by then, m.
        status: Status of the service.
        doubt: Condition that the residual depends on.
        objection: What the readings cannot be.

    """

    t_us: int
    distance: float
    status: Status
    doubt: Doubt
    objection: Objection


@dataclass(frozen=True, slots=True)
class DriveRecord:
    """Drive as the service saw it.

    Attributes:
        history: Setpoints in bins of time.
        surfaces: Surfaces in the order of their times.
        changes: First changes of status, doubt or objection, the start of the drive included.
        change_count: Number of all of them.
        counts: Numbers of setpoints by status, doubt and objection.
        first_us: Stamp of the first setpoint, µs; 0 where there is none.
        last_us: Stamp of the last setpoint, µs; 0 where there is none.
        distance: Distance travelled where the speed is known, m.
        signals: Readings and slips over time, thinned.

    """

    history: History
    surfaces: tuple[SurfaceSpan, ...]
    changes: tuple[StateChange, ...]
    change_count: int
    counts: SetpointCounts
    first_us: int
    last_us: int
    distance: float
    signals: DriveSignals


class DriveRecorder:
    """Collects the setpoints and the samples of a drive.

    Args:
        slip_max: Largest slip ratio that the estimator uses.

    """

    def __init__(self, slip_max: float) -> None:
        self._history = HistoryRecorder()
        self._surfaces = SurfaceRecorder(slip_max)
        self._signals = DriveSignals()
        self._changes: list[StateChange] = []
        self._change_count = 0
        self._state: tuple[Status, Doubt, Objection] | None = None
        self.counts = SetpointCounts()
        """Numbers of setpoints so far."""
        self._first_us: int | None = None
        self._last_us = 0

    def add(self, t_us: int, outputs: Outputs) -> None:
        """Add the setpoint of a due time, µs."""
        if self._first_us is None:
            self._first_us = t_us
        self._last_us = t_us
        self._history.add(t_us, outputs)
        self._surfaces.add(t_us, outputs, self._history.distance)
        self.counts.add(t_us, outputs)
        state = outputs.status, outputs.doubt, outputs.objection
        if state != self._state:
            self._state = state
            self._change_count += 1
            if len(self._changes) < MOST_CHANGES:
                self._changes.append(StateChange(t_us, self._history.distance, *state))

    def add_samples(self, samples: Samples) -> None:
        """Add samples, in the order of their collection."""
        self._surfaces.add_samples(samples)
        self._signals.add_samples(samples)

    def add_readings(self, readings: Readings) -> None:
        """Add the readings of accepted frames, in the order of their stamps."""
        self._signals.add(readings)

    def result(self) -> DriveRecord:
        """The drive so far."""
        return DriveRecord(
            history=self._history.result(),
            surfaces=tuple(self._surfaces.result()),
            changes=tuple(self._changes),
            change_count=self._change_count,
            counts=self.counts,
            first_us=self._first_us or 0,
            last_us=self._last_us,
            distance=self._history.distance,
            signals=self._signals,
        )
