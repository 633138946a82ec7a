"""The service over recordings: what it would have said."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from adhesion_can.bus.candump import ReadReport
from adhesion_can.bus.frame import ADVANCE, Frame, Mark
from adhesion_can.bus.recordings import Recording
from adhesion_can.errors import RecordingError
from adhesion_can.service.core import ServiceCore


@dataclass(slots=True)
class ReplaySummary:
    """What a replay met.

    Attributes:
        frames: of the recordings, within the times asked for.
        own_skipped: of these, frames with the ids of our own outputs.
        sent: frames that the service answered.
        first_us: stamp of the first frame.
        last_us: stamp of the last frame.
        kinds: lines of the files by kind.

    """

    frames: int = 0
    own_skipped: int = 0
    sent: int = 0
    first_us: int | None = None
    last_us: int | None = None
    kinds: Counter[str] = field(default_factory=Counter)


STRAY_US = 60_000_000
"""A stamp this far ahead, taken back by the next one, is a broken stamp and not a hole in time."""


def _without_strays(items: Iterable[Frame | Mark], report: ReadReport) -> Iterator[Frame | Mark]:
    """Items but for frames with a broken stamp far ahead, which would hold up all that follow."""
    last: int | None = None
    held: Frame | Mark | None = None
    for item in items:
        if held is not None:
            if item.t_us > held.t_us - STRAY_US:
                yield held
                last = held.t_us
            else:
                report.kinds["stray"] += 1
                if report.kinds["stray"] == 1:
                    report.notes.append(
                        f"frames with a broken stamp far ahead are left out, the first of "
                        f"{held.t_us / 1e6:.6f} s"
                    )
            held = None
        if last is not None and item.t_us - last > STRAY_US:
            held = item
            continue
        last = item.t_us
        yield item
    if held is not None:
        yield held


def in_sequence(recordings: Sequence[Recording]) -> Iterator[Frame | Mark]:
    """Recordings one after another.

    Raises:
        RecordingError: one begins before the one in front of it ended.

    """
    last = None
    for recording in recordings:
        begins = True
        for item in _without_strays(recording, recording.report):
            if begins and last is not None and item.t_us < last:
                raise RecordingError(
                    str(recording.path),
                    "begins before the recording in front of it ends",
                    "name the recordings in the order of their times, or replay them one by one",
                )
            begins = False
            last = item.t_us if last is None else max(last, item.t_us)
            yield item


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
        items: frames and marks in the order of the recording.
        core: a fresh one.
        send: takes each frame that the service sends.
        from_s: begin so long after the first frame, s.
        to_s: end so long after the first frame, s; None: at the last one.
        realtime: at the speed of the recording, rather than as fast as it goes.

    """
    summary = ReplaySummary()
    own = core.messages.ids
    origin: int | None = None
    began = time.monotonic()
    for item in items:
        if origin is None:
            origin = item.t_us
        since_s = (item.t_us - origin) / 1e6
        if since_s < from_s:
            continue
        if to_s is not None and since_s > to_s:
            break
        if realtime:
            time.sleep(max(0.0, since_s - from_s - (time.monotonic() - began)))
        for frame in _step(item, core, own, summary):
            summary.sent += 1
            send(frame)
    return summary


def _step(
    item: Frame | Mark,
    core: ServiceCore,
    own: frozenset[tuple[int, bool]],
    summary: ReplaySummary,
) -> list[Frame]:
    if isinstance(item, Mark):
        if item.name == ADVANCE:
            return core.advance(item.t_us)
        core.second_sender(item.t_us)
        return []
    summary.frames += 1
    if summary.first_us is None:
        summary.first_us = item.t_us
    summary.last_us = item.t_us
    if (item.arbitration_id, item.is_extended) in own:
        summary.own_skipped += 1
        return []
    return core.feed(item)
