"""Measured load of an axle at any time, from its plausible readings alone."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

LEAST_LOAD_SHARE = 0.1
"""Share of the static load below which a load is implausible."""


class MeasuredLoad(NamedTuple):
    """Load readings of one axle.

    Attributes:
        t_s: Stamps of the readings, s, ascending, shape (n,).
        value: Loads, N, shape (n,).
        is_plausible: Whether a reading is at least `LEAST_LOAD_SHARE` of the static load, shape
            (n,).

    """

    t_s: Array
    value: Array
    is_plausible: NDArray[np.bool_]

    @classmethod
    def constant(cls, t_s: Array, load: float) -> "MeasuredLoad":
        """A load, N, that stays the same over given stamps, s."""
        return cls(t_s, np.full(len(t_s), load), np.ones(len(t_s), dtype=np.bool_))

    def interpolate(self, t_s: Array) -> Array:
        """Loads at given times, N: across implausible readings, from those beside them.

        A delay that is tested reads the load at other times than a row's own. Such a time must not
        meet a load of 0, by which the adhesion is infinite. Where no reading is plausible, all are
        NaN.
        """
        good = self.is_plausible
        if not good.any():
            return np.full(len(t_s), np.nan)
        return np.interp(t_s, self.t_s[good], self.value[good])

    def is_known(self, t_s: Array) -> NDArray[np.bool_]:
        """Whether the readings beside a time are plausible, shape (n,)."""
        return np.asarray(np.interp(t_s, self.t_s, self.is_plausible) == 1.0)
