"""Receiver of the service for blocks of frames: `Receiver.accept` in columns, to the last bit."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.acceptance_columns import DecodedRows, accept_rows
from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.bus.message_record import MessageRecord
from adhesion_can.bus.rejection import REJECTION_CODE, REJECTIONS, Rejection
from adhesion_can.bus.roles import BoundMessage
from adhesion_can.physics.readings import Role

RecordsById = dict[tuple[int, bool], list[MessageRecord]]
"""Records by (id, extended) of their messages."""

_Column = tuple[NDArray[np.bool_] | None, NDArray[np.float64]]
"""Rows that carry a signal (None: all), and its SI values, NaN where not available."""
_Columns = Mapping[tuple[Role, int], _Column]


@dataclass(slots=True)
class ReceivedBlock:
    """Outcome of the checks for a block of frames, and its readings.

    Attributes:
        readings: Time stamps, µs, and SI values (NaN: not available) by role and axle.
        accepted: Rows of accepted frames, ascending, one array a message.
        rejected: Rows of rejected frames, ascending, one array a message.
        lost: Rows that follow lost frames, and the number of frames lost before each; a message.
        foreign: Number of frames whose id is not received.

    """

    readings: dict[tuple[Role, int], tuple[NDArray[np.int64], NDArray[np.float64]]] = field(
        default_factory=dict
    )
    accepted: list[NDArray[np.int64]] = field(default_factory=list)
    rejected: list[NDArray[np.int64]] = field(default_factory=list)
    lost: list[tuple[NDArray[np.int64], NDArray[np.int64]]] = field(default_factory=list)
    foreign: int = 0


def receive_block(by_id: RecordsById, block: Block, t_us: NDArray[np.int64]) -> ReceivedBlock:
    """Check and decode the frames of a block, and count them in the records.

    Args:
        by_id: Records of the messages to receive, by (id, extended).
        block: Frames and marks.
        t_us: Time stamps in place of the block's own, µs, not descending, shape (n,).

    """
    received = ReceivedBlock()
    known = 0
    for record, rows in _rows_by_record(by_id, block):
        known += len(rows)
        _receive_rows(record, rows, block, t_us[rows], received)
    received.foreign = int((block.kind <= Kind.ERROR).sum()) - known
    return received


def _rows_by_record(
    by_id: RecordsById, block: Block
) -> Iterator[tuple[MessageRecord, NDArray[np.int64]]]:
    """Rows of each message by id and channel."""
    data = block.is_data
    for (frame_id, is_extended), records in by_id.items():
        key = frame_id | EXTENDED if is_extended else frame_id
        rows = np.flatnonzero(data & (block.key == key))
        for record in records:
            if not len(rows):
                break
            channel = record.message.channel
            places = [i for i, name in enumerate(block.channels) if name in (channel, "")]
            of_channel = (
                np.ones(len(rows), dtype=np.bool_)
                if channel is None
                else np.isin(block.channel[rows], places)
            )
            yield record, rows[of_channel]
            rows = rows[~of_channel]
            if len(rows):
                others = np.unique(block.channel[rows]).tolist()
                record.other_channels.update(block.channels[place] for place in others)


def _receive_rows(
    record: MessageRecord,
    rows: NDArray[np.int64],
    block: Block,
    t_us: NDArray[np.int64],
    received: ReceivedBlock,
) -> None:
    """Check and decode the rows of one message."""
    record.frames += len(rows)
    accepted = accept_rows(record.acceptance, block, rows, partial(_decode, record.message), t_us)
    good = accepted.outcome == 0
    counts = np.bincount(accepted.outcome, minlength=1 + len(REJECTIONS)).tolist()
    for reason, code in REJECTION_CODE.items():
        if counts[code]:
            record.rejected[reason] += counts[code]
    record.add_all(t_us[good])
    # Where no payload has the right length, the message has no signals at all.
    any_payload = counts[REJECTION_CODE[Rejection.LENGTH]] < len(rows)
    for key, (present, values) in accepted.columns.items() if any_payload else ():
        carried = good if present is None else good & present
        record.readings += int(carried.sum())
        record.not_available += int(np.isnan(values[carried]).sum())
        kept = values[carried]
        kept[record.find_stuck(key, kept)] = np.nan
        received.readings[key] = (t_us[carried], kept)
    received.accepted.append(rows[good])
    received.rejected.append(rows[~good])
    received.lost.append((rows[accepted.lost > 0], accepted.lost[accepted.lost > 0]))


def _decode(message: BoundMessage, words: NDArray[np.uint64]) -> DecodedRows[_Columns]:
    """Signals of the payloads of a message, as `receiver.decode` gives them."""
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
    return DecodedRows(columns, inside)
