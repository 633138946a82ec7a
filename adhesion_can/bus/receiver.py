"""Frames in, readings out: each frame is judged by length, checksum, range and counter.

A frame that fails one of them is counted and goes no further. One receiver serves the service and
the check of a recording, so what the check reports is what the service would do.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from adhesion_can.bus.e2e import CounterSupervision, Rejection, checksum_ok
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.roles import BoundMessage
from adhesion_can.physics.data import Reading


@dataclass(slots=True)
class MessageRecord:
    """What was heard of one message.

    Attributes:
        message: that it is about.
        frames: heard, rejected ones included.
        rejected: by reason.
        first_us: stamp of the first accepted frame.
        last_us: stamp of the last accepted frame.
        longest_gap_us: between two accepted frames.
        gap_at_us: where it began.
        late: gaps of more than three cycles.
        not_available: readings that said so.
        readings: of all signals.

    """

    message: BoundMessage
    supervision: CounterSupervision
    frames: int = 0
    accepted: int = 0
    rejected: Counter[Rejection] = field(default_factory=Counter)
    first_us: int | None = None
    last_us: int | None = None
    longest_gap_us: int = 0
    gap_at_us: int | None = None
    late: int = 0
    not_available: int = 0
    readings: int = 0

    def note(self, t_us: int) -> None:
        """An accepted frame."""
        self.accepted += 1
        if self.first_us is None or self.last_us is None:
            self.first_us = t_us
        else:
            gap = t_us - self.last_us
            if gap > self.longest_gap_us:
                self.longest_gap_us, self.gap_at_us = gap, self.last_us
            if self.message.cycle_us and gap > 3 * self.message.cycle_us:
                self.late += 1
        self.last_us = t_us


class Receiver:
    """Judges and decodes the frames of the bound messages.

    Args:
        messages: that are heard.

    """

    def __init__(self, messages: Iterable[BoundMessage]) -> None:
        self.records = [MessageRecord(m, CounterSupervision(m.cycle_us)) for m in messages]
        """One for each message, in their order."""
        self._by_id: dict[tuple[int, bool], list[MessageRecord]] = {}
        for record in self.records:
            plan = record.message.plan
            self._by_id.setdefault((plan.frame_id, plan.is_extended), []).append(record)

    @property
    def ids(self) -> list[tuple[int, bool]]:
        """(id, extended) of every message heard."""
        return list(self._by_id)

    @property
    def rejected(self) -> int:
        """Frames rejected since start."""
        return sum(sum(record.rejected.values()) for record in self.records)

    @property
    def lost(self) -> int:
        """Frames lost since start, by the counters."""
        return sum(record.supervision.lost for record in self.records)

    def accept(self, frame: Frame) -> list[Reading] | Rejection | None:
        """Take one frame.

        Args:
            frame: any.

        Returns:
            Its readings, or why it was rejected, or None where it is none of ours.

        """
        record = self._record(frame)
        if record is None:
            return None
        record.frames += 1
        outcome = self._judge(record, frame)
        if isinstance(outcome, Rejection):
            record.rejected[outcome] += 1
        else:
            record.note(frame.t_us)
            record.readings += len(outcome)
            record.not_available += sum(reading.value is None for reading in outcome)
        return outcome

    def _record(self, frame: Frame) -> MessageRecord | None:
        if not frame.is_data:
            return None
        for record in self._by_id.get((frame.arbitration_id, frame.is_extended), ()):
            # Some formats know no channels: there a frame may be any bus's.
            if record.message.channel in (None, frame.channel) or not frame.channel:
                return record
        return None

    def _judge(self, record: MessageRecord, frame: Frame) -> list[Reading] | Rejection:
        message, data = record.message, frame.data
        supervised = message.data_id is not None
        if len(data) != message.plan.size:
            outcome: list[Reading] | Rejection = Rejection.LENGTH
        elif message.data_id is not None and not checksum_ok(data, message.data_id):
            outcome = Rejection.CHECKSUM
        else:
            outcome = decode(message, data, frame.t_us)
        if isinstance(outcome, Rejection):
            record.supervision.interrupt()
        elif supervised:
            return record.supervision.accept(data[1] & 0x0F, frame.t_us) or outcome
        return outcome


def decode(message: BoundMessage, data: bytes, t_us: int) -> list[Reading] | Rejection:
    """Readings of a payload of the right length; a value out of its range rejects the frame.

    Args:
        message: that the payload belongs to.
        data: payload.
        t_us: stamp of the readings.

    """
    little = int.from_bytes(data, "little")
    big = int.from_bytes(data, "big")
    readings: list[Reading] = []
    for signal in message.signals:
        plan = signal.plan
        if message.plan.multiplexed and not message.plan.present(plan.name, little, big):
            continue
        raw = plan.raw(big if plan.big_endian else little)
        if raw == signal.not_available:
            readings.append(Reading(t_us, signal.role, signal.axle, None))
            continue
        value = plan.value(raw)
        if not plan.in_range(value):
            return Rejection.RANGE
        si = value * signal.scale - signal.offset
        readings.append(Reading(t_us, signal.role, signal.axle, si))
    return readings
