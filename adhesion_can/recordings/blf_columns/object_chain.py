"""Places of the objects of a .blf file, which follow each other in the contents of containers."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.recordings.blf_columns.containers import BASE
from adhesion_can.recordings.blf_columns.stored_bytes import MARK, ROOM

Places = NDArray[np.int64]

CLASSIC, FD, FD_64, ERROR = 1, 2, 3, 4
FRAME_TYPES = {1: CLASSIC, 86: CLASSIC, 100: FD, 101: FD_64, 73: ERROR}
"""Layouts of the bodies by the type of an object, as far as it holds a frame."""
LONGEST = 1 << 16
"""Size of an object with a frame, bytes: a larger one is damage."""

_GAP = 5  # an object begins at most so many bytes behind the end of the one before, less one
_MARK = np.uint32(int.from_bytes(MARK, "little"))


@dataclass(frozen=True, slots=True)
class FoundObjects:
    """Objects found in some contents.

    Attributes:
        starts: Places of the objects, shape (n,).
        end: Place behind the last whole object: an object that starts there is not whole.
        size: Size that this object claims, bytes; 0 where its head is not whole.
        broken: Number of places at which bytes were passed over.

    """

    starts: Places
    end: int
    size: int
    broken: int


def find_objects(data: bytes, stop: int) -> FoundObjects:
    """The objects that follow each other in some contents.

    Args:
        data: Contents, whose first object starts within their first bytes, and other bytes.
        stop: Length of the contents, bytes.

    """
    words = np.frombuffer(data, "<u4", stop // 4)
    objects = _chained(data, 4 * np.flatnonzero(words == _MARK), stop)  # nearly always
    if objects is None:
        marks = [match.start() for match in re.compile(MARK).finditer(data, 0, stop)]
        objects = _chained(data, np.array(marks, np.int64), stop)
    return objects or _walked(data[:stop])


def _chained(data: bytes, starts: Places, stop: int) -> FoundObjects | None:
    """Objects where each of these places is one, behind the one before; None where that fails."""
    if not len(starts) or starts[0] >= _GAP or starts[-1] + BASE.size > stop:
        return None
    sizes = gathered(data, starts + 8, np.dtype("<u4")).astype(np.int64)
    ends = starts + sizes
    gaps = starts[1:] - ends[:-1]
    if (sizes < BASE.size).any() or ((gaps < 0) | (gaps >= _GAP)).any():
        return None
    last, end = int(sizes[-1]), int(ends[-1])
    if end > stop:
        return FoundObjects(starts[:-1], int(starts[-1]), last, 0) if last <= LONGEST else None
    return FoundObjects(starts, end, 0, 0) if stop - end < ROOM else None


def _walked(data: bytes) -> FoundObjects:
    """Objects found one after the other, where marks stand inside of them or are missing."""
    starts: list[int] = []
    place = broken = size = 0
    while True:
        at = data.find(MARK, place, place + ROOM)
        if at < 0:
            if place + ROOM > len(data):
                break
            broken += 1
            at = data.find(MARK, place)
            if at < 0:
                place = len(data) - len(MARK) + 1
                break
        place = at
        if at + BASE.size > len(data):
            break
        *_, size, kind = BASE.unpack_from(data, at)
        if size < BASE.size or (kind in FRAME_TYPES and size > LONGEST):
            broken += 1
            place, size = at + len(MARK), 0
        elif at + size > len(data):
            return FoundObjects(np.array(starts, np.int64), at, size, broken)
        else:
            starts.append(at)
            place, size = at + size, 0
    return FoundObjects(np.array(starts, np.int64), place, 0, broken)


def gathered(data: bytes, places: Places, kind: np.dtype[Any]) -> NDArray[Any]:
    """Values of a type at some places, each of them whole in the data, shape (n,)."""
    count = max(len(data) - kind.itemsize + 1, 0)
    everywhere = np.ndarray((count,), f"V{kind.itemsize}", data, 0, (1,))
    return everywhere[places].view(kind)
