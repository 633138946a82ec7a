"""Samples as points on one branch of the curve, and the rejection of single-axle outliers."""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.curve_sums import SURE, Points
from adhesion_can.physics.samples import Samples

ADHESION_MAX = 5.0
"""Largest adhesion of a usable sample; larger ones are faults."""


def is_usable(samples: Samples, slip_max: float) -> NDArray[np.bool_]:
    """Whether a sample carries information on the curve, shape (n,).

    Left out are samples that are not finite, slips beyond the model (wheel lock at −1, spin), an
    impossible adhesion, and coasting: where neither slip nor adhesion exceeds its error a sample
    only shows that the curve begins at 0, which is known.
    """
    slip_size, adhesion_size = np.abs(samples.slip), np.abs(samples.adhesion)
    slip_var = samples.slip_total_var
    further = samples.adhesion_var + samples.transient_var + samples.load_std
    usable = (
        (slip_size <= slip_max) & (adhesion_size <= ADHESION_MAX) & np.isfinite(slip_var + further)
    )
    small = slip_size * slip_size < SURE * SURE * slip_var
    if small.any():
        adhesion_var = samples.adhesion_var
        usable &= ~small | (adhesion_size * adhesion_size > SURE * SURE * adhesion_var)
    return np.asarray(usable)


def build_points(samples: Samples, *, errors_in_variables: bool = True) -> Points:
    """Points on one branch from samples in traction and braking.

    A slip that is large against its own error has the sign of its branch. The sign of a smaller
    slip is noise, and folding at zero by it would bend the curve where it is steepest; the branch
    is then that of the mean adhesion of all samples.

    Args:
        samples: Samples, at least one, finite.
        errors_in_variables: Whether the slips have errors; False takes them as exact.

    """
    slip, adhesion = samples.slip, samples.adhesion
    if not errors_in_variables:
        h, z = samples.folded()
        zero, one_group = np.zeros(len(h)), np.zeros(len(h), dtype=np.int64)
        sign = np.copysign(1.0, slip)
        return Points(h, z, zero, zero, samples.transient_var, one_group, sign)
    private, common = samples.slip_var, samples.slip_common_var
    sign = np.copysign(1.0, slip)
    unsure = slip * slip < SURE * SURE * (private + common)
    if unsure.any():
        sign[unsure] = np.copysign(1.0, adhesion.mean())
    # A group shares the error of its vehicle speed; on the other branch that has the other sign.
    stamp = samples.speed_us
    group = np.zeros(len(sign), dtype=np.int64)
    np.cumsum((stamp[1:] != stamp[:-1]) | (sign[1:] != sign[:-1]), out=group[1:])
    further = samples.transient_var
    return Points(sign * slip, sign * adhesion, private, common, further, group, sign)


class OutlierGate:
    """Rejection of an axle that alone contradicts all others, for a few updates.

    A surface changes under all axles within a train's length; a sensor fails on one. An axle that
    persists in its contradiction is used again.
    """

    FAR, NEAR = 8.0, 4.0
    """Residual that an outlier exceeds, and all other axles stay below, in standard deviations."""
    AXLES, PATIENCE = 3, 3
    """Least number of axles for a rejection, and largest number of updates of it in sequence."""

    def __init__(self) -> None:
        self._suspect = 0
        self._times = 0

    def passes(self, size: Array, axle: NDArray[np.int64]) -> NDArray[np.bool_] | None:
        """Whether to use each sample, shape (n,); None for all.

        Args:
            size: Absolute residuals in standard deviations, shape (n,).
            axle: Number of each sample's axle, shape (n,).

        """
        if not size.max() > self.FAR:
            self._times = 0
            return None
        suspect = int(axle[np.argmax(size)])
        own = axle == suspect
        alone = len(np.unique(axle)) >= self.AXLES and bool((size[~own] < self.NEAR).all())
        self._times = self._times + 1 if suspect == self._suspect else 1
        self._suspect = suspect
        return ~own if alone and self._times <= self.PATIENCE else None
