"""Reliefs and changes of the surface over time: whether the slip is known, and what is missing."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.axle_efforts import AxleEfforts
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.physics.objection import Objection
from adhesion_can.values import Stateful

QUIET_S = 0.3
"""Time without a change after which a relief is worth its cost, s."""
LONGEST_WAIT_S = 2.0
"""Time after a change at which a relief is needed in any case, s."""
BETWEEN_RELIEFS_S = 4.0
"""Time between reliefs that are called since wheel radii are not known, s."""
LEAST_USED_S = 8.0
"""Time between reliefs that are called since the slip is not known for another reason, s."""
GNSS_VALID_S = 3.0
"""Time for which a speed by satellites counts, s."""


@dataclass(frozen=True, slots=True)
class ReliefVerdict:
    """Whether slips are known; see `ObservedSpeed` for the attributes."""

    known: NDArray[np.bool_]
    wanted: NDArray[np.bool_]
    reasons: tuple[Objection, ...]


class ReliefWatch(Stateful):
    """Times since the last relief, the last change and the last speed by satellites."""

    def __init__(
        self, drives: int, axles: int, length: float, settings: ObservedSpeedSettings
    ) -> None:
        self._settings = settings
        self._length = length
        self.since_relief_s = np.full(drives, np.inf)
        self._relieved_before = np.zeros((drives, axles), dtype=bool)
        self.first_ended = np.zeros(drives, dtype=bool)
        """Whether a first relief has been completed."""
        self._since_gnss_s = np.full(drives, np.inf)
        self._since_change_s = np.full(drives, np.inf)
        self._since_first_change_s = np.full(drives, np.inf)
        self._changed = np.zeros(drives, dtype=bool)
        self._highest = np.full(drives, -np.inf)
        self._moved = np.zeros(drives, dtype=bool)
        self._last = np.full(drives, np.inf)
        self._speed = np.full(drives, 1.0)

    def see_speed(self, there: NDArray[np.bool_]) -> None:
        """A speed by satellites has come, where `there`."""
        self._since_gnss_s = np.where(there, 0.0, self._since_gnss_s)

    def update(
        self, axles: AxleEfforts, change: NDArray[np.bool_], speed: Array, dt: float
    ) -> None:
        """Let a block of `dt` seconds pass.

        Args:
            axles: State of the axles.
            change: Whether the surface has changed under each axle, shape (drives, axles).
            speed: Vehicle speed, m/s, shape (drives,).
            dt: Time since the last call, s.

        """
        self._speed = np.maximum(speed, 1.0)
        self.since_relief_s = self.since_relief_s + dt
        self._since_gnss_s = self._since_gnss_s + dt
        self._since_change_s = self._since_change_s + dt
        self._since_first_change_s = self._since_first_change_s + dt
        # While all axles coast there is no slip to know.
        relieved = axles.relieved.any(axis=1) & (
            2 * axles.pulls.sum(axis=1) >= axles.pulls.shape[1]
        )
        self.since_relief_s = np.where(relieved, 0.0, self.since_relief_s)
        self.first_ended |= relieved
        self._relieved_before |= axles.relieved & relieved[:, None]
        level = _log_level(axles.mean)
        any_change = change.any(axis=1)
        self._highest = np.where(any_change, -np.inf, self._highest)
        self._highest = np.where(relieved, np.maximum(level, self._highest), self._highest)
        self._last = np.where(relieved, level, self._last)
        self._moved = level - self._last > self._settings.effort_change
        starts = any_change & ~self._changed
        self._since_first_change_s = np.where(starts, 0.0, self._since_first_change_s)
        self._since_change_s = np.where(any_change, 0.0, self._since_change_s)
        # A relief ends a change that came before the axle was free.
        ended = relieved & (self._since_change_s > self._settings.relief_s)
        self._changed = (self._changed & ~ended) | any_change

    def beyond(self, adhesion: Array) -> Array:
        """Logarithm of the effort over the largest one of all reliefs, at least 0, (drives,)."""
        above = _log_level(adhesion) - self._highest
        return np.where(np.isfinite(above), np.maximum(above, 0.0), 0.0)

    def judge(self, slip_std: Array) -> ReliefVerdict:
        """Verdict at the standard deviations of the slips, 1, shape (drives,)."""
        s = self._settings
        recent = (self.since_relief_s <= s.relief_valid_s) | (self._since_gnss_s < GNSS_VALID_S)
        sharp = np.asarray(slip_std < s.slip_std)
        # With a speed by satellites the slip follows from it, at any effort.
        moved = self._moved & (self._since_gnss_s >= GNSS_VALID_S)
        known = recent & sharp & ~self._changed & ~moved
        passage = np.minimum(self._length / self._speed + QUIET_S, LONGEST_WAIT_S)
        waited = self._since_first_change_s > passage
        new_axle_left = ~self._relieved_before.all(axis=1)
        more = new_axle_left & ~self._moved
        again_s = np.where(more, BETWEEN_RELIEFS_S, LEAST_USED_S)
        radii = (~sharp | moved) & (self.since_relief_s >= again_s)
        wanted = (self._changed & waited & (self.since_relief_s > 0)) | (radii & ~self._changed)
        reasons = tuple(
            Objection.NONE if k else _reason(changed=c, recent=r, moved=m)
            for k, c, r, m in zip(known, self._changed, recent, moved, strict=True)
        )
        return ReliefVerdict(known, wanted, reasons)


def _reason(*, changed: bool, recent: bool, moved: bool) -> Objection:
    """Why a slip is not known; the first of several."""
    if changed:
        return Objection.RAIL_CHANGED
    if not recent:
        return Objection.NO_RELIEF
    return Objection.EFFORTS_ROSE if moved else Objection.RADII_UNCERTAIN


def _log_level(adhesion: Array) -> Array:
    """Logarithm of the mean size of the adhesions, shape (drives,)."""
    pulled = np.isfinite(adhesion)
    total = np.where(pulled, np.abs(adhesion), 0.0).sum(axis=1)
    return np.asarray(np.log(np.maximum(total / np.maximum(pulled.sum(axis=1), 1), 1e-4)))
