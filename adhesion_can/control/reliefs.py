"""Reliefs: one axle at a time gives its effort up for a second, so that it shows the speed.

An axle without effort has no slip. Where nothing else shows the vehicle speed, the slips of all
others follow from it, and both ramps show the curve (`estimation.observed_speed`). The axles take
turns, since each of them shows its own wheel radius too.
"""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.control.settings import ReliefSettings

LEAST_EFFORT = 5e3
"""Effort below which an axle has nothing to give up, N."""


class Reliefs:
    """Shares of their efforts that the axles keep.

    Args:
        settings: Times.
        axles: Number of axles.

    """

    def __init__(self, settings: ReliefSettings, axles: int) -> None:
        self._settings = settings
        # Neighbours do not follow each other: a patch of the rail has both of them.
        self._order = [*range(0, axles, 2), *range(1, axles, 2)]
        self._turn = 0
        self._since_s: float | None = None
        self._ended_s: float | None = None
        self._changed_s: float | None = None
        self._was_changing = False
        self._shares = np.ones(axles)

    @property
    def axle(self) -> int | None:
        """Number of the axle that is relieved; None where none is."""
        return None if self._since_s is None else self._order[self._turn] + 1

    def step(
        self, time_s: float, effort: Array, *, asked: bool, changing: bool, allowed: bool
    ) -> Array:
        """Share of its effort that each axle keeps, 1, shape (axles,).

        Args:
            time_s: Time, s.
            effort: Effort that is demanded of each axle without reliefs, N, shape (axles,).
            asked: Whether the filter of the speed asks for a relief.
            changing: Whether the surface changes now.
            allowed: Whether a relief may begin now; one that has begun goes on.

        """
        s = self._settings
        if not s.enabled:
            return self._shares
        if self._ended_s is None:
            self._ended_s = time_s
        if changing and not self._was_changing:
            self._changed_s = time_s
        self._was_changing = changing
        if self._since_s is None and allowed and self._is_due(time_s, asked):
            self._begin(time_s, effort)
        return self._shares_at(time_s)

    def _is_due(self, time_s: float, asked: bool) -> bool:
        s = self._settings
        if self._ended_s is None or time_s < self._ended_s + s.pause_s:
            return False
        changed = self._changed_s is not None and time_s >= self._changed_s + s.change_wait_s
        return asked or changed or time_s >= self._ended_s + s.period_s

    def _begin(self, time_s: float, effort: Array) -> None:
        """Relieve the next axle that has an effort to give up."""
        for _ in self._order:
            if effort[self._order[self._turn]] >= LEAST_EFFORT:
                self._since_s, self._changed_s = time_s, None
                return
            self._turn = (self._turn + 1) % len(self._order)

    def _shares_at(self, time_s: float) -> Array:
        shares = np.ones(len(self._order))
        if self._since_s is not None:
            s = self._settings
            corners = np.cumsum([0.0, s.ramp_s, s.free_s, s.ramp_s])
            elapsed_s = time_s - self._since_s
            if elapsed_s < corners[-1]:
                shares[self._order[self._turn]] = np.interp(
                    elapsed_s, corners, (1.0, 0.0, 0.0, 1.0)
                )
            else:
                self._since_s, self._ended_s = None, time_s
                self._turn = (self._turn + 1) % len(self._order)
        self._shares = shares
        return shares


def spread_effort(effort: Array, shares: Array, largest: Array) -> Array:
    """Efforts where the other axles take over what a relieved one gives up, N, shape (axles,).

    They do as far as the adhesion of each allows; at the peak of the curve that is not at all.

    Args:
        effort: Effort that is demanded of each axle without a relief, N, shape (axles,).
        shares: Share of it that each axle keeps, 1, shape (axles,).
        largest: Largest effort that each axle can have on this rail, N, shape (axles,).

    """
    kept = effort * shares
    room = np.where(shares < 1.0, 0.0, np.maximum(largest - effort, 0.0))
    total = float(room.sum())
    given_up = float((effort - kept).sum())
    return np.asarray(kept + room * (min(given_up / total, 1.0) if total > 0.0 else 0.0))
