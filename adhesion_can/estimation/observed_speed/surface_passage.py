"""Whether axles that deviate from the others are on another surface, or one is on an excursion."""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.observed_speed.layout import LOWEST_SPEED
from adhesion_can.values import Stateful

MARGIN_S, LONGEST_S = 0.3, 2.0
"""Time beyond the passage of all axles in which they count together, and the longest time, s."""


class SurfacePassage(Stateful):
    """Counts the axles that deviate one after the other.

    A change of the surface passes under all axles. An axle that deviates alone spins, or a
    controller has brought it over the peak: the others still carry the speed.

    Args:
        drives: Number of drives.
        axles: Number of axles.
        length: Distance of the last axle behind the first one, m.

    """

    def __init__(self, drives: int, axles: int, length: float) -> None:
        self._length = length
        self._since_s = np.full((drives, axles), np.inf)

    def update(self, deviates: NDArray[np.bool_], speed: Array, dt: float) -> NDArray[np.bool_]:
        """Axles under which the surface has changed, shape (drives, axles).

        Args:
            deviates: Whether each axle deviates from all others in this block, of the same shape.
            speed: Vehicle speed, m/s, shape (drives,).
            dt: Time since the last block, s.

        """
        self._since_s = np.where(deviates, 0.0, self._since_s + dt)
        passage_s = self._length / np.maximum(speed, LOWEST_SPEED) + MARGIN_S
        recent = self._since_s <= np.minimum(passage_s, LONGEST_S)[:, None]
        together = recent.sum(axis=1) >= min(2, deviates.shape[1])
        return np.asarray(deviates & together[:, None])
