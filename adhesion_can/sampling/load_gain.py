"""How far measured loads follow the transfer that the efforts make, learnt from the loads.

A load is read every 200 ms; within them a rising effort moves several percent of it to another
axle. Some load signals follow at once, some late (an air spring), some not at all (a scale). From
reading to reading the change of a load y is compared with the change of the computed transfer x:
y = g x + e by linear regression, g of mean 0 and variance 1 beforehand. Where nothing was learnt
the load stays as it was read, and the whole transfer is its standard deviation.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.values import Stateful

PRIOR_COUNT = 10.0
"""Readings that the error of a change is taken as known from beforehand."""
PRIOR_STD_SHARE = 0.01
"""Standard deviation of the error of a change beforehand, as a share of the static load."""


class Changes(NamedTuple):
    """Changes of measured loads between two readings of an axle, in the order of their stamps.

    Attributes:
        t_us: Stamp of the later reading, µs, shape (n,).
        transfer: Change of the load that the efforts make, N, shape (n,).
        load: Change of the measured load, N, shape (n,).

    """

    t_us: NDArray[np.int64]
    transfer: Array
    load: Array


class LoadGain(Stateful):
    """Gain of measured loads on the computed transfer, at any stamp since the oldest kept.

    Args:
        static_load: Mean static load of an axle, N.

    """

    def __init__(self, static_load: float) -> None:
        self._prior_var = (PRIOR_STD_SHARE * static_load) ** 2
        self._sums = np.zeros((7, 1))
        self._t_us = np.empty(0, dtype=np.int64)
        self._gain = np.zeros(1)
        self._var = np.ones(1)

    def learn(self, changes: Changes) -> None:
        """Learn from further changes; none is older than one that was learnt."""
        if not len(changes.t_us):
            return
        x, y = changes.transfer, changes.load
        powers = np.stack([np.ones_like(x), x * x, x * y, y * y, x**4, x**3 * y, x * x * y * y])
        # Sums one after another: the same for any division into blocks.
        sums = np.cumsum(np.concatenate([self._sums, powers], axis=1), axis=1)[:, 1:]
        self._sums = sums[:, -1:]
        gain, var = self._estimate(sums)
        self._t_us = np.concatenate([self._t_us, changes.t_us])
        self._gain = np.concatenate([self._gain, gain])
        self._var = np.concatenate([self._var, var])

    def _estimate(self, sums: Array) -> tuple[Array, Array]:
        """Gain, and variance of the share of a transfer that a load does not follow."""
        n, xx, xy, yy, x4, x3y, x2y2 = sums
        slope = xy / (xx + self._prior_var)
        square = np.maximum(yy - 2.0 * slope * xy + slope * slope * xx, 0.0)
        var = (PRIOR_COUNT * self._prior_var + square) / (PRIOR_COUNT + n)
        gain = xy / (xx + var)
        # Errors that grow with the transfer: the load follows late, or not always. `var` is the
        # mean of all squares, these included, whose share is taken off the sum of x⁴.
        weighted = x2y2 - 2.0 * gain * x3y + gain * gain * x4 - var * xx
        spread = x4 - xx * xx / (PRIOR_COUNT + n) + self._prior_var**2
        scatter = np.clip(weighted / spread, 0.0, 1.0)
        return gain, var / (xx + var) + scatter

    def at(self, t_us: NDArray[np.int64]) -> tuple[Array, Array]:
        """Gain and standard deviation of a load's transfer over the transfer, at stamps.

        Args:
            t_us: Stamps, µs, shape (n,).

        """
        place = np.searchsorted(self._t_us, t_us, side="right")
        return self._gain[place], np.sqrt(self._var[place])

    def forget_before(self, t_us: int) -> None:
        """Drop what no stamp at or after `t_us` needs."""
        keep = int(np.searchsorted(self._t_us, t_us, side="right"))
        self._t_us = self._t_us[keep:].copy()
        self._gain, self._var = self._gain[keep:].copy(), self._var[keep:].copy()
