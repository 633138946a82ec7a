"""Frames in, readings out: each frame is judged by length, checksum, range and counter.

A frame that fails one of them is counted and goes no further. One receiver serves the service and
the check of a recording, so what the check reports is what the service would do. It takes frames
one by one or a block of them; what comes out is equal to the last bit.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.bus.e2e import (
    REJECTION_CODE,
    REJECTIONS,
    CounterSupervision,
    Rejection,
    checksum_ok,
    checksums_ok,
    counts_of,
)
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.roles import BoundMessage
from adhesion_can.physics.readings import Reading, Role


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

    def note_all(self, t_us: NDArray[np.int64]) -> None:
        """As `note` for accepted frames that follow each other."""
        if not len(t_us):
            return
        self.accepted += len(t_us)
        start = int(t_us[0])
        gaps = np.diff(t_us, prepend=start if self.last_us is None else self.last_us)
        if self.first_us is None:
            self.first_us = start
        longest = int(np.argmax(gaps))
        if int(gaps[longest]) > self.longest_gap_us:
            self.longest_gap_us = int(gaps[longest])
            self.gap_at_us = int(t_us[longest]) - self.longest_gap_us
        if self.message.cycle_us:
            self.late += int((gaps > 3 * self.message.cycle_us).sum())
        self.last_us = int(t_us[-1])


@dataclass(slots=True)
class Received:
    """What a block of frames told.

    Attributes:
        readings: stamps and SI values (NaN: not available) of each signal that has a role.
        accepted: rows of accepted frames by message, each ascending.
        rejected: rows of rejected frames by message, each ascending.
        lost: rows that came after lost frames, and how many those were, by message.
        foreign: frames of ids that nobody listens to.

    """

    readings: dict[tuple[Role, int], tuple[NDArray[np.int64], NDArray[np.float64]]] = field(
        default_factory=dict
    )
    accepted: list[NDArray[np.int64]] = field(default_factory=list)
    rejected: list[NDArray[np.int64]] = field(default_factory=list)
    lost: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = field(default_factory=list)
    foreign: int = 0


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

    def accept_block(self, block: Block, t_us: NDArray[np.int64]) -> Received:
        """Take the frames of a block, as `accept` takes one after another.

        Args:
            block: frames and marks.
            t_us: stamps that count in place of the block's own; they do not run backwards.

        """
        received = Received()
        known = 0
        for record, rows in self._rows(block):
            known += len(rows)
            self._take(record, rows, block, t_us, received)
        received.foreign = int((block.kind <= Kind.ERROR).sum()) - known
        return received

    def _rows(self, block: Block) -> Iterator[tuple[MessageRecord, NDArray[np.int64]]]:
        """Rows of the block that each message has, by the rule of `_record`."""
        data = block.is_data
        for (frame_id, is_extended), records in self._by_id.items():
            key = frame_id | EXTENDED if is_extended else frame_id
            rows = np.flatnonzero(data & (block.key == key))
            for record in records:
                if not len(rows):
                    break
                channel = record.message.channel
                places = [i for i, name in enumerate(block.channels) if name in (channel, "")]
                own = (
                    np.ones(len(rows), dtype=np.bool_)
                    if channel is None
                    else np.isin(block.channel[rows], places)
                )
                yield record, rows[own]
                rows = rows[~own]

    def _take(
        self,
        record: MessageRecord,
        rows: NDArray[np.int64],
        block: Block,
        t_us: NDArray[np.int64],
        received: Received,
    ) -> None:
        record.frames += len(rows)
        outcome, lost, columns = _judged(record, block.words[rows], block.length[rows], t_us[rows])
        good = outcome == 0
        for code, count in enumerate(np.bincount(outcome).tolist()[1:], start=1):
            if count:
                record.rejected[REJECTIONS[code - 1]] += count
        stamps = t_us[rows]
        record.note_all(stamps[good])
        for key, (present, values) in columns.items():
            told = good if present is None else good & present
            record.readings += int(told.sum())
            record.not_available += int(np.isnan(values[told]).sum())
            received.readings[key] = (stamps[told], values[told])
        received.accepted.append(rows[good])
        received.rejected.append(rows[~good])
        received.lost.append((rows[lost > 0], lost[lost > 0]))

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
        si = value * signal.scale - signal.offset
        # A number may be too large for SI alone: kN of a float signal without a range.
        if not (plan.in_range(value) and isfinite(si)):
            return Rejection.RANGE
        readings.append(Reading(t_us, signal.role, signal.axle, si))
    return readings


_Column = tuple[NDArray[np.bool_] | None, NDArray[np.float64]]
"""Rows that carry a signal (None: all), and SI values, NaN where not available."""


def _judged(
    record: MessageRecord,
    words: NDArray[np.uint64],
    length: NDArray[np.uint8],
    t_us: NDArray[np.int64],
) -> tuple[NDArray[np.uint8], NDArray[np.int64], Mapping[tuple[Role, int], _Column]]:
    """Outcome of each frame of a message, frames lost before it, and its signals."""
    message = record.message
    size = message.plan.size
    outcome = np.zeros(len(words), dtype=np.uint8)
    sound = length == size
    outcome[~sound] = REJECTION_CODE[Rejection.LENGTH]
    columns: dict[tuple[Role, int], _Column] = {}
    if sound.any():
        if message.data_id is not None:
            wrong = sound & ~checksums_ok(words, size, message.data_id)
            outcome[wrong] = REJECTION_CODE[Rejection.CHECKSUM]
            sound &= ~wrong
        columns, inside = _signals(message, words)
        outcome[sound & ~inside] = REJECTION_CODE[Rejection.RANGE]
        sound &= inside
    lost = np.zeros(len(words), dtype=np.int64)
    if message.data_id is not None:
        judged, lost = record.supervision.accept_all(counts_of(words), t_us, sound)
        outcome[sound] = judged[sound]
    return outcome, lost, columns


def _signals(
    message: BoundMessage, words: NDArray[np.uint64]
) -> tuple[dict[tuple[Role, int], _Column], NDArray[np.bool_]]:
    """Signals of a message as `decode` gives them, and the rows with none out of its range."""
    inside = np.ones(len(words), dtype=np.bool_)
    columns: dict[tuple[Role, int], _Column] = {}
    for signal in message.signals:
        plan = signal.plan
        present = message.plan.present_column(plan.name, words)
        raw = plan.raw_column(words)
        value = plan.value_column(raw)
        # What is too large or no number is out of range, and no reason for a warning.
        with np.errstate(over="ignore", invalid="ignore"):
            si = value * signal.scale - signal.offset
        ok = plan.in_range_column(value) & np.isfinite(si)
        if signal.not_available is not None:
            missing = raw == signal.not_available
            si[missing] = np.nan
            ok |= missing
        if present is not None:
            ok |= ~present
        inside &= ok
        columns[signal.role, signal.axle] = (present, si)
    return columns, inside
