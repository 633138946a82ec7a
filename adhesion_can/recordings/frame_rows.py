"""Rows of frames from columns of numbers: payloads, names of numbered buses, counts."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block, Kind
from adhesion_can.errors import RecordingError
from adhesion_can.recordings.candump import ReadReport

KIND_NAMES = {Kind.DATA: "frame", Kind.FD: "fd", Kind.REMOTE: "remote", Kind.ERROR: "error"}
"""Names of the kinds of frames, as `ReadReport` counts them."""


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

    def named(self, rows: Block) -> Block:
        """Rows with the names of their buses, and words no wider than needed.

        Args:
            rows: Next rows of the recording, at least one; `channel` has the numbers of buses.

        """
        found, first, which = np.unique(rows.channel, return_index=True, return_inverse=True)
        for number in found[np.argsort(first)].tolist():
            self._places.setdefault(number, len(self._places))
        places = np.array([self._places[number] for number in found.tolist()], np.uint16)
        return replace(
            rows,
            channel=places[which],
            words=np.ascontiguousarray(rows.words[:, : 1 if rows.length.max() <= 8 else None]),
            channels=tuple(map(self._name, self._places)),
        )


class FrameCounter:
    """Counts the rows of blocks by kind, and those that are stamped before the one before.

    Args:
        report: Statistics, filled as blocks are added.

    """

    def __init__(self, report: ReadReport) -> None:
        self._report = report
        self._last_us: int | None = None

    def add(self, block: Block) -> None:
        """Count the next block of a recording, which has frames alone, at least one."""
        counts = np.bincount(block.kind, minlength=len(KIND_NAMES)).tolist()
        for name, count in zip(KIND_NAMES.values(), counts, strict=True):
            if count:
                self._report.kinds[name] += count
        t_us = block.t_us
        last_us = t_us[0] if self._last_us is None else self._last_us
        falls = np.diff(t_us, prepend=last_us) < 0
        self._report.backwards += int(np.count_nonzero(falls))
        self._last_us = int(t_us[-1])


def join_blocks(found: Iterator[tuple[Block, int]], most: int) -> Iterator[tuple[Block, int]]:
    """Blocks joined, each with the position of the last one in it.

    Args:
        found: Blocks with their positions in the file, bytes.
        most: Largest number of blocks that are joined.

    Raises:
        RecordingError: That of `found`; the blocks in front of it are given first.

    """
    waiting: list[Block] = []
    position = 0
    try:
        for block, position in found:
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
