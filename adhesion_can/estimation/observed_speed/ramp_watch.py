"""Keeps the last seconds of samples, and cuts out those around a relief that has ended."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.axle_efforts import AxleEfforts
from adhesion_can.estimation.observed_speed.ramp_fit import RampSamples
from adhesion_can.values import Stateful, Value

KEPT_S = 4.0
"""Time for which samples are kept, s."""
BEFORE_S, AFTER_S = 0.5, 0.25
"""Time before and after the axle was free that belongs to a relief, s: both ramps."""
LEAST_OTHERS = 2
"""Axles that must pull all the time, beside which the relieved one is seen."""


@dataclass(frozen=True, slots=True)
class _Kept(Value):
    """Sample of all drives: time, s; rim speeds, m/s, and adhesions, 1, both (drives, axles)."""

    time_s: float
    rim: Array
    adhesion: Array


class RampWatch(Stateful):
    """Samples of drives that run side by side.

    Args:
        drives: Number of drives.
        axles: Number of axles.

    """

    def __init__(self, drives: int, axles: int) -> None:
        self._samples: deque[_Kept] = deque()
        self._now_s = 0.0
        shape = (drives, axles)
        self._since_s = np.full(shape, np.nan)
        self._resumed_s = np.full(shape, np.nan)
        self._restless_s = np.zeros(shape)

    def add(self, dt: float, rim: Array, adhesion: Array) -> None:
        """Keep a sample: rim speeds, m/s, and adhesions, 1, both (drives, axles)."""
        self._now_s += dt
        self._samples.append(_Kept(self._now_s, rim, adhesion))
        while self._samples[0].time_s < self._now_s - KEPT_S:
            self._samples.popleft()

    def update(
        self, axles: AxleEfforts, change: NDArray[np.bool_], slip: Array
    ) -> Iterator[tuple[int, int, RampSamples]]:
        """Drive, axle and samples of each relief whose second ramp has ended with this block.

        Args:
            axles: State of the axles.
            change: Whether the surface has changed under each axle, shape (drives, axles).
            slip: Slip of each axle at its mean adhesion, 1, of the same shape.

        """
        now_s = self._now_s
        self._since_s = np.where(axles.relieved, now_s - axles.free_s, self._since_s)
        self._restless_s = np.where(axles.pulls, self._restless_s, now_s)
        waiting = np.isfinite(self._since_s)
        begins = waiting & axles.pulls & np.isnan(self._resumed_s)
        self._resumed_s = np.where(begins, now_s, self._resumed_s)
        lost = change.any(axis=1, keepdims=True) | (
            waiting & ~axles.free & (now_s - self._since_s > KEPT_S)
        )
        self._since_s = np.where(lost, np.nan, self._since_s)
        self._resumed_s = np.where(lost | ~waiting, np.nan, self._resumed_s)
        done = np.isfinite(self._since_s) & (now_s - self._resumed_s >= AFTER_S)
        for drive, axle in zip(*np.nonzero(done), strict=True):
            start_s = self._since_s[drive, axle] - BEFORE_S
            steady = self._restless_s[drive] < start_s
            others = [int(k) for k in np.flatnonzero(steady) if k != axle]
            if len(others) >= LEAST_OTHERS:
                sign = float(np.sign(axles.mean[drive, axle]))
                yield int(drive), int(axle), self._cut(int(drive), start_s, sign, others, slip)
        self._since_s = np.where(done, np.nan, self._since_s)
        self._resumed_s = np.where(done, np.nan, self._resumed_s)

    def _cut(
        self, drive: int, start_s: float, sign: float, others: list[int], slip: Array
    ) -> RampSamples:
        chosen = [sample for sample in self._samples if sample.time_s >= start_s]
        rim = np.array([sample.rim[drive] for sample in chosen])
        adhesion = np.array([sample.adhesion[drive] for sample in chosen])
        return RampSamples(np.log(np.maximum(rim, 1e-3)), sign * adhesion, others, slip[drive])
