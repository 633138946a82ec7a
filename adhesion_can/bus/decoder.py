"""Decoder of `convert`: blocks of frames into columns of signals, with any database.

Values equal those of cantools' `decode_message`. Frames pass the checks of `acceptance` under
`CONVERT_POLICY`; rejected ones are counted by reason, never dropped in silence.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from adhesion_can.bus.acceptance import CONVERT_POLICY, MessageAcceptance
from adhesion_can.bus.acceptance_columns import DecodedRows, accept_rows
from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.bus.database import CanDatabase, cycle_us, e2e_data_id
from adhesion_can.bus.id_codes import UNSEEN, KeyCodes
from adhesion_can.bus.j1939 import (
    NULL_ADDRESS,
    SERVICE_GROUPS,
    Senders,
    is_j1939,
    parameter_group,
    source_address,
)
from adhesion_can.bus.rejection import REJECTIONS, Rejection
from adhesion_can.bus.signal_columns import MessageSignals, SignalColumn


@dataclass(frozen=True)
class MessageColumns:
    """The frames of one message in a block.

    Attributes:
        message: Message of the database.
        rows: Rows of the block, ascending, shape (n,).
        t_ns: Time stamps, ns, shape (n,).
        words: Payloads as 64-bit words, as far as the message reaches, shape (n, w).
        outcome: 0 where decoded, else the code of the rejection, shape (n,).
        signals: Columns of the wanted signals by name; undefined in rejected rows.

    """

    message: Message
    rows: NDArray[np.int64]
    t_ns: NDArray[np.int64]
    words: NDArray[np.uint64]
    outcome: NDArray[np.uint8]
    signals: Mapping[str, SignalColumn]

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(slots=True)
class MessageCount:
    """Numbers of frames of one message.

    Attributes:
        frames: Number of received frames, rejected ones included.
        decoded: Number of decoded frames.
        rejected: Number of rejected frames by reason.
        lost: Number of frames that were not received, by the counter.

    """

    frames: int = 0
    decoded: int = 0
    rejected: Counter[Rejection] = field(default_factory=Counter)
    lost: int = 0

    def plus(self, other: "MessageCount") -> "MessageCount":
        """Sum of the numbers of two messages."""
        return MessageCount(
            self.frames + other.frames,
            self.decoded + other.decoded,
            self.rejected + other.rejected,
            self.lost + other.lost,
        )


@dataclass(slots=True)
class DecodeReport:
    """Numbers of all rows by their fate.

    Attributes:
        counts: Numbers of frames of each received message, by (name, id, extended).
        passed_over: Number of frames of messages without a wanted and decodable signal, by name.
        unknown: Number of data frames of ids that the database lacks, by (id, extended), for the
            first thousand or so of such ids.
        unknown_beyond: Number of data frames of all further such ids: a bus of random ids must not
            fill the memory.
        remote: Number of remote requests.
        error: Number of error frames.
        marks: Number of marks of a service.
        undecodable: Reasons why a message or a signal can never be decoded, by 'Message' or
            'Message.Signal'.

    """

    counts: dict[tuple[str, int, bool], MessageCount] = field(default_factory=dict)
    passed_over: Counter[str] = field(default_factory=Counter)
    unknown: Counter[tuple[int, bool]] = field(default_factory=Counter)
    unknown_beyond: int = 0
    remote: int = 0
    error: int = 0
    marks: int = 0
    undecodable: dict[str, str] = field(default_factory=dict)

    @property
    def messages(self) -> dict[str, MessageCount]:
        """Numbers by name alone, those of messages of one name together."""
        by_name: dict[str, MessageCount] = {}
        for (name, _, _), count in self.counts.items():
            by_name[name] = by_name[name].plus(count) if name in by_name else count
        return by_name

    @property
    def frames(self) -> int:
        """Number of data frames, remote requests and error frames of every id."""
        known = sum(count.frames for count in self.counts.values())
        others = self.passed_over.total() + self.unknown.total() + self.unknown_beyond
        return known + others + self.remote + self.error


class Decoder:
    """Decodes blocks that follow each other.

    Messages with the attribute E2EDataId have their checksums and counters checked, the counters of
    each channel for themselves.

    Args:
        database: Database of any format that cantools reads.
        wanted: Predicate of the signals to decode, by the names of message and signal; None: all.

    Raises:
        DatabaseError: An E2EDataId is no number from 0 to 65535.

    """

    def __init__(
        self, database: CanDatabase, wanted: Callable[[str, str], bool] | None = None
    ) -> None:
        self.report = DecodeReport()
        # Of several messages with one id the last one counts, as in cantools.
        by_key = {_key_of(message): message for message in database.db.messages}
        self._messages = {
            key: _MessageDecoder(message, wanted, self.report.undecodable)
            for key, message in by_key.items()
        }
        self._codes = KeyCodes(self._messages)
        self._in_database = len(self._messages)
        self._wanted = wanted
        self._senders = Senders(m.frame_id for m in by_key.values() if is_j1939(m))

    def decode(self, block: Block) -> list[MessageColumns]:
        """Columns of each message in a block, in the order of the database.

        Args:
            block: Next block of the recording.

        """
        decoded = []
        for key, rows in self._groups(block):
            decoder = self._messages[key]
            if not decoder.signals:
                self.report.passed_over[decoder.message.name] += len(rows)
                continue
            columns, lost = decoder.decode(block, rows)
            self._count(columns, lost)
            decoded.append(columns)
        return decoded

    def _groups(self, block: Block) -> Iterator[tuple[int, NDArray[np.int64]]]:
        """(key, its rows in order) of the database's messages; other data frames are counted."""
        is_data = block.is_data
        data = None if is_data.all() else np.flatnonzero(is_data)
        if data is not None:
            kinds = np.bincount(block.kind, minlength=len(Kind)).tolist()
            self.report.remote += kinds[Kind.REMOTE]
            self.report.error += kinds[Kind.ERROR]
            self.report.marks += sum(kinds[Kind.ADVANCE :])
        keys = block.key if data is None else block.key[data]
        codes = self._codes.encode(keys)
        order = np.argsort(codes, kind="stable")  # of 16 bits: a radix sort
        begin = 0
        for code, count in enumerate(np.bincount(codes).tolist()):
            rows = order[begin : begin + count]
            begin += count
            if code == UNSEEN:
                self.report.unknown_beyond += count
            elif count and code > self._in_database and not self._knows(self._codes.keys[code]):
                self.report.unknown[_id_of(self._codes.keys[code])] += count
            elif count:
                yield self._codes.keys[code], rows if data is None else data[rows]

    def name_of(self, number: int, *, is_extended: bool) -> str:
        """What an id that a J1939 database lacks is for; '' where that is not known."""
        if not (is_extended and self._senders):
            return ""
        name = SERVICE_GROUPS.get(parameter_group(number), "")
        return f"J1939 {name}" if name else ""

    def _knows(self, key: int) -> bool:
        """Whether an id is that of another sender of a J1939 message; it then has its decoder."""
        number, is_extended = _id_of(key)
        if key in self._messages or not (is_extended and self._senders):
            return key in self._messages
        named = self._senders.find(number)
        if named is None:
            return False
        message = copy(self._messages[named | EXTENDED].message)
        message.frame_id = number
        sender = source_address(number)
        first = self._senders.heard.setdefault(named, sender) == sender
        base_name = message.name
        if not (first and source_address(named) == NULL_ADDRESS):
            message.name = f"{base_name}@{number:X}"
        wanted = self._wanted

        def is_wanted(_message: str, signal: str) -> bool:
            return wanted is None or wanted(base_name, signal)

        self._messages[key] = _MessageDecoder(message, is_wanted, self.report.undecodable)
        return True

    def _count(self, columns: MessageColumns, lost: int) -> None:
        message = columns.message
        key = message.name, message.frame_id, message.is_extended_frame
        count = self.report.counts.setdefault(key, MessageCount())
        rejected = columns.outcome[columns.outcome > 0]
        count.frames += len(columns)
        count.decoded += len(columns) - len(rejected)
        count.lost += lost
        for code, number in enumerate(np.bincount(rejected).tolist()):
            if number:
                count.rejected[REJECTIONS[code - 1]] += number


class _MessageDecoder:
    """Checks and decodes the frames of one message."""

    def __init__(
        self,
        message: Message,
        wanted: Callable[[str, str], bool] | None,
        undecodable: dict[str, str],
    ) -> None:
        self.message = message
        self.signals = MessageSignals(message, wanted, undecodable)
        data_id = e2e_data_id(message)
        if data_id is not None and message.length < 2:
            undecodable[f"{message.name}.E2EDataId"] = (
                f"it does not fit into {message.length} bytes"
            )
            data_id = None
        self._acceptance = MessageAcceptance(
            CONVERT_POLICY, message.length, data_id, cycle_us(message)
        )

    def decode(self, block: Block, rows: NDArray[np.int64]) -> tuple[MessageColumns, int]:
        """Columns of the message's rows in a block, and the number of lost frames."""
        before = self._acceptance.lost
        accepted = accept_rows(self._acceptance, block, rows, self._decode)
        t_ns = block.t_ns.take(rows)
        columns = MessageColumns(
            self.message, rows, t_ns, accepted.words, accepted.outcome, accepted.columns
        )
        return columns, self._acceptance.lost - before

    def _decode(self, words: NDArray[np.uint64]) -> DecodedRows[dict[str, SignalColumn]]:
        columns, unknown = self.signals.decode(words)
        return DecodedRows(columns, unknown_selector=unknown)


def _key_of(message: Message) -> int:
    return message.frame_id | (EXTENDED if message.is_extended_frame else 0)


def _id_of(key: int) -> tuple[int, bool]:
    return key & ~EXTENDED, key >= EXTENDED
