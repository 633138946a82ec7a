"""Noise of the sensors as noise of the adhesion: what of a residual may be called noise.

What no effect and no channel explains is not noise for that reason. The readings themselves say how
much noise the sensors have, from differences that the motion does not reach, and the curve says how
much of it reaches the adhesion. Of a sample table, whose columns hold noise and motion together,
the residual takes the place of the readings: what changes in it as smoothly as motion does is no
noise. A floor that is far above the sensors' noise hides a mechanism.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.kinematics import SignalKinematics
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression
from adhesion_can.sampling.noise import NoiseEstimate, estimate_signal, pool
from adhesion_can.sampling.traces import Trace

MOST_RATIO = 1.15
"""Ratio of an error and the sensors' noise from which the error is not called noise. In 35 of 40
simulated drives without a mechanism it was 0.98 to 1.05; beyond that were vehicle speeds with an
error of 0.04 m/s that lasts, in which a slip is known to a multiple of the optimal one."""
TRIMMED, TRIMMED_NORMAL = 0.02, 0.9344
"""Share of the largest residuals that is left out, and the RMS of normal ones without them."""
WILD = 0.3
"""RMS without the largest residuals, relative to the whole, below which a few wild readings are the
error and have bent the fit: nothing follows for the others."""
LEAST_SHARE = 0.1
"""Least share of the rows that a group needs to be compared."""
STD_ERRORS = 3.0
"""Standard errors of the sensors' noise that are allowed for."""


@dataclass(frozen=True, slots=True)
class NoiseComparison:
    """Noise floor beside the noise that the sensors explain, adhesion.

    Both are weighted by the reciprocal of each row's variance by the sensors, so that the rows with
    the least noise say most. Rows with more noise from the slip than from the effort, and the
    others, are compared apart: the figures are those of the group that has more than it should.

    Attributes:
        floor: RMS of what the selected effects and a spline in every channel leave.
        sensors: RMS of the noise by the sensors; None where the readings do not show it.
        std_error: Standard error of `sensors`, relative to it.
        usual: Ratio of both without the largest residuals: a few wild readings are no mechanism.
        left: The same ratio for what the selected effects leave, without splines.

    """

    floor: float
    sensors: float | None
    std_error: float = 0.0
    usual: float = 0.0
    left: float = 0.0

    @property
    def ratio(self) -> float | None:
        """Floor over the sensors' noise; None where that is not known."""
        return None if not self.sensors else self.floor / self.sensors

    @property
    def is_exceeded(self) -> bool:
        """Whether the floor is above what the sensors explain for certain."""
        return self._is_above(self.usual)

    @property
    def leaves_more(self) -> bool:
        """Whether what the selected effects leave is above what the sensors explain for certain."""
        return self._is_above(self.left)

    def to_dict(self) -> dict[str, float | None]:
        """Fields of `diagnosis.json`."""
        return {"floor": self.floor, "sensors": self.sensors, "ratio": self.ratio}

    def _is_above(self, usual: float) -> bool:
        ratio = self.ratio
        if ratio is None or self.usual < WILD * ratio:
            return False
        return usual > MOST_RATIO * (1.0 + STD_ERRORS * self.std_error)


def trimmed_rms(residual: Array) -> float:
    """RMS without the largest residuals, scaled so that it is the RMS of normal ones."""
    size = np.sort(np.abs(residual))
    kept = size[: max(round((1.0 - TRIMMED) * len(size)), 1)]
    return float(np.sqrt(np.mean(kept**2)) / TRIMMED_NORMAL) if len(kept) else 0.0


def compare_with_sensors(
    regression: WhitenedRegression, model: Model, noise: Array
) -> NoiseComparison:
    """The noise floor of a model beside the sensors' noise.

    Args:
        regression: Rows of all drives.
        model: Fitted model, at whose curves the errors of the slip are taken.
        noise: What the model and a spline in every channel leave of the adhesion in the rows that
            are used; shape (m,).

    """
    unknown = NoiseComparison(float(np.sqrt(np.mean(noise**2))) if len(noise) else 0.0, None)
    row_variance = _estimate_variance(regression, model)
    if row_variance is None or not len(noise):
        return unknown
    left = regression.residual(model)[regression.used]
    groups = (row_variance.is_by_slip, ~row_variance.is_by_slip)
    compared = [
        _compare(noise[group], left[group], row_variance.variance[group], row_variance.std_error)
        for group in groups
        if group.any() and np.count_nonzero(group) >= LEAST_SHARE * len(group)
    ]
    return max(compared, key=lambda comparison: comparison.usual)


def compare_where_effort_is_noisy(regression: WhitenedRegression, model: Model) -> float | None:
    """What a model leaves over the sensors' noise, in rows whose noise is the effort's.

    An error of the slip is no part of it there, which no slope of a curve carries exactly.

    Args:
        regression: Rows of all drives.
        model: Fitted model.

    Returns:
        RMS without the largest residuals over that of the sensors' noise; None where the readings
        do not show it or where there are hardly such rows.

    """
    row_variance = _estimate_variance(regression, model)
    if row_variance is None or np.mean(~row_variance.is_by_slip) < LEAST_SHARE:
        return None
    left = regression.residual(model)[regression.used]
    return trimmed_rms((left / np.sqrt(row_variance.variance))[~row_variance.is_by_slip])


class _RowVariance(NamedTuple):
    """Variance of the used rows' adhesion by the sensors' noise.

    Attributes:
        variance: Variance of each row, shape (m,).
        is_by_slip: Whether most of it comes from the slip, shape (m,).
        std_error: Standard error of a standard deviation, relative to it.

    """

    variance: Array
    is_by_slip: NDArray[np.bool_]
    std_error: float


def _estimate_variance(regression: WhitenedRegression, model: Model) -> _RowVariance | None:
    """Variance by the sensors; None where the readings do not show it."""
    data = regression.data
    evaluation = regression.evaluate_corrected(model)
    slope = model.curves.slope(evaluation.slip, data.surface, evaluation.conditions)
    columns = np.stack([np.abs(slope * evaluation.factor), regression.residual(model)])
    parts = zip(data.drives, regression.speed_error_std, data.split(columns), strict=True)
    variances, errors = [], []
    for drive, speed_std, (steepness, residual) in parts:
        effort_noise = _estimate_residual(drive, residual) if drive.table else _effort_noise(drive)
        if drive.independent or not _is_bounded(effort_noise, is_residual=drive.table):
            return None
        variances.append(_variance_of_rows(drive, effort_noise, float(speed_std), steepness))
        errors.append(effort_noise.std_error / effort_noise.std if effort_noise.std else 0.0)
    by_effort, by_slip = np.concatenate(variances, axis=1)[:, regression.used]
    variance = by_effort + by_slip
    if not len(variance) or not (variance > 0.0).all():
        return None
    return _RowVariance(variance, by_slip > by_effort, max(errors, default=0.0))


def _compare(noise: Array, left: Array, variance: Array, std_error: float) -> NoiseComparison:
    """Errors of some rows beside the sensors' noise, shape (m,) each."""
    std = np.sqrt(variance)
    sensors = float(1.0 / np.sqrt(np.mean(1.0 / variance)))
    floor = sensors * float(np.sqrt(np.mean((noise / std) ** 2)))
    return NoiseComparison(
        floor, sensors, std_error, trimmed_rms(noise / std), trimmed_rms(left / std)
    )


def _variance_of_rows(
    drive: DriveData, noise: NoiseEstimate, speed_std: float, steepness: Array
) -> Array:
    """Variance of each row's adhesion by the noise of the effort and of the slip, shape (2, n).

    Args:
        drive: Rows of a recording or table.
        noise: Noise of the effort, N, or of a table's residual.
        speed_std: Standard deviation of the vehicle speed's error, m/s.
        steepness: Slope dμ/dλ of the curve in each row, shape (n,).

    """
    variance = (noise.std or 0.0) ** 2
    if drive.table:
        return np.stack([np.full(len(drive), variance), np.zeros(len(drive))])
    observed = drive.observe()
    by_speed = speed_std * (1.0 + observed.slip) / observed.speed
    by_slip = steepness**2 * (drive.wheel_slip_std**2 + by_speed**2)
    return np.stack([variance / observed.load**2, by_slip])


def _effort_noise(drive: DriveData) -> NoiseEstimate:
    kinematics = drive.kinematics
    return kinematics.effort_noise if isinstance(kinematics, SignalKinematics) else NoiseEstimate()


def _estimate_residual(drive: DriveData, residual: Array) -> NoiseEstimate:
    """Noise of the residual of a sample table, of all axles together."""
    parts = []
    for axle in np.unique(drive.axle):
        rows = drive.axle == axle
        stamps = np.rint(1e6 * drive.t_s[rows]).astype(np.int64)
        parts.append(estimate_signal(Trace(stamps, residual[rows])))
    return pool(parts)


def _is_bounded(noise: NoiseEstimate, *, is_residual: bool) -> bool:
    """Whether a noise estimate holds all of the noise: its errors were seen to end.

    In a residual nothing moves but mechanisms, so that motion hides no noise in it.
    """
    if noise.std is None:
        return False
    if noise.lasts_s is None:
        return is_residual
    return noise.lasts_s == 0.0 or noise.lasts_s < noise.seen_s
