"""What each axle does, from the efforts alone: it pulls, it is free, or it is between the two."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings

FOLLOW_S = 0.2
"""Time constant of the reference adhesion of an axle that pulls, s."""
NEAR = 0.25
"""Relative distance from its reference within which an axle pulls steadily, 1."""
PATIENCE_S = 0.5
"""Time after which an effort elsewhere is a new reference, s: longer than a relief's ramp."""
SLOW_S = 2.0
"""Time constant of the mean adhesion whose changes say how far the curve has been travelled, s."""


@dataclass(frozen=True, slots=True)
class AxleEfforts:
    """State of the axles in one block; arrays of shape (drives, axles) unless stated.

    Attributes:
        adhesion: Adhesion of the block, 1.
        free: Whether the axle hardly pulls.
        pulls: Whether it pulls steadily, so that its slip state holds.
        distance: Relative distance of the adhesion from its reference, 1.
        ratio: Reference of this block over that of the last one, 1.
        starts: Whether the axle pulls for the first time, or after a long time without effort.
        travelled: |Δ ln μ| of the slow mean of the axles in this block, 1, shape (drives,).

    """

    adhesion: Array
    free: NDArray[np.bool_]
    pulls: NDArray[np.bool_]
    distance: Array
    ratio: Array
    starts: NDArray[np.bool_]
    travelled: Array


class EffortWatch:
    """Follows the adhesion that each axle uses while it pulls, and keeps it during a relief."""

    def __init__(self, drives: int, axles: int, settings: ObservedSpeedSettings) -> None:
        self._settings = settings
        self.reference = np.full((drives, axles), np.nan)
        """Adhesion at which the slip state of each axle holds, 1; NaN: it has not pulled yet."""
        self._away_s = np.zeros((drives, axles))
        self._free_s = np.zeros((drives, axles))
        self._slow = np.full(drives, np.nan)

    def update(self, adhesion: Array, dt: float) -> AxleEfforts:
        """State of the axles after a block of `dt` seconds with the adhesion that they used."""
        free = np.abs(adhesion) < self._settings.free_adhesion
        self._free_s = np.where(free, self._free_s + dt, 0.0)
        known = np.isfinite(self.reference)
        old = np.where(known, self.reference, adhesion)
        old = np.where(np.abs(old) > 1e-6, old, 1e-6)
        distance = adhesion / old - 1.0
        near = np.abs(distance) < NEAR
        self._away_s = np.where(near | free, 0.0, self._away_s + dt)
        jumps = (self._away_s > PATIENCE_S) & ~free
        starts = ~known & ~free
        followed = old + (adhesion - old) * min(1.0, dt / FOLLOW_S)
        reference = np.where(near & ~free, followed, np.where(jumps | starts, adhesion, old))
        # The demand usually rises from a standing start: the first reference is soon outgrown.
        self.reference = np.where(known | starts, reference, np.nan)
        ratio = np.where(known, reference / old, 1.0)
        self._away_s = np.where(jumps, 0.0, self._away_s)
        return AxleEfforts(
            adhesion,
            free,
            ~free & (near | jumps | starts),
            np.where(known, adhesion / np.where(known, self.reference, 1.0) - 1.0, 0.0),
            ratio,
            starts,
            self._travelled(dt),
        )

    @property
    def free_s(self) -> Array:
        """Time for which each axle has been free, s, shape (drives, axles)."""
        return self._free_s

    def _travelled(self, dt: float) -> Array:
        known = np.isfinite(self.reference)
        count = np.maximum(known.sum(axis=1), 1)
        mean = np.where(known, np.abs(self.reference), 0.0).sum(axis=1) / count
        mean = np.maximum(mean, 1e-4)
        slow = np.where(np.isfinite(self._slow), self._slow, mean)
        new = slow + (mean - slow) * min(1.0, dt / SLOW_S)
        self._slow = np.where(known.any(axis=1), new, np.nan)
        return np.where(np.isfinite(self._slow), np.abs(np.log(new / slow)), 0.0)
