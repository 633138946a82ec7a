"""What each axle does, from the efforts alone: it pulls, it is free, or it is between the two."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings
from adhesion_can.values import Stateful

COMMON_S, TREND_S = 0.3, 0.6
"""Time constants of the effort that all axles share, and of its trend, s: sweeps are followed."""
OWN_S = 1.0
"""Time constant of what an axle has beside the others, s."""
NEAR, NEAR_STD = 0.06, 2.5
"""An axle pulls steadily within this share of its mean adhesion and so many standard deviations."""
REFERENCE_SPAN = 0.2
"""Change of ln μ from the reference at which the reference moves, 1."""
LEAST = 1e-4
"""Adhesion below which there is no mean to relate another one to, 1."""
PATIENCE_S = 0.4
"""Time after which an effort elsewhere is a new mean, s: longer than a relief's ramp."""


@dataclass(frozen=True, slots=True)
class AxleEfforts:
    """State of the axles in one block; arrays of shape (drives, axles) unless stated.

    Attributes:
        adhesion: Adhesion of the block, 1.
        free: Whether the axle hardly pulls.
        pulls: Whether it pulls steadily, so that its slip state holds.
        mean: Mean adhesion while it pulls, 1; NaN: it has not pulled yet. That of a relieved axle
            follows the efforts of the others.
        ratio: Adhesion that the slip state belongs to, over that of the last block, 1. It is 1
            while the effort changes by no more than its noise.
        starts: Whether the axle pulls for the first time.
        free_s: Time for which it has been free, s.
        relieved: Whether it has been free for as long as a relief lasts at least.

    """

    adhesion: Array
    free: NDArray[np.bool_]
    pulls: NDArray[np.bool_]
    mean: Array
    ratio: Array
    starts: NDArray[np.bool_]
    free_s: Array
    relieved: NDArray[np.bool_]


class EffortWatch(Stateful):
    """Follows the adhesion that each axle uses while it pulls, and keeps it during a relief.

    ln |μ_i| is a common level plus what each axle has beside the others. The level has little noise
    and may move fast, the rest moves slowly.
    """

    def __init__(self, drives: int, axles: int, settings: ObservedSpeedSettings) -> None:
        self._settings = settings
        self._free_s = np.zeros((drives, axles))
        self._known = np.zeros((drives, axles), dtype=bool)
        self._sign = np.ones((drives, axles))
        self._level = np.zeros((drives, 1))
        self._trend = np.zeros((drives, 1))
        self._own = np.zeros((drives, axles))
        self._level_reference = np.zeros((drives, 1))
        self._own_reference = np.zeros((drives, axles))
        self._certain = np.zeros((drives, axles))
        self._away_s = np.zeros((drives, axles))
        self._followed = np.zeros((drives, axles), dtype=bool)

    @property
    def mean(self) -> Array:
        """Mean adhesion of each axle while it pulls, 1; NaN: it has not pulled yet."""
        mean = self._sign * np.exp(self._level + self._own)
        return np.asarray(np.where(self._known, mean, np.nan))

    def update(self, adhesion: Array, dt: float, noise: float) -> AxleEfforts:
        """State of the axles after a block.

        Args:
            adhesion: Adhesion that each axle used in the block, 1, shape (drives, axles).
            dt: Length of the block, s.
            noise: Standard deviation of the adhesion of a block, 1.

        """
        free = np.abs(adhesion) < self._settings.free_adhesion
        self._free_s = np.where(free, self._free_s + dt, 0.0)
        starts = ~self._known & ~free
        sign = self._sign.copy()
        self._set(starts, adhesion)
        self._level = self._level + self._trend * dt
        mean = self._sign * np.exp(self._level + self._own)
        near = np.abs(adhesion - mean) < NEAR * np.abs(mean) + NEAR_STD * noise
        self._away_s = np.where(near | free, 0.0, self._away_s + dt)
        jumps = (self._away_s > PATIENCE_S) & ~free
        self._away_s = np.where(jumps, 0.0, self._away_s)
        follows = near & ~free & ~jumps
        self._follow(follows, adhesion / mean, dt)
        self._set(jumps, adhesion)
        self._centre()
        certain = self._certain_logs(follows | jumps, noise, dt)
        ratio = np.where(starts, 1.0, np.exp(certain - self._certain)) * self._sign * sign
        ratio = np.where(self._known & ~starts, ratio, 1.0)
        self._certain = certain
        self._known = self._known | starts
        # The first block near the mean may still hold the end of a ramp.
        pulls = starts | (follows & self._followed)
        self._followed = follows | starts | jumps
        relieved = free & (self._free_s >= self._settings.relief_s - 1e-9)
        return AxleEfforts(adhesion, free, pulls, self.mean, ratio, starts, self._free_s, relieved)

    def _set(self, which: NDArray[np.bool_], adhesion: Array) -> None:
        """Take the adhesion of the block as the mean of axles."""
        size = np.log(np.maximum(np.abs(adhesion), LEAST))
        fresh = which.any(axis=1, keepdims=True) & ~self._known.any(axis=1, keepdims=True)
        count = np.maximum(which.sum(axis=1, keepdims=True), 1)
        first = np.where(which, size, 0.0).sum(axis=1, keepdims=True) / count
        self._level = np.where(fresh, first, self._level)
        self._level_reference = np.where(fresh, first, self._level_reference)
        self._own = np.where(which, size - self._level, self._own)
        self._sign = np.where(which, np.where(adhesion < 0, -1.0, 1.0), self._sign)
        self._own_reference = np.where(which & ~self._known, self._own, self._own_reference)

    def _centre(self) -> None:
        """Give the level what all axles have in common, which changes no mean."""
        count = np.maximum(self._known.sum(axis=1, keepdims=True), 1)
        excess = np.where(self._known, self._own, 0.0).sum(axis=1, keepdims=True) / count
        self._own, self._own_reference = self._own - excess, self._own_reference - excess
        self._level, self._level_reference = (
            self._level + excess,
            self._level_reference + excess,
        )

    def _follow(self, follows: NDArray[np.bool_], relative: Array, dt: float) -> None:
        """Move level and rest towards the block's adhesion over its mean."""
        count = follows.sum(axis=1, keepdims=True)
        any_one = count > 0
        error = np.where(follows, np.log(np.clip(relative, 0.2, 5.0)), 0.0)
        shared = error.sum(axis=1, keepdims=True) / np.maximum(count, 1)
        gain = min(1.0, dt / COMMON_S)
        self._level = self._level + gain * shared
        trend = self._trend + gain / TREND_S * shared
        self._trend = np.where(any_one, trend, 0.0)
        rest = np.where(follows, error - shared, 0.0)
        self._own = self._own + min(1.0, dt / OWN_S) * rest

    def _certain_logs(self, used: NDArray[np.bool_], noise: float, dt: float) -> Array:
        """Logarithms of the means less their noise, shape (drives, axles).

        An effort's noise, multiplied by the slope of the curve, would look like slip. Soft
        thresholds (Donoho 1995) leave a steady effort steady.
        """
        count = np.maximum(used.sum(axis=1, keepdims=True), 1)
        scatter = noise / np.maximum(np.exp(self._level), 0.01)
        shared = scatter * np.sqrt(dt / COMMON_S / count)
        level = self._level - self._level_reference
        moves = np.abs(level) > REFERENCE_SPAN
        self._level_reference = np.where(moves, self._level, self._level_reference)
        level = self._level_reference + np.where(moves, 0.0, _shrunk(level, 2.0 * shared))
        deviation = self._own - self._own_reference
        moves = np.abs(deviation) > REFERENCE_SPAN
        self._own_reference = np.where(moves, self._own, self._own_reference)
        threshold = 3.0 * scatter * np.sqrt(dt / OWN_S / 2.0)
        deviation = self._own_reference + np.where(moves, 0.0, _shrunk(deviation, threshold))
        return np.asarray(level + deviation)


def _shrunk(values: Array, threshold: Array) -> Array:
    return np.asarray(np.sign(values) * np.maximum(np.abs(values) - threshold, 0.0))
