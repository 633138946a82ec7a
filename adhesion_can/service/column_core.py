"""The service over blocks of recorded frames: the same bytes as frame by frame, much sooner.

Receiving and the forming of samples depend on the frames alone, so they are done for a block at
once. Between two due times nothing is said; so what the inputs had told by each due time is looked
up by stamps, and only the estimator goes from due time to due time.
"""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.block import Block, Kind, clamped
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import Received
from adhesion_can.physics.readings import Role
from adhesion_can.service.speaker import REQUIRED, STALE_CYCLES, Moment, Speaker

Stamps = NDArray[np.int64]


class _Event(NamedTuple):
    """Something that happens between due times.

    Attributes:
        at_us: after the due times until then, before all others.
        row: of the block that tells it.
        happen: makes it happen.

    """

    at_us: int
    row: int
    happen: Callable[[], None]


class ColumnCore(Speaker):
    """The service that takes its inputs in blocks, as a recording gives them."""

    def _begin(self) -> None:
        super()._begin()
        self._former = self.configuration.make_column_former()
        self._moments: dict[int, Moment] = {}
        self._heard_us: list[int] = []
        self._speed: float | None = None

    @property
    def dropped_samples(self) -> dict[str, int]:
        """Wheel-speed readings that gave no sample, by reason."""
        return dict(self._former.dropped)

    def take(self, block: Block) -> list[Frame]:
        """Take a block; returns what was due at or before its last stamp.

        Rows stamped before the present time, that of the rows before them, are clamped to it and
        counted. After a hole longer than the configured restart time the service starts anew.
        """
        if not len(block):
            return []
        # A second sender's mark says when it was heard; it does not move the time.
        moves = np.where(block.kind == Kind.SECOND_SENDER, self._now_us, block.t_us)
        t_us, moved = clamped(moves, self._now_us)
        self.counts.clamped += int((moved & (block.kind <= Kind.ERROR)).sum())
        frames: list[Frame] = []
        holes = np.flatnonzero(np.diff(t_us, prepend=self._now_us) > self._restart_us).tolist()
        for first, last in pairwise([0, *(place for place in holes if place), len(block)]):
            if first in holes and self._due:
                self.counts.restarts += 1
                self._begin()
            part = slice(first, last)
            frames += self._take(block.select(part), t_us[part])
        return frames

    def _take(self, block: Block, t_us: Stamps) -> list[Frame]:
        """A block without a hole."""
        rejected, lost = self.receiver.rejected, self.receiver.lost
        received = self.receiver.accept_block(block, t_us)
        self.counts.foreign += received.foreign
        events = self._events(block, t_us, received)
        self._now_us = int(t_us[-1])
        first = min((int(rows[0]) for rows in received.accepted if len(rows)), default=None)
        opened_by = -1
        if not self._due and first is not None:
            opened_by, t0_us = first, int(t_us[first])
            self._due = dict.fromkeys(self._cycles, t0_us)
            self._heard_us = [t0_us] * len(self.configuration.messages)
        due = self._due_times()
        # Rows that were taken before each due time; before the very first one the frame that
        # opens the service was judged as well.
        known = np.searchsorted(t_us, due)
        if opened_by >= 0:
            known[0] = opened_by + 1
        self._former.take(received.readings)
        self._moments = self._moments_of(due, received, known, rejected, lost)
        frames: list[Frame] = []
        for event in events:
            if event.row > opened_by:
                frames += self._emit(event.at_us)
            event.happen()
        return frames + self._emit(self._now_us)

    def _due_times(self) -> Stamps:
        """All due times until now, ascending."""
        times = [
            np.arange(due_us, self._now_us + 1, self._cycles[name])
            for name, due_us in self._due.items()
        ]
        return np.unique(np.concatenate(times)) if times else np.empty(0, dtype=np.int64)

    def _events(self, block: Block, t_us: Stamps, received: Received) -> list[_Event]:
        """What happens between due times, in the order of the rows."""
        found = []
        for row in np.flatnonzero(block.kind == Kind.SECOND_SENDER).tolist():
            now_us = int(t_us[row])
            stamp = max(int(block.t_us[row]), now_us)
            found.append(_Event(now_us, row, partial(self._second_sender, stamp)))
        stamps, values = received.readings.get((Role.SPEED_SOURCE, 0), _NOTHING)
        told = np.isfinite(values)
        last = self._source
        for stamp, value in zip(stamps[told].tolist(), values[told].tolist(), strict=True):
            if value != last:
                row = int(np.searchsorted(t_us, stamp, side="right"))
                found.append(_Event(stamp, row, partial(self._set_source, value)))
                last = value
        return sorted(found, key=lambda event: event.at_us)

    def _moment(self, t_us: int) -> Moment:
        return self._moments.pop(t_us)

    def _moments_of(
        self, due: Stamps, received: Received, known: NDArray[np.int64], rejected: int, lost: int
    ) -> dict[int, Moment]:
        """What the inputs had told, by due time."""
        rejections = np.sort(np.concatenate([*received.rejected, np.empty(0, dtype=np.int64)]))
        rejected_by = rejected + np.searchsorted(rejections, known)
        lost_by = np.full(len(due), lost)
        for rows, counts in received.lost:
            lost_by += np.concatenate([[0], np.cumsum(counts)])[np.searchsorted(rows, known)]
        told = zip(
            self._former.collect(due),
            self._stale(due, received).tolist(),
            self._speeds(due, received),
            rejected_by.tolist(),
            lost_by.tolist(),
            strict=True,
        )
        return {t_us: Moment(*row) for t_us, row in zip(due.tolist(), told, strict=True)}

    def _stale(self, due: Stamps, received: Received) -> NDArray[np.bool_]:
        """Whether a required message had been silent at each due time."""
        stale = np.zeros(len(due), dtype=np.bool_)
        if not self._heard_us:
            return stale
        for number, message in enumerate(self.configuration.messages):
            required = [(s.role, s.axle) for s in message.signals if s.role in REQUIRED]
            if not required:
                continue
            heard = np.full(len(due), self._heard_us[number])
            for key in required:
                stamps, values = received.readings.get(key, _NOTHING)
                told = stamps[np.isfinite(values)]
                if len(told):
                    place = np.searchsorted(told, due) - 1
                    heard = np.where(place >= 0, np.maximum(heard, told[place]), heard)
                    self._heard_us[number] = max(self._heard_us[number], int(told[-1]))
            stale |= due - heard > STALE_CYCLES * (message.cycle_us or 0)
        return stale

    def _speeds(self, due: Stamps, received: Received) -> list[float | None]:
        """Vehicle speed that each due time knew."""
        stamps, values = received.readings.get((Role.VEHICLE_SPEED, 0), _NOTHING)
        told = [None if np.isnan(value) else value for value in values.tolist()]
        known = [self._speed, *told]
        if told:
            self._speed = told[-1]
        return [known[place] for place in np.searchsorted(stamps, due).tolist()]


_NOTHING = (np.empty(0, dtype=np.int64), np.empty(0))
