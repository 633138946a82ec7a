"""Age, rate and faults of every message, from counts that are noted ten times a second.

Counts grow with frames alone, so that the same frames give the same rates, live and recorded.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from adhesion_can.bus.checked_message import CheckedMessage, SignalValues
from adhesion_can.bus.codec import MessagePlan
from adhesion_can.bus.database import CanDatabase, cycle_us
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.message_record import LATE_CYCLES, MessageRecord
from adhesion_can.bus.rejection import Rejection
from adhesion_can.monitoring.snapshot import MessageRole, MessageState, MessageView

TALLY_US = 100_000
"""Time between two notes of the counts, µs."""
KEPT_US = 10_000_000
"""Time for which counts are kept, µs; faults within it are recent."""
RATE_US, RATE_CYCLES = 1_000_000, 20
"""Shortest time that a rate is taken over, µs and cycles."""
OTHER_IDS = 256
"""Largest number of ids that the configuration does not use; of further ones frames alone count."""


class WatchedMessage:
    """A message with the checks of the service, and its counts.

    Args:
        message: Decoder with the checks.
        kind: Part of the message.

    """

    def __init__(self, message: CheckedMessage, kind: MessageRole) -> None:
        self.message = message
        self.kind = kind
        self.accepted = 0
        self.rejected: Counter[Rejection] = Counter()
        self.last_us: int | None = None

    def read(self, frame: Frame) -> SignalValues | Rejection:
        """Values of a frame of the message, or the reason to reject it; counted."""
        outcome = self.message.read(frame)
        if isinstance(outcome, Rejection):
            self.rejected[outcome] += 1
        else:
            self.accepted += 1
            self.last_us = frame.t_us
        return outcome


@dataclass(slots=True)
class _Other:
    """Frames of an id that the configuration does not use."""

    place: "_Place"
    accepted: int = 0
    last_us: int | None = None


class _Place(NamedTuple):
    """What a message is."""

    name: str
    frame_id: int
    is_extended: bool
    kind: MessageRole
    cycle_us: int | None


class _Row(NamedTuple):
    """A message as it stands: what it is, its statistics, and its latest stamp, µs."""

    place: _Place
    accepted: int
    rejected: Mapping[Rejection, int]
    lost: int
    last_us: int | None

    @property
    def totals(self) -> "_Count":
        return _Count(self.accepted, sum(self.rejected.values()) + self.lost)


class _Count(NamedTuple):
    accepted: int
    faults: int


@dataclass(slots=True)
class _Tally:
    """Counts of all messages up to a time, inclusive.

    Attributes:
        t_us: Time, µs.
        frames: Number of frames of any kind.
        counts: Counts of the messages, in their order; those that came later are missing.

    """

    t_us: int
    frames: int
    counts: list[_Count] = field(default_factory=list)


class MessageTable:
    """Counts of all messages.

    Args:
        inputs: Statistics of the input messages, which their receiver keeps up to date.
        watched: Other messages that are checked.
        database: Database that names the ids which are neither.

    """

    def __init__(
        self,
        inputs: Iterable[MessageRecord],
        watched: Iterable[WatchedMessage],
        database: CanDatabase,
    ) -> None:
        self._inputs = list(inputs)
        self._watched = list(watched)
        self._others: dict[tuple[int, bool], _Other] = {}
        self._names = {(m.frame_id, m.is_extended_frame): m for m in database.db.messages}
        self._tallies: list[_Tally] = []
        self._last_us = 0
        self.frames = 0
        """Number of frames of any kind."""

    def begin_frame(self, t_us: int) -> None:
        """Note the counts where it is time to, before a frame with this stamp is counted, µs."""
        if not self._tallies:
            self._last_us = t_us
            self._note()
        elif t_us > self._last_us >= self._tallies[-1].t_us + TALLY_US:
            self._note()
        self.frames += 1
        self._last_us = t_us

    def count_other(self, frame: Frame) -> None:
        """Count a frame that is not checked."""
        key = frame.arbitration_id, frame.is_extended
        other = self._others.get(key)
        if other is None:
            if len(self._others) >= OTHER_IDS or not frame.is_data:
                return
            message = self._names.get(key)
            stated = None if message is None else cycle_us(message)
            name = "" if message is None else message.name
            place = _Place(name, *key, MessageRole.OTHER, stated)
            other = self._others[key] = _Other(place)
        other.accepted += 1
        other.last_us = frame.t_us

    def views(self, t_us: int) -> tuple[MessageView, ...]:
        """All messages at a time, µs: inputs, outputs, then others that came, by their ids."""
        rows = self._rows()
        views = [self._view(index, row, t_us) for index, row in enumerate(rows)]
        known = [view for view in views if view.kind is not MessageRole.OTHER]
        others = [
            view
            for view in views
            if view.kind is MessageRole.OTHER and view.state is not MessageState.NEVER
        ]
        others.sort(key=lambda view: (view.is_extended, view.frame_id))
        return (*known, *others)

    def frame_rate(self, t_us: int) -> float:
        """Frames of any kind per second of late, 1/s."""
        tally = self._tally_before(t_us - RATE_US)
        if tally is None or self._last_us < t_us - RATE_US or t_us <= tally.t_us:
            return 0.0
        return (self.frames - tally.frames) / ((t_us - tally.t_us) / 1e6)

    def _note(self) -> None:
        """Note the counts with all frames up to the latest stamp."""
        counts = [row.totals for row in self._rows()]
        self._tallies.append(_Tally(self._last_us, self.frames, counts))
        # One from before the time that is kept stays, so that it is reached back to.
        while len(self._tallies) > 1 and self._tallies[1].t_us <= self._last_us - KEPT_US:
            del self._tallies[0]

    def _rows(self) -> list[_Row]:
        """All messages; those that came later stand behind, so that their places stay."""
        rows = []
        for record in self._inputs:
            message = record.message
            place = _place(message.plan, MessageRole.INPUT, message.cycle_us)
            counts = (record.accepted, record.rejected, record.lost, record.last_us)
            rows.append(_Row(place, *counts))
        for watched in self._watched:
            place = _place(watched.message.plan, watched.kind, watched.message.cycle_us or None)
            rows.append(
                _Row(
                    place, watched.accepted, watched.rejected, watched.message.lost, watched.last_us
                )
            )
        rows += [
            _Row(other.place, other.accepted, {}, 0, other.last_us)
            for other in self._others.values()
        ]
        return rows

    def _view(self, index: int, row: _Row, t_us: int) -> MessageView:
        before = self._tally_before(t_us - KEPT_US)
        recent = row.totals.faults - self._count_at(before, index).faults
        age_us = None if row.last_us is None else max(t_us - row.last_us, 0)
        if age_us is None and not row.rejected:
            state = MessageState.NEVER
        elif age_us is None or (row.place.cycle_us and age_us > LATE_CYCLES * row.place.cycle_us):
            state = MessageState.SILENT
        else:
            state = MessageState.FAULTY if recent else MessageState.OK
        return MessageView(
            *row.place,
            accepted=row.accepted,
            rejected={str(reason): number for reason, number in row.rejected.items()},
            lost=row.lost,
            age_us=age_us,
            rate=self._rate(index, row, t_us),
            recent_faults=recent,
            state=state,
        )

    def _rate(self, index: int, row: _Row, t_us: int) -> float | None:
        window_us = min(max(RATE_US, RATE_CYCLES * (row.place.cycle_us or 0)), KEPT_US)
        if row.last_us is not None and row.last_us < t_us - window_us:
            return 0.0
        tally = self._tally_before(t_us - window_us)
        if tally is None or row.last_us is None or t_us - tally.t_us < window_us / 2:
            return None
        before = self._count_at(tally, index).accepted
        return (row.accepted - before) / ((t_us - tally.t_us) / 1e6)

    def _tally_before(self, t_us: int) -> _Tally | None:
        """Latest counts from a time, µs, or before it; else the first ones."""
        if not self._tallies:
            return None
        place = bisect_right(self._tallies, t_us, key=lambda tally: tally.t_us)
        return self._tallies[max(place - 1, 0)]

    @staticmethod
    def _count_at(tally: _Tally | None, index: int) -> _Count:
        if tally is None or index >= len(tally.counts):
            return _Count(0, 0)
        return tally.counts[index]


def _place(plan: MessagePlan, kind: MessageRole, cycle: int | None) -> _Place:
    return _Place(plan.name, plan.frame_id, plan.is_extended, kind, cycle)
