"""One signal over time as columns, read at the stamps of another.

Between two readings a signal is a straight line; across a gap, beyond the ends and beside a reading
that is not available it is NaN.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array


@dataclass(frozen=True, slots=True)
class Trace:
    """Readings of one signal.

    Attributes:
        t_us: Time stamps, µs, strictly ascending, shape (n,).
        value: Values, SI, NaN where not available, shape (n,).

    """

    t_us: NDArray[np.int64]
    value: Array

    @classmethod
    def from_readings(cls, t_us: NDArray[np.int64], value: Array) -> "Trace":
        """Trace of readings in the order of stamps; of two with one stamp the later counts."""
        last = np.ones(len(t_us), dtype=np.bool_)
        last[:-1] = t_us[1:] > t_us[:-1]
        return cls(t_us[last], value[last])

    def at(self, t_us: NDArray[np.int64] | Array, gap_us: float) -> Array:
        """Values at other stamps by linear interpolation, shape as theirs.

        Args:
            t_us: Time stamps, µs, any shape.
            gap_us: Longest time between two readings that bracket a stamp, µs.

        """
        if not len(self.t_us):
            return np.full(np.shape(t_us), np.nan)
        following = np.searchsorted(self.t_us, t_us)
        exact = self.t_us[np.minimum(following, len(self.t_us) - 1)] == t_us
        after = np.clip(following, 1, max(len(self.t_us) - 1, 1))
        span = np.diff(self.t_us, append=self.t_us[-1])[after - 1]
        value = np.interp(t_us, self.t_us, self.value, left=np.nan, right=np.nan)
        return np.where((span <= gap_us) | exact, value, np.nan)

    def slope(self, t_us: NDArray[np.int64], window_us: float, gap_us: float) -> Array:
        """Mean rate of change over a window around each stamp, per s, shape as theirs."""
        late, early = (self.at(np.add(t_us, side * window_us / 2), gap_us) for side in (1, -1))
        return np.asarray((late - early) / (window_us * 1e-6))

    def mean(self, t_us: NDArray[np.int64], window_us: float, gap_us: float) -> Array:
        """Mean over a window around each stamp, shape as theirs; NaN where a part is missing."""
        late, early = (np.add(t_us, side * window_us / 2) for side in (1, -1))
        lost = self._lost(late, gap_us) - self._lost(early, gap_us)
        area = self._area(late, gap_us) - self._area(early, gap_us)
        return np.where(lost > 0, np.nan, area / window_us)

    def _area(self, t_us: Array, gap_us: float) -> Array:
        """Integral from the first reading to each stamp, missing parts left out."""
        if not len(self.t_us):
            return np.full(np.shape(t_us), np.nan)
        steps = np.diff(self.t_us).astype(np.float64)
        areas = steps * (self.value[1:] + self.value[:-1]) / 2
        total = np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(areas), areas, 0.0))])
        k = np.clip(np.searchsorted(self.t_us, t_us, side="right") - 1, 0, None)
        rest = (self.value[k] + self.at(t_us, gap_us)) / 2 * (t_us - self.t_us[k])
        return np.asarray(total[k] + rest)

    def _lost(self, t_us: Array, gap_us: float) -> Array:
        """Number of steps, from the first reading to each stamp, that are missing."""
        steps = np.diff(self.t_us)
        missing = ~np.isfinite(self.value[1:] + self.value[:-1]) | (steps > gap_us)
        total = np.concatenate([[0, 0], np.cumsum(missing)])
        return np.asarray(total[np.searchsorted(self.t_us, t_us, side="right")])
