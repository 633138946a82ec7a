"""Frames among the objects of a .blf file, in columns."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.bus.frame import MAX_PAYLOAD
from adhesion_can.recordings.blf_columns.containers import Contents, Faults
from adhesion_can.recordings.blf_columns.object_chain import (
    CLASSIC,
    ERROR,
    FD,
    FD_64,
    FRAME_TYPES,
    LONGEST,
    Places,
    find_objects,
    gathered,
)
from adhesion_can.recordings.blf_columns.stored_bytes import MARK
from adhesion_can.recordings.candump import LAST_US, ReadReport
from adhesion_can.recordings.frame_rows import payload_words

_CODES = np.array([FRAME_TYPES.get(number, 0) for number in range(103)], np.uint8)
"""Layout of the body by the type of an object, 0 where it holds no frame."""
_HEADS = {1: 32, 2: 40}
"""Sizes of an object's head by its version, bytes."""
_TEN_MICROSECONDS = 1  # flag of a stamp; any other is one of ns
_ID_BITS = 0x1FFFFFFF
_REMOTE, _FD_REMOTE, _FD_FRAME = 0x80, 0x10, 0x1000
_ROOM = bytes(256)  # behind the contents: to gather the last object as if it were a long one
_LAST_NS = LAST_US * 1000


def _layout(itemsize: int, /, **fields: tuple[str, int]) -> np.dtype[np.void]:
    names, formats, offsets = zip(*((n, f, o) for n, (f, o) in fields.items()), strict=True)
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": itemsize})


_HEAD = _layout(
    32,
    head=("<u2", 4),
    version=("<u2", 6),
    size=("<u4", 8),
    type=("<u4", 12),
    flags=("<u4", 16),
    stamp=("<u8", 24),
)
_BODIES = {
    CLASSIC: _layout(
        16,
        channel=("<u2", 0),
        flags=("u1", 2),
        length=("u1", 3),
        id=("<u4", 4),
        data=("(8,)u1", 8),
    ),
    FD: _layout(
        84,
        channel=("<u2", 0),
        flags=("u1", 2),
        id=("<u4", 4),
        fd=("u1", 13),
        length=("u1", 14),
        data=("(64,)u1", 20),
    ),
    FD_64: _layout(
        40 + MAX_PAYLOAD,
        channel=("u1", 0),
        length=("u1", 2),
        id=("<u4", 4),
        flags=("<u4", 12),
        extra=("u1", 35),
        data=("(64,)u1", 40),
    ),
    ERROR: _layout(32, channel=("<u2", 0), id=("<u4", 16)),
}
_LEAST = {CLASSIC: 16, FD: 84, FD_64: 40, ERROR: 32}
"""Sizes of the bodies as far as they are needed, bytes."""


class FrameColumns:
    """Frames of the contents of a file.

    Args:
        start_ns: Start of the measurement, ns.
        faults: Faults, filled while reading.
        report: Statistics, in which objects that hold no frame are counted.

    """

    def __init__(self, start_ns: int, faults: Faults, report: ReadReport) -> None:
        self._start_ns = start_ns
        self._faults = faults
        self._report = report
        self._tail = b""
        self._skip = 0  # bytes left of an object too long for a frame

    def read(self, pieces: Iterable[Contents], size: int) -> Iterator[Block]:
        """Rows of the frames, whose `channel` has the numbers of their buses.

        Args:
            pieces: Contents of the containers, in their order.
            size: Number of bytes of contents that are read at once, to within a piece.

        """
        for piece in _joined(pieces, size):
            rows = self._parse(piece)
            if len(rows):
                yield rows
        is_padding = not self._tail.strip(b"\0")
        self._faults.is_cut |= bool(self._skip) or not is_padding

    def _parse(self, piece: Contents) -> Block:
        data = piece.data
        if not piece.follows:
            self._tail, self._skip = b"", 0
            data = data[max(data.find(MARK), 0) :]
        passed = min(self._skip, len(data))
        self._skip -= passed
        data = b"".join((self._tail, data[passed:], _ROOM))
        stop = len(data) - len(_ROOM)
        objects = find_objects(data, stop)
        self._tail = data[objects.end : stop]
        if objects.size > LONGEST:
            self._skip, self._tail = objects.size - len(self._tail), b""
            self._report.kinds["other"] += 1
        for _ in range(objects.broken):
            self._faults.add_place(piece.position)
        return self._rows(data, objects.starts)

    def _rows(self, data: bytes, starts: Places) -> Block:
        heads = gathered(data, starts, _HEAD)
        codes = _CODES[np.minimum(heads["type"], len(_CODES) - 1)]
        version = heads["version"]
        parts = []
        order = []
        for code in np.flatnonzero(np.bincount(codes, minlength=1)).tolist():
            here = codes == code
            if code == 0:
                self._report.kinds["other"] += int(np.count_nonzero(here))
                continue
            for number in _HEADS:
                rows = np.flatnonzero(here & (version == number))
                if len(rows):
                    good, block = self._frames(data, starts[rows], heads[rows], code)
                    order.append(rows[good])
                    parts.append(block)
        known = sum(map(len, order))
        self._faults.malformed += int(np.count_nonzero(codes)) - known
        if not parts:
            return Block.from_frames([])
        block = Block.concatenate(parts)
        return block if len(parts) == 1 else block.select(np.argsort(np.concatenate(order)))

    def _frames(
        self, data: bytes, starts: Places, heads: NDArray[Any], code: int
    ) -> tuple[NDArray[np.bool_], Block]:
        """Which of some objects of one kind and version are whole, and their frames."""
        head = _HEADS[int(heads["version"][0])]
        body = gathered(data, starts + head, _BODIES[code])
        size = heads["size"].astype(np.int64)
        good = size >= head + _LEAST[code]
        t_ns, in_time = self._stamps(heads)
        good &= in_time
        key = body["id"] & np.uint32(_ID_BITS)
        kind = np.full(len(starts), Kind.ERROR, np.uint8)
        length = np.zeros(len(starts), np.int64)
        words = np.zeros((len(starts), 1), np.uint64)
        if code != ERROR:
            key |= body["id"] & np.uint32(EXTENDED)
            kind, remote = _kinds(body, code)
            length = np.minimum(body["length"], body["data"].shape[1]).astype(np.int64)
            stored = length
            if code == FD_64:
                # python-can and Vector's own library fill up with zeros what is not stored.
                end = np.where(body["extra"] > 0, body["extra"], size)
                room = end - heads["head"] - _LEAST[code]
                stored = np.minimum(length, room)
                good &= (room >= 0) & (head + _LEAST[code] + stored <= size)
                good &= body["length"] <= MAX_PAYLOAD
            length[remote] = 0
            stored = np.where(remote, 0, stored)
            words = payload_words(np.ascontiguousarray(body["data"]), stored)
        block = Block(t_ns, key, kind, length.astype(np.uint8), body["channel"], words, ())
        return good, block if good.all() else block.select(good)

    def _stamps(self, heads: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Stamps, ns, and whether each is one of a recording, shapes (n,)."""
        stamp = heads["stamp"]
        room = _LAST_NS - self._start_ns
        if abs(self._start_ns) > _LAST_NS:
            return stamp.astype(np.int64), np.zeros(len(stamp), np.bool_)
        coarse = heads["flags"] == _TEN_MICROSECONDS
        if not coarse.any():
            good = stamp <= np.uint64(room)
            return stamp.astype(np.int64) + self._start_ns, good
        unit = np.where(coarse, np.uint64(10_000), np.uint64(1))
        good = stamp <= np.uint64(room) // unit
        return (stamp * unit).astype(np.int64) + self._start_ns, good


def _kinds(body: NDArray[Any], code: int) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Kinds of data and remote frames, and which are remote, shapes (n,)."""
    flags = body["flags"]
    remote = (flags & (_FD_REMOTE if code == FD_64 else _REMOTE)) != 0
    kind = np.full(len(body), Kind.DATA, np.uint8)
    if code == FD:
        kind[(body["fd"] & 1) != 0] = Kind.FD
    elif code == FD_64:
        kind[(flags & _FD_FRAME) != 0] = Kind.FD
    kind[remote] = Kind.REMOTE
    return kind, remote


def _joined(pieces: Iterable[Contents], size: int) -> Iterator[Contents]:
    """Pieces joined to at least so many bytes, but where something is lost between them."""
    held: list[bytes] = []
    length = position = 0
    follows = True
    for piece in pieces:
        if held and not piece.follows:
            yield Contents(b"".join(held), follows, position)
            held, length = [], 0
        if not held:
            follows, position = piece.follows, piece.position
        held.append(piece.data)
        length += len(piece.data)
        if length >= size:
            yield Contents(b"".join(held), follows, position)
            held, length = [], 0
    if held:
        yield Contents(b"".join(held), follows, position)
