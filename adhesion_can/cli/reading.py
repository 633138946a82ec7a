"""The progress of reading recordings, for every command that does."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from time import monotonic

import numpy as np

from adhesion_can.bus.block import Block
from adhesion_can.cli.bars import bar
from adhesion_can.recordings.recording import Recording

Watched = Callable[[Iterable[Block]], Iterator[Block]]
"""Function that passes blocks on, and shows the progress."""

FIRST_ROWS = 5000
"""Rows of the first part of a block, whose time shows how many go into the next one."""
PART_S = 0.2
"""Time that the work on a part of a block may take, s, so that the bar moves."""


@contextmanager
def reading(what: str, recordings: Sequence[Recording]) -> Iterator[Watched]:
    """A progress bar with frames/s and the time left.

    Blocks are passed on in parts where a bar is shown: what is made of a block may take minutes.

    Args:
        what: Name of the work, in one word.
        recordings: Recordings whose blocks are passed through.

    """
    total = max(sum(recording.size for recording in recordings), 1)
    with bar(what) as shown:
        if not shown.is_shown:
            yield iter
            return
        begin, frames, before = monotonic(), 0, 0.0

        def watched(blocks: Iterable[Block]) -> Iterator[Block]:
            nonlocal frames, before
            for block in blocks:
                after = sum(recording.position for recording in recordings) / total
                for part, share in _parts(block):
                    yield part
                    frames += len(part)
                    speed = frames / max(monotonic() - begin, 1e-9)
                    rate = f"{speed / 1e6:.2f} M/s" if speed > 1e5 else f"{speed / 1e3:.1f} k/s"
                    done = before + share * (after - before)
                    shown.update(done, f"{frames} frames, {rate}")
                before = after

        yield watched


def _parts(block: Block) -> Iterator[tuple[Block, float]]:
    """Parts of a block that take about the same time, each with the share behind it."""
    start, rows = 0, FIRST_ROWS
    while start < len(block):
        end = min(start + rows, len(block))
        began_s = monotonic()
        whole = start == 0 and end == len(block)
        yield block if whole else block.select(np.arange(start, end)), end / len(block)
        took_s = monotonic() - began_s
        rows = 2 * rows if took_s < PART_S / 2 else max(rows // 2, 1) if took_s > PART_S else rows
        start = end
