"""Rows of frames from columns of numbers: payloads, names of numbered buses, counts."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block, Kind, to_micros
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.candump import ReadReport

KIND_NAMES = {Kind.DATA: "frame", Kind.FD: "fd", Kind.REMOTE: "remote", Kind.ERROR: "error"}
"""Names of the kinds of frames, as `ReadReport` counts them."""
_NO_BUS = -1
"""Number of the bus of a recording that has begun with marks alone."""
_KEPT = np.array([(1 << 8 * count) - 1 for count in range(9)], np.uint64)
"""Masks of words, by the number of a word's bytes that belong to the payload, 0..8."""


def payload_words(data: NDArray[np.uint8], length: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Payloads as words, 0 behind their ends, shape (n, m / 8).

    Args:
        data: Bytes of payloads and whatever follows them, C-contiguous, shape (n, m), m a multiple
            of 8.
        length: Lengths of the payloads, at most m, shape (n,).

    """
    rest = length[:, np.newaxis] - np.arange(0, data.shape[1], 8)
    return np.asarray(data.view("<u8").astype(np.uint64) & _KEPT[rest.clip(0, 8)])


def bus_from_1(number: int) -> str:
    """Name of a bus of a format that counts its buses from 1; python-can calls 0 '-1'."""
    return f"can{number - 1}" if number else "-1"


class NumberedBuses:
    """Names of the buses of a recording, in the order in which they appear in it.

    Args:
        name: Function from the number of a bus to its name.

    """

    def __init__(self, name: Callable[[int], str]) -> None:
        self._name = name
        self._places: dict[int, int] = {}
        self._names: tuple[str, ...] = ()

    def named(self, rows: Block) -> Block:
        """Rows with the names of their buses, and words no wider than needed.

        Args:
            rows: Next rows of the recording; `channel` has the numbers of their buses, 0 in marks.

        """
        if not len(rows):
            return replace(rows, channels=self._names)
        frames = rows.kind < Kind.ADVANCE
        has_marks = not frames.all()
        numbers = rows.channel[frames] if has_marks else rows.channel
        # Most recordings have one bus, and to count takes longer than to compare.
        is_one = len(numbers) > 0 and bool((numbers == numbers[0]).all())
        bus_numbers = numbers[:1] if is_one else np.flatnonzero(np.bincount(numbers))
        new = [number for number in bus_numbers.tolist() if number not in self._places]
        if len(new) > 1:
            seen, first = np.unique(numbers, return_index=True)
            order = dict(zip(seen.tolist(), first.tolist(), strict=True))
            new.sort(key=order.__getitem__)
        if not self._places and not new:
            new = [_NO_BUS]
        self._places |= {number: len(self._places) + n for n, number in enumerate(new)}
        self._names += tuple("" if number == _NO_BUS else self._name(number) for number in new)
        places = [self._places[number] for number in bus_numbers.tolist()]
        if is_one:
            channel = np.full(len(rows), places[0], np.uint16)
        else:
            table = np.zeros(int(numbers.max(initial=0)) + 1, np.uint16)
            table[bus_numbers] = places
            channel = table[rows.channel]
        if has_marks:
            channel[~frames] = 0
        return replace(
            rows,
            channel=channel,
            words=np.ascontiguousarray(rows.words[:, : 1 if rows.length.max() <= 8 else None]),
            channels=self._names,
        )


class FrameCounter:
    """Counts the rows of blocks by kind, and those that are stamped before the one before.

    Args:
        report: Statistics, filled as blocks are added.
        least_first_us: Stamp, µs, before which the first frame counts as one; None: it never does.

    """

    def __init__(self, report: ReadReport, least_first_us: int | None = None) -> None:
        self._report = report
        self._last_us = least_first_us

    def add(self, block: Block) -> None:
        """Count the next block of a recording, at least one row."""
        counts = np.bincount(block.kind).tolist()
        for kind, count in enumerate(counts):
            if count:
                self._report.kinds[KIND_NAMES.get(Kind(kind), "mark")] += count
        frames = block.kind < Kind.ADVANCE
        t_ns = block.t_ns if frames.all() else block.t_ns[frames]
        if not len(t_ns):
            return
        # Stamps in µs can only fall where those in ns do.
        falls = np.flatnonzero(t_ns[1:] < t_ns[:-1])
        fallen = to_micros(t_ns[falls + 1]) < to_micros(t_ns[falls])
        first_us, last_us = to_micros(t_ns[[0, -1]]).tolist()
        is_fall = self._last_us is not None and first_us < self._last_us
        self._report.backwards += int(fallen.sum()) + is_fall
        self._last_us = last_us


def join_blocks(
    placed_blocks: Iterator[tuple[Block, int]], most: int
) -> Iterator[tuple[Block, int]]:
    """Blocks joined, each with the position of the last one in it.

    Args:
        placed_blocks: Blocks with their positions in the file, bytes.
        most: Largest number of blocks that are joined.

    Raises:
        RecordingError: That of `placed_blocks`; the blocks in front of it are given first.

    """
    waiting: list[Block] = []
    position = 0
    try:
        for block, position in placed_blocks:
            waiting.append(block)
            if len(waiting) >= most:
                yield Block.concatenate(waiting), position
                waiting = []
    except RecordingError:
        if waiting:
            yield Block.concatenate(waiting), position
        raise
    if waiting:
        yield Block.concatenate(waiting), position
