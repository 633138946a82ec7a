"""The progress of reading recordings, for every command that does."""

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from time import monotonic

from adhesion_can.bus.block import Block
from adhesion_can.recordings.recording import Recording
from adhesion_can.reporting.text import console

Watched = Callable[[Iterable[Block]], Iterator[Block]]
"""Function that passes blocks on, and shows the progress."""


@contextmanager
def reading(what: str, recordings: Sequence[Recording]) -> Iterator[Watched]:
    """A progress bar on stderr where it is a terminal, with frames/s and the time left.

    Args:
        what: Name of the work, in one word.
        recordings: Recordings whose blocks are passed through.

    """
    err = console(sys.stderr)
    if not err.is_terminal:
        yield iter
        return
    from rich.progress import (  # noqa: PLC0415  a fifth of the start of a short command
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    begin, frames = monotonic(), 0
    total = max(sum(recording.size for recording in recordings), 1)
    bar = Progress(
        TextColumn(what),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[speed]}"),
        TimeRemainingColumn(),
        console=err,
        transient=True,
    )
    task = bar.add_task(what, total=1.0, speed="")

    def watched(blocks: Iterable[Block]) -> Iterator[Block]:
        nonlocal frames
        for block in blocks:
            yield block
            frames += len(block)
            speed = frames / max(monotonic() - begin, 1e-9) / 1e6
            done = sum(recording.position for recording in recordings) / total
            bar.update(task, completed=done, speed=f"{frames} frames, {speed:.2f} M/s")

    with bar:
        yield watched
