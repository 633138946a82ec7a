"""What the filter states about speed and slip after a block."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

NEEDS = {
    "relief": "relieve one axle for a second",
    "radii": "relieve another axle for a second: the wheel radii are not known well enough",
    "effort": "the effort has changed since the last relief: relieve one axle for a second",
    "change": "the surface has changed: relieve one axle for a second",
}
"""What is missing for a known slip, by its reason."""


@dataclass(frozen=True, slots=True)
class ObservedSpeed:
    """Speed and slips of drives that run side by side.

    Attributes:
        speed: Vehicle speed, m/s, shape (drives,).
        white_variance: Variance of the speed that is independent from block to block, m²/s².
        slow_variance: Variance of the speed that lasts for seconds and longer, m²/s².
        slip: Slip ratio of each axle, 1, shape (drives, axles).
        slip_std: Standard deviation of each slip, 1, shape (drives, axles).
        radius_factor: True over nominal radius of each wheel, 1, shape (drives, axles).
        since_relief_s: Time since an axle was last free, s; infinite: never. Shape (drives,).
        known: Whether the slip is known, shape (drives,).
        relief_wanted: Whether a relief is needed now, shape (drives,).
        reasons: Key of `NEEDS` of each drive whose slip is not known, else an empty text.

    """

    speed: Array
    white_variance: Array
    slow_variance: Array
    slip: Array
    slip_std: Array
    radius_factor: Array
    since_relief_s: Array
    known: NDArray[np.bool_]
    relief_wanted: NDArray[np.bool_]
    reasons: tuple[str, ...]

    def missing(self, drive: int = 0) -> str:
        """What is missing for a known slip, in words; empty where nothing is."""
        reason = self.reasons[drive]
        return NEEDS[reason] if reason else ""
