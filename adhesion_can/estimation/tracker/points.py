"""Samples as points on one branch of the curve, and the rejection of single-axle outliers."""

from statistics import median

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.curve_sums import Points
from adhesion_can.estimation.tracker.layout import CERTAIN_STDS
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Stateful

TELLING = 8.0
"""Slip from which an update distinguishes surfaces, in standard deviations of its error."""
COASTING_S = 0.1
"""Time constant of the means by which an axle is coasting, s."""
COASTING_AGE_S = 0.5
"""Age of these means beyond which they say nothing, s."""
ADHESION_MAX = 5.0
"""Largest adhesion of a usable sample; larger ones are faults."""


def is_valid(samples: Samples, slip_max: float) -> NDArray[np.bool_]:
    """Whether a sample is within the model, shape (n,).

    Left out are samples that are not finite, slips beyond the model (wheel lock at −1, spin) and an
    impossible adhesion.
    """
    inside = (np.abs(samples.slip) <= slip_max) & (np.abs(samples.adhesion) <= ADHESION_MAX)
    further = samples.slip_total_var + samples.adhesion_var
    further += samples.transient_var
    further += samples.load_std
    return np.asarray(inside & np.isfinite(further))


def carries_information(
    slip: Array, adhesion: Array, slip_var: Array, adhesion_var: Array
) -> NDArray[np.bool_]:
    """Whether slip or adhesion exceeds its error by far, shape (n,).

    Where neither does, in coasting, a sample only shows that the curve starts at 0, which is known.
    """
    slips = slip * slip >= CERTAIN_SQUARE * slip_var
    return np.asarray(slips | (adhesion * adhesion > CERTAIN_SQUARE * adhesion_var))


def shows_surface(samples: Samples) -> bool:
    """Whether the slips of an update are sure enough to distinguish one surface from another.

    Where they are not, all that the samples show is the slope at zero, through errors that axles
    share and that a curve of another slope explains in part.
    """
    # Of numbers: NumPy's median costs more than all else here, for a handful of axles.
    squares: list[float] = (samples.slip * samples.slip).tolist()
    variances: list[float] = samples.slip_total_var.tolist()
    return median(squares) >= TELLING**2 * median(variances)


CERTAIN_SQUARE = CERTAIN_STDS * CERTAIN_STDS
"""Square of a value over its variance from which it exceeds its error by far."""
NEVER_US = -(1 << 60)
"""Stamp of an axle that had no sample yet, µs."""


class CoastingGate(Stateful):
    """Rejection of axles that coast.

    An axle is judged by its means over the last `COASTING_S`, without the samples in question.
    Selected by their own noise, those kept in light braking would all lie too high, and scatter
    less than the noise (selection bias; Heckman, Econometrica 47, 1979): another curve would fit
    them. Without recent means, samples are judged one by one.
    """

    def __init__(self) -> None:
        # By the number of the axle.
        self._latest_us = np.empty(0, dtype=np.int64)
        self._means: Array = np.empty((2, 0))

    def passes(self, samples: Samples) -> NDArray[np.bool_]:
        """Whether to use each sample, shape (n,).

        Args:
            samples: Samples of an update, at least one, finite.

        """
        axle = samples.axle
        stated = (samples.slip_var, samples.slip_common_var, samples.adhesion_var)
        if not any(map(np.count_nonzero, stated)):
            return np.ones(len(axle), dtype=np.bool_)
        missing = max(axle.tolist(), default=-1) + 1 - len(self._latest_us)
        if missing > 0:  # room for new axles, which have no means
            self._latest_us = np.concatenate([self._latest_us, np.full(missing, NEVER_US)])
            self._means = np.concatenate([self._means, np.zeros((2, missing))], axis=1)
        before_us = self._latest_us.copy()
        self._latest_us[axle] = samples.t_us
        age_s = (self._latest_us - before_us) * 1e-6
        known = (age_s >= 0.0) & (age_s <= COASTING_AGE_S)
        values = np.array([samples.slip, samples.adhesion])
        slip, adhesion = np.where(known[axle], self._means[:, axle], values)
        self._average(axle, values, np.where(known, -np.expm1(age_s / -COASTING_S), 1.0))
        return carries_information(slip, adhesion, samples.slip_total_var, samples.adhesion_var)

    def _average(self, axle: NDArray[np.int64], values: Array, gain: Array) -> None:
        """Move the means of the axles with samples towards those of their samples.

        Args:
            axle: Number of each sample's axle, shape (n,).
            values: Slip and adhesion of the samples, shape (2, n).
            gain: Share of the way, shape (axles,).

        """
        axles = len(gain)
        count = np.bincount(axle, minlength=axles)
        # One sample after the other, slips and adhesions at once.
        place = np.concatenate([axle, axle + axles])
        sums = np.bincount(place, values.ravel(), 2 * axles).reshape(2, axles)
        gain = np.where(count > 0, gain, 0.0)
        self._means += gain * (sums / np.maximum(count, 1) - self._means)


def build_points(samples: Samples, *, errors_in_variables: bool = True) -> Points:
    """Points on one branch from samples in traction and braking.

    A slip that is large against its own error has the sign of its branch. The sign of a smaller
    slip is noise, and folding at zero by it would bend the curve where it is steepest; the branch
    is then that of the adhesion, as `_signs_by_adhesion` says.

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
    unsure = slip * slip < CERTAIN_STDS * CERTAIN_STDS * (private + common)
    if unsure.any():
        sign[unsure] = _signs_by_adhesion(samples)[unsure]
    stamp = samples.speed_us
    group = np.zeros(len(sign), dtype=np.int64)
    np.cumsum(stamp[1:] != stamp[:-1], out=group[1:])
    further, share = samples.transient_var, samples.speed_share
    return Points(sign * slip, sign * adhesion, private, common, further, group, sign, share)


def _signs_by_adhesion(samples: Samples) -> Array:
    """Sign of the branch of each sample by the adhesion, shape (n,).

    An axle has the sign of its own mean adhesion where that is large against its stated error, as
    some axles may pull while others brake. The other axles have that of the mean of all axles, as
    they all pull or all brake; where the sure axles contradict each other, that of their own mean.
    """
    adhesion, var = samples.adhesion, samples.adhesion_var + samples.transient_var
    _, member = np.unique(samples.axle, return_inverse=True)
    whole = np.bincount(member, adhesion)
    error = np.bincount(member, var)
    sure = (error > 0.0) & (whole * whole > CERTAIN_STDS * CERTAIN_STDS * error)
    rest = adhesion
    if (whole[sure] > 0.0).any() and (whole[sure] < 0.0).any():
        rest = adhesion[~sure[member]]
    common = np.copysign(1.0, rest.mean()) if len(rest) else 1.0
    return np.asarray(np.where(sure, np.copysign(1.0, whole), common)[member])


class OutlierGate(Stateful):
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
        of_suspect = axle == suspect
        alone = len(np.unique(axle)) >= self.AXLES and bool((size[~of_suspect] < self.NEAR).all())
        self._times = self._times + 1 if suspect == self._suspect else 1
        self._suspect = suspect
        return ~of_suspect if alone and self._times <= self.PATIENCE else None
