"""Containers of a .blf file: the bytes of its objects, in pieces, past whatever is damaged.

The format is Vector's; its layout here is that of python-can's reader (`can/io/blf.py`).
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import NamedTuple

from adhesion_can.plurals import counted
from adhesion_can.recordings.blf_columns.stored_bytes import MARK, PIECE, ROOM, StoredBytes
from adhesion_can.recordings.candump import ReadReport, since_1970_us

BASE = struct.Struct("<4sHHII")
"""Head of every object: mark, sizes of the head, version of the head, size, type."""

_HEAD_SIZE = 144  # of a file; what is not in the struct has no known meaning
_FILE_HEAD = struct.Struct("<4sI8xQ16x8H16x")
_CONTAINER = 10
_CONTAINER_HEAD = struct.Struct("<H6xI4x")  # method, size of the contents
_PLAIN, _ZLIB = 0, 2


class FileHead(NamedTuple):
    """Head of a file.

    Attributes:
        size: Size of the head as it says itself, bytes; less than 144 is damage.
        length: Length of the file, bytes; 0 where its writer never came to say it.
        start_ns: Start of the measurement, to the ms, as the file's stamps count from it, ns.

    """

    size: int
    length: int
    start_ns: int

    @classmethod
    def read(cls, stored: StoredBytes) -> "FileHead":
        """Head of a file, of which nothing was read so far.

        Raises:
            ValueError: The file has none.

        """
        data = stored.take(_FILE_HEAD.size)
        if len(data) < _FILE_HEAD.size or not data.startswith(b"LOGG"):
            is_part = b"LOGG".startswith(data[:4])
            what = "it ends there" if is_part else "it does not start like a .blf file"
            raise ValueError(what if data else "the file is empty")
        _, size, length, *start = _FILE_HEAD.unpack(data)
        stored.skip(max(size, _HEAD_SIZE) - len(data))
        return cls(size, length, _to_ns(tuple(start)))


def _to_ns(system_time: tuple[int, ...]) -> int:
    """Windows' SYSTEMTIME in UTC as ns since 1970; 0 where it is not a time, as in python-can."""
    year, month, _, day, hour, minute, second, ms = system_time
    try:
        time = datetime(year, month, day, hour, minute, second, 1000 * ms, UTC)
    except ValueError:
        return 0
    return since_1970_us(time) * 1000


@dataclass
class Faults:
    """Faults of a file, counted, for its report.

    Attributes:
        places: Number of places at which bytes were passed over to find the next object.
        first: Position of the first of them in the file, as stored and unpacked, bytes.
        malformed: Number of objects whose fields contradict each other or name no time.
        outside: Number of objects outside of containers, where no writer puts any.
        methods: Compressions that are not known, and the number of containers of each.
        is_cut: Whether the file ends inside an object or a container.

    """

    places: int = 0
    first: int = 0
    malformed: int = 0
    outside: int = 0
    methods: dict[int, int] = field(default_factory=dict)
    is_cut: bool = False

    def add_place(self, position: int) -> None:
        """Count a place at which bytes are passed over."""
        self.first = self.first if self.places else position
        self.places += 1

    def tell(self, report: ReadReport, head: FileHead, size: int | None) -> None:
        """Put what was found into the notes of the recording.

        Args:
            report: Statistics of the recording.
            head: Head of the file.
            size: Size of the file, bytes; None where it is packed.

        """
        tell = report.notes.append
        if head.size < _HEAD_SIZE:
            tell(f"the file header claims a length of {head.size} bytes; using {_HEAD_SIZE}")
        if size is not None and head.length > size:
            tell(
                f"the file is truncated: it has {size} of the {head.length} bytes that its "
                "header states"
            )
        elif self.is_cut:
            tell("the file is truncated inside an object; using what precedes it")
        if self.places:
            tell(
                f"the file is damaged in {counted(self.places, 'place')}, the first at byte "
                f"{self.first}; using the rest"
            )
        if self.malformed:
            tell(f"skipped {counted(self.malformed, 'object')} with an impossible size or stamp")
        if self.outside:
            tell(f"skipped objects outside of containers: {self.outside}")
        for method, count in self.methods.items():
            containers = counted(count, "container")
            tell(f"skipped {containers} with the unknown compression {method}")


class Contents(NamedTuple):
    """Some bytes of the objects of a file.

    Attributes:
        data: Bytes.
        follows: Whether they follow those before them, with nothing lost in between.
        position: Number of bytes of the file, unpacked from any gzip, in front of which they stood.

    """

    data: bytes
    follows: bool
    position: int


def read_contents(stored: StoredBytes, faults: Faults) -> Iterator[Contents]:
    """Contents of the containers of a file.

    Args:
        stored: File, behind its head.
        faults: Faults, filled while reading.

    """
    follows = True
    while head := stored.peek(BASE.size):
        place = head[:ROOM].find(MARK)  # padding is that of `size % 4`, or none
        if place < 0:
            begin = stored.position
            if stored.skip_to_mark() >= ROOM:
                faults.add_place(begin)
                follows = False
            else:  # the end of the file: padding, or part of a mark
                faults.is_cut |= bool(head.strip(b"\0"))
            continue
        stored.skip(place)
        head = stored.take(BASE.size)
        if len(head) < BASE.size:
            faults.is_cut = True
            return
        *_, size, kind = BASE.unpack(head)
        if size < BASE.size:
            faults.add_place(stored.position)
            follows = False
        elif kind != _CONTAINER:
            faults.outside += 1
            faults.is_cut |= stored.skip(size - BASE.size) < size - BASE.size
        else:
            for data in _unpacked(stored, size - BASE.size, faults):
                yield Contents(data or b"", follows, stored.position)
                follows = data is not None


def _unpacked(stored: StoredBytes, size: int, faults: Faults) -> Iterator[bytes | None]:
    """Contents of a container, in pieces; None where some of them are lost.

    Args:
        stored: File, at the container's own head.
        size: Size of that head and of what is stored behind it, bytes.
        faults: Faults, filled while reading.

    """
    head = stored.take(min(size, _CONTAINER_HEAD.size))
    if len(head) < _CONTAINER_HEAD.size:
        faults.is_cut |= len(head) < size
        if len(head) == size:
            faults.add_place(stored.position)
        yield None
        return
    method, _ = _CONTAINER_HEAD.unpack(head)
    left = size - len(head)
    if method not in (_PLAIN, _ZLIB):
        faults.methods[method] = faults.methods.get(method, 0) + 1
        stored.skip(left)
        yield None
        return
    yield from (_plain if method == _PLAIN else _inflated)(stored, left, faults)


def _plain(stored: StoredBytes, left: int, faults: Faults) -> Iterator[bytes | None]:
    while left and (data := stored.take(min(left, PIECE))):
        left -= len(data)
        yield data
    faults.is_cut |= left > 0


def _inflated(stored: StoredBytes, left: int, faults: Faults) -> Iterator[bytes | None]:
    unpacker = zlib.decompressobj()
    while not unpacker.eof:
        data = unpacker.unconsumed_tail
        if not data:
            data = stored.take(min(left, PIECE))
            is_cut = left > 0 and not data
            left -= len(data)
        try:
            # In pieces: a megabyte of zeros packs into a kilobyte.
            piece = unpacker.decompress(data, PIECE)
        except zlib.error:
            faults.add_place(stored.position)
            break
        if piece:
            yield piece
        elif not data and not unpacker.eof:
            faults.is_cut |= is_cut
            if not is_cut:
                faults.add_place(stored.position)  # the size of the container is wrong
            break
    rest = unpacker.unused_data
    if MARK in rest:  # likewise
        faults.add_place(stored.position - len(rest))
        stored.put_back(rest)
    else:
        stored.skip(left)
    if not unpacker.eof or MARK in rest:
        yield None
