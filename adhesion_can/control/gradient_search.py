"""Search of the peak without any model: pairs of axles at two slips at once.

Of two neighbours one has a larger, one a smaller slip; after a dwell they change places. Their
adhesions at the same time show the elasticity d ln μ/d ln λ, whatever the rail does meanwhile, and
what makes the two axles differ cancels over two dwells. The median over the pairs bears an axle
whose rail is another one. A steepest-ascent search in the logarithm of the slip follows.
"""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.control.inputs import Measurement
from adhesion_can.control.mean_adhesion import MeanAdhesion
from adhesion_can.control.settings import SearchSettings

LEAST_DISTANCE = 0.1
"""Distance of a pair's slips in a dwell, logarithm, that shows an elasticity."""
SMALL, LARGE = 0.3, 0.6
"""Logarithms of wanted changes of the slip: the largest step shrinks below the one and grows above
the other."""
SHRINKS, GROWS = 0.7, 1.5
NEAR_STEPS = 1.5
"""Largest step over the smallest one below which the search is near the peak."""


class PairedGradientSearch:
    """Slips of all axles, and the elasticity at their mean.

    Args:
        settings: Distances, times and gains.
        mass: Inertia of a wheelset at its rim, J/r², kg, shape (axles,).

    """

    def __init__(self, settings: SearchSettings, mass: Array) -> None:
        self._settings = settings
        self._mean = MeanAdhesion(mass)
        self._upper = np.arange(len(mass)) % 2 == 0
        self._pairs = len(mass) // 2
        self._left_out = np.zeros(self._pairs, dtype=bool)
        self.begin(0.0, settings.slip_min, settings.step_max)

    def begin(self, time_s: float, slip: float, step_max: float) -> None:
        """Start again.

        Args:
            time_s: Time, s.
            slip: Mean slip ratio to start at.
            step_max: Largest step for now, logarithm.

        """
        self.slip = self._bounded(slip)
        """Mean slip ratio."""
        self.elasticity = 1.0
        """Elasticity d ln μ/d ln λ at the mean slip; 1 until it was measured."""
        self._since_s = time_s
        self._step_max = step_max
        self._before: tuple[Array, Array] | None = None
        self._mean.restart()

    @property
    def is_near(self) -> bool:
        """Whether the slip is near the peak: the largest step has shrunk."""
        return self._step_max < NEAR_STEPS * self._settings.step_min

    def step(self, measured: Measurement, slip: Array, *, busy_axle: int | None = None) -> Array:
        """Slip ratio that each axle is to have, shape (axles,).

        Args:
            measured: Measured state.
            slip: Measured slip ratio of each axle, shape (axles,).
            busy_axle: Number of an axle that does something else; its pair does not count.

        """
        if busy_axle is not None and busy_axle <= 2 * self._pairs:
            self._left_out[(busy_axle - 1) // 2] = True
        s = self._settings
        self._mean.add(measured, slip)
        if measured.time_s - self._since_s >= s.dwell_s:
            self._conclude()
            self._upper = ~self._upper
            self._since_s = measured.time_s
            self._mean.restart(measured)
            self._left_out[:] = False
        spread = s.near_spread if self.is_near else s.spread
        return np.asarray(self.slip * np.where(self._upper, 1.0 + spread, 1.0 - spread))

    def _conclude(self) -> None:
        """Take a step by what the dwell has shown."""
        sign = 1.0 if self._upper[0] else -1.0
        contrast = sign * self._contrast(self._mean.adhesion())
        distance = sign * self._contrast(self._mean.slip())
        contrast, distance = (
            np.where(self._left_out, np.nan, values) for values in (contrast, distance)
        )
        before, self._before = self._before, (contrast, distance)
        dwells = 1 if before is None else 2
        if before is not None:
            contrast, distance = contrast + before[0], distance + before[1]
        tells = distance > LEAST_DISTANCE * dwells
        if tells.sum() * 2 < self._pairs + 1:
            return
        s = self._settings
        self.elasticity = float(np.median(contrast[tells] / distance[tells]))
        wanted = s.gain * (self.elasticity - s.goal - s.slip_price * self.slip)
        step = min(max(wanted, -self._step_max), self._step_max)
        self.slip = self._bounded(self.slip * float(np.exp(step)))
        if abs(wanted) < SMALL:
            self._step_max = max(SHRINKS * self._step_max, s.step_min)
        elif abs(wanted) > LARGE:
            self._step_max = min(GROWS * self._step_max, s.step_max)

    def _contrast(self, values: Array) -> Array:
        """Logarithm of the ratio of a pair's values, shape (pairs,)."""
        ends = 2 * self._pairs
        return np.asarray(np.log(values[0:ends:2]) - np.log(values[1:ends:2]))

    def _bounded(self, slip: float) -> float:
        return min(max(slip, self._settings.slip_min), self._settings.slip_max)
