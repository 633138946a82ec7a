"""The service over recordings: the frames that it would have sent.

`replay` is the reference: frame by frame, also at the speed of the recording. `replay_blocks` sends
the same bytes sooner.
"""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import EXTENDED, Block, Kind
from adhesion_can.bus.frame import ADVANCE, STOP, Frame, Mark
from adhesion_can.errors import RecordingError
from adhesion_can.service.column_replay import ColumnReplay
from adhesion_can.service.core import ServiceCore


@dataclass(slots=True)
class ReplaySummary:
    """Numbers of a replay.

    Attributes:
        frames: Number of recorded frames within the times asked for.
        own_skipped: Number of recorded frames with an id of the output messages; they are skipped.
        sent: Number of frames that the service sent.
        first_us: Stamp of the first recorded frame, µs; None where there is none.
        last_us: Stamp of the last recorded frame, µs; None where there is none.
        length_us: Time from the first row of the recording to the last one that was read, µs.
        kinds: Number of lines or objects of the files, by kind.

    """

    frames: int = 0
    own_skipped: int = 0
    sent: int = 0
    first_us: int | None = None
    last_us: int | None = None
    length_us: int = field(default=0, compare=False)
    kinds: Counter[str] = field(default_factory=Counter)


def require_frames_in_span(summary: ReplaySummary, from_s: float, where: str) -> None:
    """Raise a RecordingError where a recording ends before the part that is asked for starts."""
    length_s = summary.length_us / 1e6
    if not summary.frames and from_s > length_s:
        raise RecordingError(
            where,
            f"ends {length_s:.3f} s after its first frame, before --from {from_s:g}",
            "give seconds since the first frame, not the recording's stamps",
        )


def replay_blocks(
    blocks: Iterable[Block],
    core: ServiceCore,
    send: Callable[[Frame], None],
    *,
    from_s: float = 0.0,
    to_s: float | None = None,
) -> ReplaySummary:
    """Run recorded blocks through a core, as fast as it goes.

    Args:
        blocks: Blocks in the order of the recording.
        core: Fresh core.
        send: Callback with each frame that the service sends.
        from_s: Start of the part that is replayed, s after the first row.
        to_s: End of that part (inclusive), s after the first row; None for the last row.

    """
    summary, columns = ReplaySummary(), ColumnReplay(core)
    output_ids = np.array(
        [number | EXTENDED if extended else number for number, extended in core.messages.ids],
        dtype=np.uint32,
    )
    origin: int | None = None
    for block in blocks:
        t_us = block.t_us
        if origin is None:
            origin = int(t_us[0])
        since_s = (t_us - origin) / 1e6
        summary.length_us = int(t_us[-1]) - origin
        late = since_s > (np.inf if to_s is None else to_s)
        end = int(np.argmax(late)) if late.any() else len(block)
        rows = block.select(np.flatnonzero(since_s[:end] >= from_s))
        is_frame = rows.kind <= Kind.ERROR
        _count_frames(summary, rows.t_us[is_frame])
        ours = rows.is_data & np.isin(rows.key, output_ids)
        summary.own_skipped += int(ours.sum())
        for frame in columns.process(rows.select(~ours)):
            summary.sent += 1
            send(frame)
        if end < len(block):
            break
    return summary


def _count_frames(summary: ReplaySummary, t_us: NDArray[np.int64]) -> None:
    if len(t_us):
        summary.frames += len(t_us)
        summary.first_us = int(t_us[0]) if summary.first_us is None else summary.first_us
        summary.last_us = int(t_us[-1])


def replay(
    items: Iterable[Frame | Mark],
    core: ServiceCore,
    send: Callable[[Frame], None],
    *,
    from_s: float = 0.0,
    to_s: float | None = None,
    realtime: bool = False,
) -> ReplaySummary:
    """Run recorded frames through a core.

    Args:
        items: Frames and marks in the order of the recording.
        core: Fresh core.
        send: Callback with each frame that the service sends.
        from_s: Start of the part that is replayed, s after the first item.
        to_s: End of that part (inclusive), s after the first item; None for the last item.
        realtime: Whether to keep the speed of the recording, rather than go as fast as possible.

    """
    summary = ReplaySummary()
    output_ids = core.messages.ids
    origin: int | None = None
    began = time.monotonic()
    for item in items:
        if origin is None:
            origin = item.t_us
        since_s = (item.t_us - origin) / 1e6
        summary.length_us = item.t_us - origin
        if since_s < from_s:
            continue
        if to_s is not None and since_s > to_s:
            break
        if realtime:
            time.sleep(max(0.0, since_s - from_s - (time.monotonic() - began)))
        for frame in _step(item, core, output_ids, summary):
            summary.sent += 1
            send(frame)
    return summary


def with_answers(items: Iterable[Frame | Mark], core: ServiceCore) -> Iterator[Frame]:
    """Recorded frames, and those that the service sends, in the order of their stamps.

    Recorded frames with an id of the output messages are left out.

    Args:
        items: Frames and marks in the order of the recording.
        core: Fresh core.

    """
    summary, output_ids = ReplaySummary(), core.messages.ids
    for item in items:
        skipped = summary.own_skipped
        yield from _step(item, core, output_ids, summary)
        if isinstance(item, Frame) and summary.own_skipped == skipped:
            yield item


def _step(
    item: Frame | Mark,
    core: ServiceCore,
    output_ids: frozenset[tuple[int, bool]],
    summary: ReplaySummary,
) -> list[Frame]:
    if isinstance(item, Mark):
        if item.name == ADVANCE:
            return core.advance(item.t_us)
        if item.name == STOP:
            return core.stop(item.t_us)
        core.second_sender(item.t_us)
        return []
    summary.frames += 1
    if summary.first_us is None:
        summary.first_us = item.t_us
    summary.last_us = item.t_us
    if item.is_data and (item.arbitration_id, item.is_extended) in output_ids:
        summary.own_skipped += 1
        return []
    return core.feed(item)
