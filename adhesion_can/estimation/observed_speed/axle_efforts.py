"""What each axle does, from the efforts alone: it pulls, it is free, or it is between the two."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.settings import ObservedSpeedSettings

FOLLOW_S = 0.7
"""Time constant of the mean adhesion of an axle that pulls, s."""
TREND_S = 1.2
"""Time constant of its trend, s, without which the mean would lag behind a sweep."""
NEAR, NEAR_STD = 0.06, 2.5
"""An axle pulls steadily within this share of its mean adhesion and so many standard deviations."""
REFERENCE_SPAN = 0.2
"""Relative distance of the mean adhesion from the reference at which the reference moves, 1."""
LEAST = 1e-4
"""Adhesion below which there is no reference to relate another one to, 1."""
PATIENCE_S = 0.4
"""Time after which an effort elsewhere is a new mean, s: longer than a relief's ramp."""


@dataclass(frozen=True, slots=True)
class AxleEfforts:
    """State of the axles in one block; arrays of shape (drives, axles) unless stated.

    Attributes:
        adhesion: Adhesion of the block, 1.
        free: Whether the axle hardly pulls.
        pulls: Whether it pulls steadily, so that its slip state holds.
        mean: Mean adhesion while it pulls, 1; NaN: it has not pulled yet.
        ratio: Adhesion that the slip state belongs to, over that of the last block, 1. It is 1
            while the effort changes by no more than its noise.
        starts: Whether the axle pulls for the first time.

    """

    adhesion: Array
    free: NDArray[np.bool_]
    pulls: NDArray[np.bool_]
    mean: Array
    ratio: Array
    starts: NDArray[np.bool_]


class EffortWatch:
    """Follows the adhesion that each axle uses while it pulls, and keeps it during a relief."""

    def __init__(self, drives: int, axles: int, settings: ObservedSpeedSettings) -> None:
        self._settings = settings
        self.mean = np.full((drives, axles), np.nan)
        """Mean adhesion of each axle while it pulls, 1; NaN: it has not pulled yet."""
        self.free_s = np.zeros((drives, axles))
        """Time for which each axle has been free, s."""
        self._trend = np.zeros((drives, axles))
        self._reference = np.full((drives, axles), np.nan)
        self._relative = np.ones((drives, axles))
        self._away_s = np.zeros((drives, axles))
        self._followed = np.zeros((drives, axles), dtype=bool)

    def update(self, adhesion: Array, dt: float, noise: float) -> AxleEfforts:
        """State of the axles after a block.

        Args:
            adhesion: Adhesion that each axle used in the block, 1, shape (drives, axles).
            dt: Length of the block, s.
            noise: Standard deviation of the adhesion of a block, 1.

        """
        free = np.abs(adhesion) < self._settings.free_adhesion
        self.free_s = np.where(free, self.free_s + dt, 0.0)
        known = np.isfinite(self.mean)
        starts = ~known & ~free
        mean = np.where(known, self.mean, adhesion)
        mean = mean + self._trend * dt
        near = np.abs(adhesion - mean) < NEAR * np.abs(mean) + NEAR_STD * noise
        self._away_s = np.where(near | free, 0.0, self._away_s + dt)
        jumps = (self._away_s > PATIENCE_S) & ~free
        self._away_s = np.where(jumps, 0.0, self._away_s)
        follows = near & ~free
        mean = np.where(jumps, adhesion, mean)
        gain = min(1.0, dt / FOLLOW_S)
        trend = self._trend + gain / TREND_S * (adhesion - mean)
        self._trend = np.where(follows, trend, 0.0)
        mean = np.where(follows, mean + (adhesion - mean) * gain, mean)
        self.mean = np.where(known | starts, mean, np.nan)
        reference = np.where(np.isfinite(self._reference), self._reference, mean)
        reference = np.where(np.abs(reference) > LEAST, reference, LEAST)
        scatter = noise * np.sqrt(dt / (2.0 * FOLLOW_S)) / np.maximum(np.abs(reference), 0.01)
        certain = _certain(mean / reference, known & ~free, scatter)
        moves = (np.abs(mean / reference - 1.0) > REFERENCE_SPAN) & ~free
        relative = np.where(moves, mean / reference, np.where(free, self._relative, certain))
        relative = np.where(known, relative, 1.0)
        ratio = np.where(known, relative / self._relative, 1.0)
        self._relative = np.where(moves, 1.0, relative)
        reference = np.where(moves, mean, reference)
        self._reference = np.where(known | starts, reference, np.nan)
        # The first block near the mean may still hold the end of a ramp.
        pulls = starts | (follows & self._followed)
        self._followed = follows | starts
        return AxleEfforts(adhesion, free, pulls, self.mean, ratio, starts)


def _certain(relative: Array, used: NDArray[np.bool_], scatter: Array) -> Array:
    """Part of relative efforts that is no noise: that of all axles, and what each has beside it.

    An effort's noise, multiplied by the slope of the curve, would look like slip. Soft thresholds
    (Donoho 1995) leave a steady effort steady.

    Args:
        relative: Mean adhesion over its reference, 1, shape (drives, axles).
        used: Whether an axle counts.
        scatter: Standard deviation of `relative` by noise, 1.

    """
    logs = np.log(np.clip(np.abs(relative), 0.1, 10.0))
    count = np.maximum(used.sum(axis=1, keepdims=True), 1)
    common = np.where(used, logs, 0.0).sum(axis=1, keepdims=True) / count
    spread = np.sqrt(np.where(used, scatter**2, 0.0).sum(axis=1, keepdims=True)) / count
    own = logs - common
    whole = _shrunk(common, 2.0 * spread) + _shrunk(own, 3.0 * scatter)
    return np.asarray(np.where(used, np.exp(whole), 1.0))


def _shrunk(values: Array, threshold: Array) -> Array:
    return np.asarray(np.sign(values) * np.maximum(np.abs(values) - threshold, 0.0))
