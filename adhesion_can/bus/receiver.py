"""Receiver of the service: frames in, readings out.

Each frame passes the checks of `acceptance`; a rejected one is counted and goes no further. The
service and the check of a recording use the same receiver, so the check reports what the service
would do. `Receiver.accept` is the reference; `accept_block` gives the same for a block of frames.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.acceptance import DecodedFrame, accept_frame
from adhesion_can.bus.block import EXTENDED, Block
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.j1939 import (
    IdFilter,
    Senders,
    group_mask,
    parameter_group,
    unmarked_sentence,
)
from adhesion_can.bus.message_record import MessageRecord
from adhesion_can.bus.receiver_columns import ReceivedBlock, RecordsById, receive_block
from adhesion_can.bus.rejection import Rejection
from adhesion_can.bus.roles import BoundMessage
from adhesion_can.physics.readings import Reading, role_name


class Receiver:
    """Checks and decodes the frames of the messages whose signals have roles.

    Args:
        messages: Messages to receive.

    """

    def __init__(self, messages: Iterable[BoundMessage]) -> None:
        self.records = [
            MessageRecord.begin(message, partial(decode, message)) for message in messages
        ]
        """Statistics of each message, in the order of the messages."""
        self._by_id: RecordsById = {}
        for record in self.records:
            plan = record.message.plan
            self._by_id.setdefault((plan.frame_id, plan.is_extended), []).append(record)
        plans = (record.message.plan for record in self.records)
        self.senders = Senders(plan.frame_id for plan in plans if plan.is_j1939)
        """Senders of J1939 messages."""
        self.same_group: dict[int, int] = {}
        """Identifier on the bus with the J1939 group of a message, by the message's own, where the
        database does not say that it is one of J1939."""
        self._unmarked = {
            parameter_group(number): number
            for number, is_extended in self._by_id
            if is_extended and not self.senders.covers(number)
        }

    @property
    def unmarked(self) -> list[str]:
        """Sentences about messages that nobody sends while their group is on the bus."""
        plans = (record.message.plan for record in self.records if not record.frames)
        return [
            unmarked_sentence(plan.name, plan.frame_id, self.same_group[plan.frame_id])
            for plan in plans
            if plan.is_extended and plan.frame_id in self.same_group
        ]

    @property
    def ids(self) -> list[IdFilter]:
        """Filters of every message to receive."""
        filters = []
        for number, is_extended in self._by_id:
            if is_extended and self.senders.covers(number):
                filters.append(IdFilter(number, is_extended, group_mask(number)))
            else:
                filters.append(IdFilter.exact(number, is_extended))
        return filters

    @property
    def rejected(self) -> int:
        """Number of frames rejected since the start."""
        return sum([record.frames - record.accepted for record in self.records])

    @property
    def stuck(self) -> int:
        """Number of readings left out since the start, since their signal was stuck."""
        return sum([record.stuck for record in self.records])

    @property
    def stuck_sentences(self) -> list[str]:
        """Sentences about messages of which readings were left out, since they were stuck."""
        return [
            f"{record.message.plan.name} ({record.message.plan.frame_id:#x}): dropped "
            f"{record.stuck} readings of a stuck signal: frames arrived but its value no longer "
            "changed (if it may stay constant, set stuck_check = false for its role)"
            for record in self.records
            if record.stuck
        ]

    @property
    def stuck_signals(self) -> list[str]:
        """Signals that are stuck now, by their roles' names."""
        return [
            role_name(*key)
            for record in self.records
            for key, check in record.stuck_checks.items()
            if check.is_stuck
        ]

    @property
    def lost(self) -> int:
        """Number of frames lost since the start, by the counters."""
        return sum([record.acceptance.lost for record in self.records])

    def accept(self, frame: Frame) -> list[Reading] | Rejection | None:
        """Check and decode one frame.

        Args:
            frame: Any frame of the bus.

        Returns:
            Its readings, or the reason to reject it, or None where its id is not received.

        """
        record = self._record(frame)
        if record is None:
            if self._unmarked and frame.is_extended:
                self._note_group(frame.arbitration_id)
            return None
        record.frames += 1
        outcome = accept_frame(record.acceptance, frame, record.decode)
        if isinstance(outcome, Rejection):
            record.rejected[outcome] += 1
        else:
            record.add(frame.t_us)
            record.readings += len(outcome)
            record.not_available += [reading.value for reading in outcome].count(None)
            if record.stuck_checks:
                return record.leave_out_stuck(outcome)
        return outcome

    def accept_block(self, block: Block, t_us: NDArray[np.int64]) -> ReceivedBlock:
        """Check and decode the frames of a block, as `accept` does one after another.

        Args:
            block: Frames and marks.
            t_us: Time stamps in place of the block's own, µs, not descending, shape (n,).

        """
        if self.senders:
            keys = self.senders.translate_keys(block.key, block.is_data)
            block = replace(block, key=keys)
        if self._unmarked:
            keys = np.unique(block.key[block.is_data])
            for key in keys[keys >= EXTENDED].tolist():
                self._note_group(key & ~int(EXTENDED))
        return receive_block(self._by_id, block, t_us)

    def _note_group(self, number: int) -> None:
        named = self._unmarked.get(parameter_group(number))
        if named is not None and number != named:
            self.same_group[named] = min(number, self.same_group.get(named, number))

    def _record(self, frame: Frame) -> MessageRecord | None:
        if not frame.is_data:
            return None
        number = frame.arbitration_id
        if frame.is_extended and self.senders:
            number = self.senders.translate(number)
        for record in self._by_id.get((number, frame.is_extended), ()):
            # Some formats know no channels: there a frame may be any bus's.
            if record.message.channel in (None, frame.channel) or not frame.channel:
                return record
            record.other_channels.add(frame.channel)
        return None


def decode(message: BoundMessage, frame: Frame) -> DecodedFrame[list[Reading]]:
    """Readings of a frame whose payload has the length of its message.

    Unknown multiplexer values select no signal; they are not looked for.
    """
    little = int.from_bytes(frame.data, "little")
    big = int.from_bytes(frame.data, "big")
    t_us, multiplexed = frame.t_us, message.plan.multiplexed
    readings: list[Reading] = []
    in_range = True
    for signal in message.signals:
        plan = signal.plan
        if multiplexed and not message.plan.present(plan.name, little, big):
            continue
        raw = plan.raw(big if plan.big_endian else little)
        if raw == signal.not_available:
            readings.append(Reading(t_us, signal.role, signal.axle, None))
            continue
        value = plan.value(raw)
        si = value * signal.scale - signal.offset
        # A number may be too large for SI alone: kN of a float signal without a range.
        if not (plan.in_range(value) and isfinite(si)):
            in_range = False
        readings.append(Reading(t_us, signal.role, signal.axle, si))
    return DecodedFrame(readings, in_range)
