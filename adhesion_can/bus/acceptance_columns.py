"""Acceptance of many frames of one message at once: `acceptance.accept_frame` in columns."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.acceptance import MessageAcceptance
from adhesion_can.bus.block import Block, to_micros
from adhesion_can.bus.e2e import checksums_ok, counter_column
from adhesion_can.bus.rejection import REJECTION_CODE, Rejection

Columns = TypeVar("Columns")
Mask = NDArray[np.bool_]
Words = NDArray[np.uint64]
"""Payloads as little-endian words of 8 bytes, shape (n, w)."""

_LENGTH = np.uint8(REJECTION_CODE[Rejection.LENGTH])
_CHECKSUM = np.uint8(REJECTION_CODE[Rejection.CHECKSUM])
_RANGE = np.uint8(REJECTION_CODE[Rejection.RANGE])
_MULTIPLEXER = np.uint8(REJECTION_CODE[Rejection.MULTIPLEXER])


class DecodedRows(NamedTuple, Generic[Columns]):
    """Signals of many payloads of one message.

    Attributes:
        columns: Decoded columns, in the form of the decoder; undefined in rejected rows.
        in_range: Rows with each available value within its range, shape (n,); None: all.
        unknown_selector: Rows with a multiplexer value that the database does not define,
            shape (n,); None: none.

    """

    columns: Columns
    in_range: Mask | None = None
    unknown_selector: Mask | None = None


@dataclass(frozen=True, slots=True)
class AcceptedRows(Generic[Columns]):
    """Outcome of the checks for many frames of one message.

    Attributes:
        words: Payloads, as far as the message reaches, shape (n, w).
        outcome: 0 where accepted, else the code of the rejection, shape (n,).
        lost: Number of lost frames before each row, by the counter, shape (n,).
        columns: Decoded columns, in the form of the decoder; undefined in rejected rows.

    """

    words: Words
    outcome: NDArray[np.uint8]
    lost: NDArray[np.int64]
    columns: Columns


def accept_rows(
    acceptance: MessageAcceptance,
    block: Block,
    rows: NDArray[np.int64],
    decode: Callable[[Words], DecodedRows[Columns]],
    t_us: NDArray[np.int64] | None = None,
) -> AcceptedRows[Columns]:
    """Check and decode the frames of one message, as `accept_frame` does one after another.

    Args:
        acceptance: Protection and counters of the message.
        block: Frames of a recording.
        rows: Rows of the block with frames of the message, ascending, shape (n,).
        decode: Decoder of payloads.
        t_us: Time stamps of the rows, µs, shape (n,); None: those of the block.

    """
    words = block.payload_words(rows, acceptance.size)
    outcome = _check_payloads(acceptance, words, block.length.take(rows))
    decoded = decode(words)
    if acceptance.policy.check_range and decoded.in_range is not None:
        outcome[~decoded.in_range & (outcome == 0)] = _RANGE
    if acceptance.data_id is None:
        lost = np.zeros(len(rows), dtype=np.int64)
    else:
        stamps = to_micros(block.t_ns.take(rows)) if t_us is None else t_us
        lost = _check_counters(acceptance, block, rows, stamps, words, outcome)
    if acceptance.policy.check_selectors and decoded.unknown_selector is not None:
        outcome[decoded.unknown_selector & (outcome == 0)] = _MULTIPLEXER
    return AcceptedRows(words, outcome, lost, decoded.columns)


def _check_payloads(
    acceptance: MessageAcceptance, words: Words, length: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Outcome of the checks of length and checksum, shape (n,)."""
    if acceptance.data_id is None:
        exact = acceptance.policy.exact_length
        wrong = length != acceptance.size if exact else length < acceptance.size
        return np.asarray(wrong * _LENGTH)
    # The checksum covers a payload of the message's length, and of no other.
    outcome = ~checksums_ok(words, acceptance.size, acceptance.data_id) * _CHECKSUM
    outcome[length != acceptance.size] = _LENGTH
    return np.asarray(outcome)


def _check_counters(
    acceptance: MessageAcceptance,
    block: Block,
    rows: NDArray[np.int64],
    t_us: NDArray[np.int64],
    words: Words,
    outcome: NDArray[np.uint8],
) -> NDArray[np.int64]:
    """Check the counters of the rows accepted so far, into `outcome`; lost frames, shape (n,)."""
    counts, valid = counter_column(words), outcome == 0
    if len(block.channels) == 1 or not acceptance.policy.counter_per_channel:
        counter = acceptance.counter(block.channels[0])
        codes, lost = counter.accept_all(counts, t_us, valid)
        np.maximum(outcome, codes, out=outcome)
        return lost
    lost = np.zeros(len(rows), dtype=np.int64)
    channel = block.channel.take(rows)
    for place in np.flatnonzero(np.bincount(channel)).tolist():
        here = np.flatnonzero(channel == place)
        counter = acceptance.counter(block.channels[place])
        codes, lost[here] = counter.accept_all(counts[here], t_us[here], valid[here])
        outcome[here] = np.maximum(outcome[here], codes)
    return lost
