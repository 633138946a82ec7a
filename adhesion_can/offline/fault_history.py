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
        self._last_us = 0
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
        self._last_us = int(t_us[-1])
        bins = (t_us - self.first_us) // self.width_us
        size = int(bins[-1]) + 1
        if size > self._counts.shape[1]:
            self._counts = np.pad(self._counts, ((0, 0), (0, size - self._counts.shape[1])))
        for kind, groups in enumerate((received.accepted, received.rejected)):
            for rows in groups:
                self._counts[kind] += np.bincount(bins[rows], minlength=self._counts.shape[1])
        for rows, lost in received.lost:
            np.add.at(self._counts[2], bins[rows], lost)

    def rates(self) -> tuple[Array, dict[str, Array]]:
        """Middle of each bin since the first frame, s, and frames per second by kind; shape (n,).

        A last bin that is less than half full belongs to the one before it.
        """
        counts, size = self._counts, self._counts.shape[1]
        edges = np.arange(size + 1, dtype=np.float64) * self.width_us
        edges[-1] = self._last_us - (self.first_us or 0)
        if size > 1 and edges[-1] - edges[-2] < self.width_us / 2:
            edges = np.delete(edges, -2)
            counts = np.column_stack([counts[:, :-2], counts[:, -2:].sum(axis=1)])
        length_s = np.maximum(np.diff(edges) / 1e6, 1e-3)
        rates = {kind: row / length_s for kind, row in zip(KINDS, counts, strict=True)}
        return (edges[1:] + edges[:-1]) / 2e6, rates

    def total(self, kind: str) -> int:
        """Number of frames of one of `KINDS`."""
        return int(self._counts[KINDS.index(kind)].sum())
