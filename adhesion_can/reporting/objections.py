"""Objections of a drive: what lasted, and where the service only waited for the vehicle's answer.

A step of all efforts is objected to until slips or vehicle speed answer it. A rail that changes
under all axles makes such a step, so an objection that is withdrawn in that time is no fault.
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from adhesion_can.physics.objection import WORDINGS, Objection, objection_sentence
from adhesion_can.plurals import counted
from adhesion_can.result_text import TimeScale

LONGEST_WAIT_S = 2.0
"""Time within which the vehicle answers a step of the efforts; the watch takes 50 cycles at most, a
second of 20 ms cycles."""
LASTS = 0.05
"""Share of the time from which an objection comes first in what is said of a drive."""


class Stretch(NamedTuple):
    """Time with one objection.

    Attributes:
        objection: What the readings cannot be.
        from_us: Stamp of its first setpoint, µs.
        to_us: Stamp of its last setpoint, µs.
        setpoints: Number of its setpoints.

    """

    objection: Objection
    from_us: int
    to_us: int
    setpoints: int = 1

    @property
    def seconds(self) -> float:
        """Duration, s."""
        return (self.to_us - self.from_us) / 1e6

    @property
    def is_wait(self) -> bool:
        """Whether the service may only have waited for the answer to a step of the efforts."""
        return self.objection is Objection.EFFORTS_JUMP and self.seconds <= LONGEST_WAIT_S


class ObjectionLog:
    """Collects the objections of the setpoints of a drive."""

    def __init__(self) -> None:
        self._first_us: int | None = None
        self._total = 0
        self._stretches: list[Stretch] = []
        self._latest = Objection.NONE

    def add(self, t_us: int, objection: Objection) -> None:
        """Add the objection of the setpoint of a due time, µs."""
        if self._first_us is None:
            self._first_us = t_us
        self._total += 1
        before, self._latest = self._latest, objection
        if objection not in WORDINGS:
            return
        if objection is before:
            last = self._stretches[-1]
            self._stretches[-1] = last._replace(to_us=t_us, setpoints=last.setpoints + 1)
        else:
            self._stretches.append(Stretch(objection, t_us, t_us))

    @property
    def shares(self) -> dict[Objection, float]:
        """Share of the time of each objection, 0..1, without waits; the largest first."""
        counts: Counter[Objection] = Counter()
        for stretch in self._stretches:
            if not stretch.is_wait:
                counts[stretch.objection] += stretch.setpoints
        return {objection: count / self._total for objection, count in counts.most_common()}

    @property
    def foremost(self) -> Stretch | None:
        """Longest stretch of the objection that comes first; None where none lasts."""
        lasting = (
            candidate for candidate, share in self.shares.items() if _lasts(candidate, share)
        )
        objection = next(lasting, None)
        of_objection = (stretch for stretch in self._stretches if stretch.objection is objection)
        return max(of_objection, key=lambda stretch: stretch.seconds, default=None)

    @property
    def times(self) -> TimeScale:
        """Times of the drive, from its first setpoint."""
        return TimeScale.beginning_at(self._first_us or 0)

    def sentences(self) -> list[str]:
        """Sentence for each objection with its share of the time, and one for the waits."""
        lines = [
            f"{100 * share:.1f} % of the time {objection_sentence(objection)}."
            for objection, share in self.shares.items()
        ]
        waits = [stretch for stretch in self._stretches if stretch.is_wait]
        return [*lines, self._wait_sentence(waits)] if waits else lines

    def _wait_sentence(self, waits: Sequence[Stretch]) -> str:
        share = sum(stretch.setpoints for stretch in waits) / self._total
        return (
            f"{100 * share:.1f} % of the time the service waited for the vehicle's answer to a "
            f"step of all efforts ({counted(len(waits), 'time')}, "
            f"{max(stretch.seconds for stretch in waits):.1f} s at most): the rail can change "
            "under all axles at once, so this is no fault."
        )


def _lasts(objection: Objection, share: float) -> bool:
    """Whether an objection comes before everything else that is to be said of a drive."""
    return share >= LASTS or objection is Objection.EFFORTS_JUMP
