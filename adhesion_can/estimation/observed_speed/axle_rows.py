"""Rows of all axles at one moment, from samples that come axle by axle."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Stateful


@dataclass(frozen=True, slots=True)
class SampleRow:
    """Samples of all axles within a cycle of the wheel speeds.

    Attributes:
        t_us: Mean of their stamps, µs.
        rim: Speed of each rim, m/s, shape (axles,).
        adhesion: Adhesion of each axle, 1, shape (axles,).
        load: Load of each axle, N, shape (axles,).

    """

    t_us: float
    rim: Array
    adhesion: Array
    load: Array


class AxleRows(Stateful):
    """Pairs the samples of the axles by their stamps.

    Args:
        axles: Number of axles.
        cycle_us: Cycle of the wheel speeds, µs.

    """

    def __init__(self, axles: int, cycle_us: int) -> None:
        self._cycle_us = cycle_us
        self._waiting: list[deque[tuple[int, float, float, float]]] = [
            deque() for _ in range(axles)
        ]

    def add(self, samples: Samples) -> list[SampleRow]:
        """Add samples in the order of their stamps; returns the rows that are complete by now."""
        rim = samples.speed * (1.0 + samples.slip)
        columns = (samples.t_us, rim, samples.adhesion, samples.load)
        of_axle = zip(*(column.tolist() for column in columns), strict=True)
        for axle, one in zip(samples.axle.tolist(), of_axle, strict=True):
            self._waiting[axle - 1].append(one)
        rows = []
        while all(self._waiting):
            latest_us = max(queue[0][0] for queue in self._waiting)
            old = [queue for queue in self._waiting if latest_us - queue[0][0] >= self._cycle_us]
            if old:
                # The others have lost the sample that belongs to these.
                for queue in old:
                    queue.popleft()
                continue
            found = np.array([queue.popleft() for queue in self._waiting])
            rows.append(SampleRow(float(found[:, 0].mean()), *found[:, 1:].T.copy()))
        return rows
