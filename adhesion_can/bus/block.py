"""Frames of a recording in columns: many `Frame`s and `Mark`s at a time."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.frame import ADVANCE, SECOND_SENDER, STOP, Frame, Mark

EXTENDED = 1 << 31
"""Bit of a key that marks an id of 29 bits."""


class Kind(IntEnum):
    """Kind of a row."""

    DATA = 0
    FD = 1
    REMOTE = 2
    ERROR = 3
    ADVANCE = 4
    SECOND_SENDER = 5
    STOP = 6


_MARK_KINDS = {ADVANCE: Kind.ADVANCE, SECOND_SENDER: Kind.SECOND_SENDER, STOP: Kind.STOP}
_MARK_NAMES = {kind: name for name, kind in _MARK_KINDS.items()}


@dataclass(frozen=True, slots=True)
class Block:
    """Rows of a recording, in the order of the file.

    Attributes:
        t_ns: Time stamps, ns, shape (n,).
        key: Arbitration id, with `EXTENDED` where it has 29 bits; 0 for a mark; shape (n,).
        kind: Number of the row's `Kind`, shape (n,).
        length: Length of the payload, bytes, shape (n,).
        channel: Index of the name of the row's bus in `channels`, shape (n,).
        words: Payload as little-endian words of 8 bytes, 0 behind its end, shape (n, w) with
            w = 1, or 8 where a payload is longer than 8 bytes.
        channels: Names of buses; '' where the format knows none.

    """

    t_ns: NDArray[np.int64]
    key: NDArray[np.uint32]
    kind: NDArray[np.uint8]
    length: NDArray[np.uint8]
    channel: NDArray[np.uint16]
    words: NDArray[np.uint64]
    channels: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def t_us(self) -> NDArray[np.int64]:
        """Stamps in µs, rounded to the nearest, a half to the even one; shape (n,)."""
        return to_micros(self.t_ns)

    @property
    def is_data(self) -> NDArray[np.bool_]:
        """Rows that carry a payload, shape (n,)."""
        return self.kind <= Kind.FD

    @property
    def payload(self) -> NDArray[np.uint8]:
        """Payload as bytes, 0 behind its end, shape (n, 8 w)."""
        return np.ascontiguousarray(self.words).astype("<u8", copy=False).view(np.uint8)

    def select(self, rows: NDArray[np.bool_] | NDArray[np.int64] | slice) -> "Block":
        """The rows that a mask, index array or slice names."""
        return Block(
            t_ns=self.t_ns[rows],
            key=self.key[rows],
            kind=self.kind[rows],
            length=self.length[rows],
            channel=self.channel[rows],
            words=self.words[rows],
            channels=self.channels,
        )

    def stamped(self, t_ns: NDArray[np.int64]) -> "Block":
        """The rows with other stamps, ns, shape (n,)."""
        return replace(self, t_ns=t_ns)

    def payload_words(self, rows: NDArray[np.int64], size: int) -> NDArray[np.uint64]:
        """Payloads of some rows as far as a message of `size` bytes reaches, shape (n, w).

        Where every payload of the block is shorter than the message, zeros stand behind its end.
        """
        needed = 1 if size <= 8 else 8
        width = self.words.shape[1]
        if width == needed:
            return self.words.take(rows, axis=0)
        return _widened(self.words[:, :needed].take(rows, axis=0), needed)

    def channels_of(self, rows: NDArray[np.int64]) -> list[str]:
        """Names of the buses of some rows, at least one row."""
        if len(self.channels) == 1:
            return [self.channels[0]]
        places = np.flatnonzero(np.bincount(self.channel[rows])).tolist()
        return [self.channels[place] for place in places]

    def items(self) -> Iterator[Frame | Mark]:
        """Rows one by one, as a reader of frames gives them."""
        payload = self.payload
        rows = zip(
            self.t_us.tolist(),
            self.key.tolist(),
            self.kind.tolist(),
            self.length.tolist(),
            self.channel.tolist(),
            strict=True,
        )
        for place, (t_us, key, kind, length, channel) in enumerate(rows):
            if kind in _MARK_NAMES:
                yield Mark(t_us, _MARK_NAMES[Kind(kind)])
                continue
            is_error = kind == Kind.ERROR
            yield Frame(
                t_us,
                key & ~EXTENDED,
                payload[place, :length].tobytes(),
                self.channels[channel],
                is_extended=bool(key & EXTENDED) and not is_error,
                is_fd=kind == Kind.FD,
                is_remote=kind == Kind.REMOTE,
                is_error=is_error,
            )

    @classmethod
    def from_frames(cls, items: Iterable[Frame | Mark], channels: tuple[str, ...] = ()) -> "Block":
        """Block of frames and marks.

        Args:
            items: Frames and marks in the order of their file.
            channels: Names of buses to put first, those of the block in front of this one.

        """
        rows = list(items)
        names = dict.fromkeys((*channels, *(r.channel for r in rows if isinstance(r, Frame))))
        place = {name: number for number, name in enumerate(names)}
        longest = max((len(r.data) for r in rows if isinstance(r, Frame)), default=0)
        words = 1 if longest <= 8 else 8
        data = b"".join(
            (r.data if isinstance(r, Frame) else b"").ljust(8 * words, b"\0") for r in rows
        )
        return cls(
            t_ns=np.array([r.t_us * 1000 for r in rows], dtype=np.int64),
            key=np.array([_key_of(r) for r in rows], dtype=np.uint32),
            kind=np.array([_kind_of(r) for r in rows], dtype=np.uint8),
            length=np.array(
                [len(r.data) if isinstance(r, Frame) else 0 for r in rows], dtype=np.uint8
            ),
            channel=np.array(
                [place[r.channel] if isinstance(r, Frame) else 0 for r in rows], dtype=np.uint16
            ),
            words=np.frombuffer(data, dtype="<u8").astype(np.uint64).reshape(len(rows), words),
            channels=tuple(names) or ("",),
        )

    @classmethod
    def concatenate(cls, parts: "list[Block]") -> "Block":
        """Rows of all parts in their order.

        Args:
            parts: Blocks to join, at least one; the channels of each start with those of the one
                before.

        """
        if len(parts) == 1:
            return parts[0]
        width = max(part.words.shape[1] for part in parts)
        return cls(
            t_ns=np.concatenate([part.t_ns for part in parts]),
            key=np.concatenate([part.key for part in parts]),
            kind=np.concatenate([part.kind for part in parts]),
            length=np.concatenate([part.length for part in parts]),
            channel=np.concatenate([part.channel for part in parts]),
            words=np.concatenate([_widened(part.words, width) for part in parts]),
            channels=max((part.channels for part in parts), key=len),
        )


def to_micros(t_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Nanoseconds to microseconds, to the nearest, a half to the even one."""
    whole = t_ns // 1000
    rest = t_ns - whole * 1000
    if not rest.any():
        return whole
    return np.asarray(whole + ((rest > 500) | ((rest == 500) & (whole % 2 == 1))))


def clamped(t_us: NDArray[np.int64], now_us: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Stamps that do not run backwards, and which of them were moved for it.

    Args:
        t_us: Time stamps as recorded, µs, shape (n,).
        now_us: Time reached before them, µs.

    Returns:
        Each stamp, or the latest time before it where that is later, µs; and the mask of the
        moved ones; shape (n,) each.

    """
    risen = np.maximum(np.maximum.accumulate(t_us), now_us)
    before = np.concatenate([[now_us], risen[:-1]])
    return risen, t_us < before


def _widened(words: NDArray[np.uint64], width: int) -> NDArray[np.uint64]:
    if words.shape[1] == width:
        return words
    return np.pad(words, ((0, 0), (0, width - words.shape[1])))


def _key_of(item: Frame | Mark) -> int:
    if isinstance(item, Mark):
        return 0
    return item.arbitration_id | (EXTENDED if item.is_extended else 0)


def _kind_of(item: Frame | Mark) -> Kind:
    if isinstance(item, Mark):
        return _MARK_KINDS[item.name]
    if item.is_error:
        return Kind.ERROR
    if item.is_remote:
        return Kind.REMOTE
    return Kind.FD if item.is_fd else Kind.DATA
