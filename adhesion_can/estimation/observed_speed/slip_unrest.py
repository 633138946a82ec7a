"""How restless the slips are, from what moves between the axles.

A common drift of all slips imitates an acceleration and cannot be seen. What moves between the axles
can, and both have the same cause: a rail whose level wanders, and a curve that is steep in slip near
its peak. So the wander that is seen scales the one that is not.
"""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

WINDOW_S = 1.5
"""Time over which a movement between axles is measured, s."""
MEMORY = 8.0
"""Number of windows over which the scale is averaged; it starts with a weight of `PRIOR`."""
PRIOR = 3.0
LARGEST, SMALLEST = 3.0, 0.5
"""Bounds of the scale of the standard deviation."""
CALM_S = 1.5
"""Time constant with which an axle calms down after a change of the surface, s."""


class SlipUnrest:
    """Scale of each axle's random walk, and its excitement after a change of the surface."""

    def __init__(self, drives: int, axles: int) -> None:
        self.scale = np.ones((drives, axles))
        """Factor on the standard deviation of each axle's random walk, 1."""
        self.excitement = np.zeros((drives, axles))
        """1 at a change of the surface, falling to 0."""
        self._sum = PRIOR * np.ones((drives, axles))
        self._weight = PRIOR * np.ones((drives, axles))
        self._start = np.full((drives, axles), np.nan)
        self._expected = np.zeros((drives, axles))
        self._elapsed_s = 0.0

    def update(
        self,
        slip: Array,
        steady: NDArray[np.bool_],
        change: NDArray[np.bool_],
        variance: Array,
        noise: Array,
        dt: float,
    ) -> None:
        """Let a block pass.

        Args:
            slip: Estimated slip of each axle less its radius' error, 1, shape (drives, axles).
            steady: Whether the axle pulled without a change of its effort.
            change: Whether the surface has changed under it.
            variance: Variance that the random walk of an axle alone has in a block at a scale of 1.
            noise: Variance of `slip` by the measurement, 1.
            dt: Length of the block, s.

        """
        self.excitement = np.where(change, 1.0, self.excitement * np.exp(-dt / CALM_S))
        calm = steady & ~change & (self.excitement < 0.1)
        self._start = np.where(calm, self._start, np.nan)
        self._expected += variance
        self._elapsed_s += dt
        if self._elapsed_s < WINDOW_S:
            return
        moved = slip - self._start
        there = np.isfinite(moved)
        # The median of the axles moves with the speed.
        enough = there.sum(axis=1, keepdims=True) >= 3
        common = np.zeros((len(slip), 1))
        rows = np.flatnonzero(enough[:, 0])
        if rows.size:
            common[rows] = np.nanmedian(moved[rows], axis=1, keepdims=True)
        counted = there & enough
        ratio = np.where(counted, (moved - common) ** 2 / (self._expected + 2.0 * noise), 0.0)
        keep = np.where(counted, 1.0 - 1.0 / MEMORY, 1.0)
        self._sum = keep * self._sum + np.minimum(ratio, LARGEST**2)
        self._weight = keep * self._weight + counted
        own = self._sum / self._weight
        # An axle's own share is a coarse estimate; that of all axles supports it.
        both = np.maximum(own, own.mean(axis=1, keepdims=True))
        self.scale = np.clip(np.sqrt(both), SMALLEST, LARGEST)
        self._start = slip.copy()
        self._expected = np.zeros_like(self._expected)
        self._elapsed_s = 0.0
