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
    size, force = np.abs(samples.slip), np.abs(samples.adhesion)
    slip_var = samples.slip_total_var
    further = samples.adhesion_var + samples.transient_var + samples.load_std
    usable = (size <= slip_max) & (force <= ADHESION_MAX) & np.isfinite(slip_var + further)
    small = size * size < SURE * SURE * slip_var
    if small.any():
        usable &= ~small | (force * force > SURE * SURE * samples.adhesion_var)
    return np.asarray(usable)


def build_points(samples: Samples, *, errors_in_variables: bool = True) -> Points:
    """Points on one branch from samples in traction and braking.

    A slip that is large against its own error carries the sign itself. One that is not takes it
    from the mean adhesion of all samples: folding it at zero by its own noise would make a small
    slip of what is none, and bend the curve where it is steepest.

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
    persists is used again.
    """

    FAR, NEAR, AXLES, PATIENCE = 8.0, 4.0, 3, 3

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
