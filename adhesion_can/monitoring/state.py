"""What is on a bus, from its frames: counts, samples of the curve, and what a service sends.

Nothing is sent, and no clock is read: `feed` takes a frame, `snapshot` a time. Samples are formed
as the service forms them.
"""

from collections import deque
from collections.abc import Iterator
from statistics import median

import numpy as np
from cantools.database.can import Message

from adhesion_can.bus.checked_message import CheckedMessage
from adhesion_can.bus.database import (
    DEMAND_MESSAGES,
    OUTPUT_MESSAGES,
    CanDatabase,
    database_with,
)
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.rejection import Rejection
from adhesion_can.config import Configuration
from adhesion_can.monitoring.latest_frames import FrameKeeper, MessageKey
from adhesion_can.monitoring.message_table import MessageTable, WatchedMessage
from adhesion_can.monitoring.setpoint_reader import QUALITY, SETPOINT, SetpointReader
from adhesion_can.monitoring.snapshot import (
    AxleView,
    DriveDirection,
    MessageRole,
    OperatingPoint,
    Snapshot,
)
from adhesion_can.physics.kinematics import slip_ratio
from adhesion_can.physics.readings import Role, SpeedSource
from adhesion_can.physics.samples import Sample

COLLECT_US = 20_000
"""Time between two collections of samples, µs: the cycle of the service."""
POINTS_US, POINT_STEP_US = 5_000_000, 50_000
"""Time for which samples are kept as operating points and time between two of an axle, µs."""
AXLE_US = 200_000
"""Time over which an axle's values are the median, µs."""
LEAST_FORCE = 0.05
"""Adhesion from which traction and braking differ from coasting."""


class MonitorState:
    """State of a bus, frame by frame.

    Args:
        configuration: Database, roles and vehicle.

    """

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._receiver = Receiver(configuration.messages)
        self._watched = _watched_messages(configuration)
        self._outputs = SetpointReader(
            self._watched[QUALITY].message, self._watched[SETPOINT].message.cycle_us
        )
        self._table = MessageTable(
            self._receiver.records, self._watched.values(), configuration.database
        )
        inputs = {
            (r.message.plan.frame_id, r.message.plan.is_extended) for r in self._receiver.records
        }
        self._by_id = {
            (watched.message.plan.frame_id, watched.message.plan.is_extended): watched
            for watched in self._watched.values()
        }
        self._by_id = {key: watched for key, watched in self._by_id.items() if key not in inputs}
        self._frames = FrameKeeper(_known_messages(configuration), configuration.choices)
        self._missing = tuple(configuration.missing_for_service())
        choices = configuration.choices
        self._axles = sorted({choice.axle for choice in choices if choice.role is Role.WHEEL_SPEED})
        self._former = configuration.make_former()
        self._first_us: int | None = None
        self._now_us = 0
        self._collect_us = 0
        self._points: deque[OperatingPoint] = deque()
        self._recent: dict[int, deque[Sample]] = {}
        self._values: dict[tuple[Role, int], tuple[int, float | None]] = {}
        self._last_sample_us: int | None = None
        self._directions: set[DriveDirection] = set()

    @property
    def now_us(self) -> int:
        """Latest stamp of a frame, µs; 0 before the first."""
        return self._now_us

    def feed(self, frame: Frame) -> None:
        """Process one frame; one stamped before the latest stamp is moved to it."""
        t_us = max(frame.t_us, self._now_us)
        if t_us != frame.t_us:
            frame = frame._replace(t_us=t_us)
        if self._first_us is None:
            self._first_us = t_us
        elif t_us - self._now_us > self._configuration.service.restart_s * 1e6:
            # As the service: what lies before a long hole is no neighbour of what comes after.
            self._former = self._configuration.make_former()
        self._now_us = t_us
        self._table.begin_frame(t_us)
        outcome = self._receiver.accept(frame)
        if outcome is None:
            rejection = self._take_other(frame)
        elif isinstance(outcome, Rejection):
            rejection = outcome
        else:
            rejection = None
            for reading in outcome:
                self._values[reading.role, reading.axle] = reading.t_us, reading.value
                self._former.add(reading)
        if frame.is_data:
            self._frames.add(self._key(frame), frame, rejection)
        if t_us >= self._collect_us:
            self._collect_us = t_us + COLLECT_US
            self._collect(t_us)

    def snapshot(self, t_us: int) -> Snapshot:
        """State at a time, µs; one before the latest frame counts as that frame's."""
        t_us = max(t_us, self._now_us)
        return Snapshot(
            t_us=t_us,
            first_us=self._first_us,
            frames=self._table.frames,
            frame_rate=self._table.frame_rate(t_us),
            messages=self._table.views(t_us),
            latest=self._frames.latest(),
            axles=tuple(self._axle(axle, t_us) for axle in self._axles),
            points=tuple(point for point in self._points if point.t_us > t_us - POINTS_US),
            last_sample_us=self._last_sample_us,
            only_direction=next(iter(self._directions)) if len(self._directions) == 1 else None,
            speed=self._latest(Role.VEHICLE_SPEED, 0, t_us),
            is_speed_derived=self._latest(Role.SPEED_SOURCE, 0, t_us) == SpeedSource.DRIVEN_AXLES,
            is_speed_observed=self._configuration.observes_speed,
            v_min=self._configuration.sampling.v_min,
            missing=self._missing,
            service=self._outputs.view(t_us),
            history=self._outputs.history,
        )

    def _key(self, frame: Frame) -> MessageKey:
        """Identifier of the frame's message in the database, whoever sends it by J1939."""
        number, senders = frame.arbitration_id, self._receiver.senders
        if frame.is_extended and senders:
            number = senders.translate(number)
        return number, frame.is_extended

    def _take_other(self, frame: Frame) -> Rejection | None:
        """Take a frame that is no input; the reason to reject it, where it is checked."""
        watched = (
            self._by_id.get((frame.arbitration_id, frame.is_extended)) if frame.is_data else None
        )
        if watched is None:
            self._table.count_other(frame)
            return None
        values = watched.read(frame)
        if isinstance(values, Rejection):
            return values
        if watched.kind is MessageRole.OUTPUT:
            self._outputs.add(watched.message.plan.name, values, frame.t_us)
        return None

    def _collect(self, t_us: int) -> None:
        for sample in self._former.collect(t_us).to_rows():
            recent = self._recent.setdefault(sample.axle, deque())
            recent.append(sample)
            self._last_sample_us = sample.t_us
            if abs(sample.adhesion) > LEAST_FORCE:
                self._directions.add("traction" if sample.adhesion > 0.0 else "braking")
            while recent[0].t_us < sample.t_us - AXLE_US:
                recent.popleft()
            step_before = recent[-2].t_us // POINT_STEP_US if len(recent) > 1 else None
            if sample.t_us // POINT_STEP_US != step_before:
                sign = 1.0 if sample.slip >= 0 else -1.0
                self._points.append(
                    OperatingPoint(
                        sample.t_us, sample.axle, abs(sample.slip), sign * sample.adhesion
                    )
                )
        while self._points and self._points[0].t_us < t_us - POINTS_US:
            self._points.popleft()

    def _axle(self, axle: int, t_us: int) -> AxleView:
        setpoint = self._outputs.axle(axle)
        recent = [s for s in self._recent.get(axle, ()) if s.t_us > t_us - 2 * AXLE_US]
        if not recent:
            slip, creep = self._slip_of_readings(axle, t_us)
            return AxleView(axle, slip=slip, creep_speed=creep, **setpoint)
        return AxleView(
            axle,
            slip=median(sample.slip for sample in recent),
            adhesion=median(sample.adhesion for sample in recent),
            creep_speed=median(sample.creep_speed for sample in recent),
            **setpoint,
        )

    def _slip_of_readings(self, axle: int, t_us: int) -> tuple[float | None, float | None]:
        """Slip ratio and creep speed, m/s, of the latest readings, where there are no samples."""
        wheel = self._latest(Role.WHEEL_SPEED, axle, t_us)
        speed = self._latest(Role.VEHICLE_SPEED, 0, t_us)
        if wheel is None or speed is None or speed < self._configuration.sampling.v_min:
            return None, None
        radius = self._configuration.vehicle.wheel_radius[axle - 1]
        slip = float(slip_ratio(np.array(wheel), speed, radius))
        return slip, slip * speed

    def _latest(self, role: Role, axle: int, t_us: int) -> float | None:
        """Latest value of a role; None where it is not available, or older than a second."""
        stamp_us, value = self._values.get((role, axle), (0, None))
        return value if t_us - stamp_us <= 1_000_000 else None


def _watched_messages(configuration: Configuration) -> dict[str, WatchedMessage]:
    """The service's messages and those of a bench's creep controller, by their names."""
    messages: dict[str, WatchedMessage] = {}
    for names, kind in (
        (OUTPUT_MESSAGES, MessageRole.OUTPUT),
        (DEMAND_MESSAGES, MessageRole.OTHER),
    ):
        source = database_with(names, configuration.database)
        for name in names:
            message = CheckedMessage(source.message(name))
            if kind is MessageRole.OUTPUT or not _is_taken(message, name, configuration.database):
                messages[name] = WatchedMessage(message, kind)
    return messages


def _known_messages(configuration: Configuration) -> Iterator[Message]:
    """Messages of the packaged database that are watched, then those of the user's."""
    for names in (OUTPUT_MESSAGES, DEMAND_MESSAGES):
        source = database_with(names, configuration.database)
        yield from map(source.message, names)
    yield from configuration.database.db.messages


def _is_taken(message: CheckedMessage, name: str, database: CanDatabase) -> bool:
    """Whether the user's database gives the id to another message."""
    key = message.plan.frame_id, message.plan.is_extended
    return any(
        (m.frame_id, m.is_extended_frame) == key and m.name != name for m in database.db.messages
    )
