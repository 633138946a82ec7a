"""What the filter states about speed and slip after a block."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.objection import Objection
from adhesion_can.values import Value


@dataclass(frozen=True, slots=True)
class ObservedSpeed(Value):
    """Speed and slips of drives that run side by side.

    Attributes:
        speed: Vehicle speed, m/s, shape (drives,).
        white_variance: Variance of the speed that is independent from block to block, m²/s².
        slow_variance: Variance of the speed that lasts for seconds and longer, m²/s².
        slip: Slip ratio of each axle, 1, shape (drives, axles).
        slip_std: Standard deviation of each slip, 1, shape (drives, axles).
        overall_std: Root mean square of `slip_std` over the axles that pull, 1, shape (drives,).
        radius_factor: True over nominal radius of each wheel, 1, shape (drives, axles).
        since_relief_s: Time since an axle was last free, s; infinite: never. Shape (drives,).
        known: Whether the slip is known, shape (drives,).
        relief_wanted: Whether a relief is needed now, shape (drives,).
        reasons: Why the slip of each drive is not known; none where it is.

    """

    speed: Array
    white_variance: Array
    slow_variance: Array
    slip: Array
    slip_std: Array
    overall_std: Array
    radius_factor: Array
    since_relief_s: Array
    known: NDArray[np.bool_]
    relief_wanted: NDArray[np.bool_]
    reasons: tuple[Objection, ...]
