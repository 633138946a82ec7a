"""Noise of the sensors as noise of the adhesion: what of a residual may be called noise.

What no effect and no channel explains is not noise for that reason. The readings themselves say how
much noise the sensors have, from differences that the motion does not reach, and the curve says how
much of it reaches the adhesion. Of a sample table, whose columns hold noise and motion together,
the residual takes the place of the readings: what changes in it as smoothly as motion does is no
noise. A floor that is far above the sensors' noise hides a mechanism.
"""

from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.kinematics import SignalKinematics
from adhesion_can.diagnosis.regression.model import Model
from adhesion_can.diagnosis.regression.whitened_regression import WhitenedRegression
from adhesion_can.sampling.noise import NoiseEstimate, estimate_signal, pool
from adhesion_can.sampling.traces import Trace

MOST_RATIO = 1.25
"""Ratio of an error and the sensors' noise from which the error is not called noise. In simulated
drives whose mechanism is in the model it was 0.97 to 1.01."""
TRIMMED, TRIMMED_NORMAL = 0.02, 0.9344
"""Share of the largest residuals that is left out, and the RMS of normal ones without them."""
WILD = 0.3
"""RMS without the largest residuals, relative to the whole, below which a few wild readings are the
error and have bent the fit: nothing follows for the others."""
STD_ERRORS = 3.0
"""Standard errors of the sensors' noise that are allowed for."""


@dataclass(frozen=True, slots=True)
class NoiseComparison:
    """Noise floor beside the noise that the sensors explain, adhesion.

    Attributes:
        floor: RMSE of the adhesion with the selected effects and a spline in every channel.
        usual: The same without the largest residuals: a few wild readings are no mechanism.
        sensors: RMS of the adhesion's noise by the sensors; None where the readings do not tell it.
        std_error: Standard error of `sensors`, relative to it.

    """

    floor: float
    usual: float
    sensors: float | None
    std_error: float = 0.0

    @property
    def ratio(self) -> float | None:
        """Floor over the sensors' noise; None where that is not known."""
        return None if not self.sensors else self.floor / self.sensors

    @property
    def is_exceeded(self) -> bool:
        """Whether the floor is above what the sensors explain."""
        return self.is_below(self.usual)

    def is_below(self, rmse: float) -> bool:
        """Whether an error of the adhesion is above the sensors' noise for certain."""
        if not self.sensors or self.usual < WILD * self.floor:
            return False
        return rmse > MOST_RATIO * (1.0 + STD_ERRORS * self.std_error) * self.sensors


def trimmed_rms(residual: Array) -> float:
    """RMS without the largest residuals, scaled so that it is the RMS of normal ones."""
    size = np.sort(np.abs(residual))
    kept = size[: max(round((1.0 - TRIMMED) * len(size)), 1)]
    return float(np.sqrt(np.mean(kept**2)) / TRIMMED_NORMAL) if len(kept) else 0.0


def compare_with_sensors(
    regression: WhitenedRegression, model: Model, floor: float, usual: float
) -> NoiseComparison:
    """The noise floor of a model beside the sensors' noise.

    Args:
        regression: Rows of all drives.
        model: Fitted model, at whose curves the errors of the slip are taken.
        floor: RMSE of the adhesion that no model goes below.
        usual: The same without the largest residuals.

    """
    data = regression.data
    evaluation = regression.evaluate_corrected(model)
    slope = model.curves.slope(evaluation.slip, data.surface, evaluation.conditions)
    columns = np.stack([np.abs(slope * evaluation.factor), regression.residual(model)])
    ends = np.cumsum([len(drive) for drive in data.drives])[:-1]
    variances, errors = [], []
    for drive, (steepness, residual) in zip(
        data.drives, np.split(columns, ends, axis=1), strict=True
    ):
        noise = _estimate_residual(drive, residual) if drive.table else _effort_noise(drive)
        if drive.independent or not _is_bounded(noise, is_residual=drive.table):
            return NoiseComparison(floor, usual, None)
        variances.append(_variance_of_rows(drive, noise, steepness))
        errors.append(noise.std_error / noise.std if noise.std else 0.0)
    rows = regression.used
    square = float(np.mean(np.concatenate(variances)[rows])) if rows.any() else 0.0
    return NoiseComparison(floor, usual, float(np.sqrt(square)), max(errors, default=0.0))


def _variance_of_rows(drive: DriveData, noise: NoiseEstimate, steepness: Array) -> Array:
    """Variance of each row's adhesion by the sensors, shape (n,).

    Args:
        drive: Rows of a recording or table.
        noise: Noise of the effort, N, or of a table's residual.
        steepness: Slope dμ/dλ of the curve in each row, shape (n,).

    """
    variance = (noise.std or 0.0) ** 2
    if drive.table:
        return np.full(len(drive), variance)
    observed = drive.observe()
    by_speed = drive.speed_error.std * (1.0 + observed.slip) / observed.speed
    by_slip = steepness**2 * (drive.wheel_slip_std**2 + by_speed**2)
    return np.asarray(variance / observed.load**2 + by_slip)


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
