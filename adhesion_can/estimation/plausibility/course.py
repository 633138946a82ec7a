"""Course of signals over the latest cycles, and how far they leave it.

A signal that moves as it did before is a straight line over a window of cycles. `deviations` gives
the mean of the latest cycles less what that line says of them: the second difference of means, in
the signal's own unit. A step shows as its size, a change of the rate by a as a·T/2 after a time T.
"""

from collections.abc import Sequence

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.values import Stateful

COURSE = 125
"""Number of cycles of the course of the vehicle speed."""
MEMORY = 3000.0
"""Number of cycles over which the drive's own deviations from its course are averaged."""


class Course(Stateful):
    """The latest values of some signals, one row a cycle.

    Args:
        length: Number of cycles that are kept.
        width: Number of signals.

    """

    def __init__(self, length: int, width: int) -> None:
        self._length = length
        # Each row twice, a length apart, so that the latest ones always are one piece.
        self._rows: Array = np.zeros((2 * length, width))
        self._place = 0
        self.count = 0
        """Number of rows, `length` at most."""

    @property
    def is_full(self) -> bool:
        """Whether as many rows as are kept have come."""
        return self.count == self._length

    def clear(self) -> None:
        """Forget all rows."""
        self.count = 0

    def add(self, row: Sequence[float] | Array) -> None:
        """Add the row of a cycle; shape (width,)."""
        self._rows[self._place] = self._rows[self._place + self._length] = row
        self._place = (self._place + 1) % self._length
        self.count = min(self.count + 1, self._length)

    @property
    def rows(self) -> Array:
        """All rows that are kept, the oldest first; shape (length, width)."""
        return self._rows[self._place : self._place + self._length]


def extrapolation(length: int, windows: Sequence[tuple[int, int]]) -> Array:
    """Weights of the rows of a course for the deviations; shape (windows, length).

    Args:
        length: Number of rows of the course.
        windows: Number of cycles on which the line rests, and number of those after them.

    """
    weights = np.zeros((len(windows), length))
    for row, (before, after) in zip(weights, windows, strict=True):
        t = np.arange(before) - (before - 1) / 2
        ahead = (before + after) / 2
        row[length - after :] = 1.0 / after
        row[length - after - before : length - after] = -(1.0 / before + ahead * t / (t @ t))
    return weights
