"""Rows of all axles at one moment, from samples that come axle by axle."""

from collections import deque
from dataclasses import dataclass
from math import nan

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.equations import AID_COLUMNS
from adhesion_can.values import Stateful

LONGEST_WAIT_US = 1_000_000
"""Longest time for which a sample waits for those of the other axles, µs."""


@dataclass(frozen=True, slots=True)
class SampleRow:
    """Samples of all axles within a cycle of the wheel speeds.

    Attributes:
        t_us: Mean of their stamps, µs.
        rim: Speed of each rim, m/s, shape (axles,).
        adhesion: Adhesion of each axle, 1, shape (axles,).
        load: Load of each axle, N, shape (axles,).
        gnss: Speed by satellites, m/s; NaN where none has come with this row.
        acceleration: Longitudinal acceleration, m/s²; NaN likewise.

    """

    t_us: float
    rim: Array
    adhesion: Array
    load: Array
    gnss: float = nan
    acceleration: float = nan


class AxleRows(Stateful):
    """Pairs the samples of the axles by their stamps.

    Args:
        axles: Number of axles.
        cycle_us: Cycle of the wheel speeds, µs.

    """

    def __init__(self, axles: int, cycle_us: int) -> None:
        self._cycle_us = cycle_us
        self._waiting: list[deque[tuple[float, ...]]] = [deque() for _ in range(axles)]
        self._seen_us = dict.fromkeys(AID_COLUMNS, nan)
        """Stamp of the latest reading of each aid; NaN before the first."""

    def add(self, samples: Samples) -> list[SampleRow]:
        """Add samples in the order of their stamps; returns the rows that are complete by now."""
        rim = samples.speed * (1.0 + samples.slip)
        unknown = np.full(len(samples), nan)
        aids = [
            samples.covariates.get(name, unknown)
            for columns in AID_COLUMNS.values()
            for name in columns
        ]
        columns = (samples.t_us, rim, samples.adhesion, samples.load, *aids)
        of_axle = zip(*(column.tolist() for column in columns), strict=True)
        for axle, values in zip(samples.axle.tolist(), of_axle, strict=True):
            self._waiting[axle - 1].append(values)
        self._forget_old()
        rows = []
        while all(self._waiting):
            latest_us = max(queue[0][0] for queue in self._waiting)
            old = [queue for queue in self._waiting if latest_us - queue[0][0] >= self._cycle_us]
            if old:
                # The others have lost the sample that belongs to these.
                for queue in old:
                    queue.popleft()
                continue
            matched = np.array([queue.popleft() for queue in self._waiting])
            t_us = float(matched[:, 0].mean())
            rows.append(SampleRow(t_us, *matched[:, 1:4].T.copy(), *self._fresh(matched[:, 4:])))
        return rows

    def _forget_old(self) -> None:
        """Drop samples that wait for an axle which has none: it may stay lost for hours."""
        newest_us = max((queue[-1][0] for queue in self._waiting if queue), default=0.0)
        for queue in self._waiting:
            while queue and newest_us - queue[0][0] > LONGEST_WAIT_US:
                queue.popleft()

    def _fresh(self, aids: Array) -> list[float]:
        """Values of the aids that no row before had; NaN where there is none.

        Args:
            aids: Value and stamp of each aid, at the samples of a row, shape (axles, 4).

        """
        fresh = []
        for k, aid in enumerate(AID_COLUMNS):
            value, stamp = aids[
                int(np.argmax(np.nan_to_num(aids[:, 2 * k + 1]))), 2 * k : 2 * k + 2
            ]
            fresh.append(nan if stamp == self._seen_us[aid] else float(value))
            self._seen_us[aid] = float(stamp)
        return fresh
