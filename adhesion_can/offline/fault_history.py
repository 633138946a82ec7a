"""Frames over time: accepted, rejected and lost ones, in bins whose number is bounded."""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.bus.receiver_columns import ReceivedBlock

MOST_BINS = 2000
"""Number of bins beyond which they become twice as wide."""
KINDS = ("accepted", "rejected", "lost")
"""Rows of the counts."""


class FaultHistory:
    """Counts frames of the received messages over time."""

    def __init__(self) -> None:
        self.first_us: int | None = None
        self.width_us = 1_000_000
        self._counts = np.zeros((len(KINDS), 0), dtype=np.int64)

    def add(self, t_us: NDArray[np.int64], received: ReceivedBlock) -> None:
        """Add a block of frames.

        Args:
            t_us: Stamps of the frames, µs, not descending, shape (n,).
            received: What became of them.

        """
        if not len(t_us):
            return
        if self.first_us is None:
            self.first_us = int(t_us[0])
        while (int(t_us[-1]) - self.first_us) // self.width_us >= MOST_BINS:
            self.width_us *= 2
            odd = np.pad(self._counts, ((0, 0), (0, self._counts.shape[1] % 2)))
            self._counts = odd.reshape(len(KINDS), -1, 2).sum(axis=2)
        bins = (t_us - self.first_us) // self.width_us
        size = int(bins[-1]) + 1
        if size > self._counts.shape[1]:
            self._counts = np.pad(self._counts, ((0, 0), (0, size - self._counts.shape[1])))
        for kind, groups in enumerate((received.accepted, received.rejected)):
            for rows in groups:
                self._counts[kind] += np.bincount(bins[rows], minlength=self._counts.shape[1])
        for rows, lost in received.lost:
            np.add.at(self._counts[2], bins[rows], lost)

    @property
    def time_s(self) -> Array:
        """Middle of each bin since the first frame, s; shape (n,)."""
        return np.asarray(
            (np.arange(self._counts.shape[1], dtype=np.float64) + 0.5) * self.width_us / 1e6
        )

    def per_second(self, kind: str) -> Array:
        """Frames per second of one of `KINDS`; shape (n,)."""
        return np.asarray(self._counts[KINDS.index(kind)] / (self.width_us / 1e6))
