"""Noise of the sensors as noise of the adhesion: what of a residual may be called noise.

What no effect and no channel explains is not noise for that reason. The readings themselves say how
much noise the sensors have, from differences that the motion does not reach, and the curve says how
much of it reaches the adhesion. A floor that is far above it hides a mechanism.
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
STD_ERRORS = 3.0
"""Standard errors of the sensors' noise that are allowed for."""


@dataclass(frozen=True, slots=True)
class NoiseComparison:
    """Noise floor beside the noise that the sensors explain, adhesion.

    Attributes:
        floor: RMSE of the adhesion with the selected effects and a spline in every channel.
        sensors: RMS of the adhesion's noise by the sensors; None where the readings do not tell it.
        std_error: Standard error of `sensors`, relative to it.

    """

    floor: float
    sensors: float | None
    std_error: float = 0.0

    @property
    def ratio(self) -> float | None:
        """Floor over the sensors' noise; None where that is not known."""
        return None if not self.sensors else self.floor / self.sensors

    @property
    def is_exceeded(self) -> bool:
        """Whether the floor is above what the sensors explain."""
        return self.is_below(self.floor)

    def is_below(self, rmse: float) -> bool:
        """Whether an error of the adhesion is above the sensors' noise for certain."""
        if not self.sensors:
            return False
        return rmse > MOST_RATIO * (1.0 + STD_ERRORS * self.std_error) * self.sensors


def compare_with_sensors(
    regression: WhitenedRegression, model: Model, floor: float
) -> NoiseComparison:
    """The noise floor of a model beside the sensors' noise.

    Args:
        regression: Rows of all drives.
        model: Fitted model, at whose curves the errors of the slip are taken.
        floor: RMSE of the adhesion that no model goes below.

    """
    data = regression.data
    evaluation = regression.evaluate_corrected(model)
    slope = model.curves.slope(evaluation.slip, data.surface, evaluation.conditions)
    sensitivity = np.asarray(np.abs(slope * evaluation.factor))
    ends = np.cumsum([len(drive) for drive in data.drives])[:-1]
    variances, errors = [], []
    for drive, steepness in zip(data.drives, np.split(sensitivity, ends), strict=True):
        found = _variance_of_drive(drive, steepness)
        if found is None:
            return NoiseComparison(floor, None)
        variance, error = found
        variances.append(variance)
        errors.append(error)
    rows = regression.used
    square = float(np.mean(np.concatenate(variances)[rows])) if rows.any() else 0.0
    return NoiseComparison(floor, float(np.sqrt(square)), max(errors, default=0.0))


def _variance_of_drive(drive: DriveData, steepness: Array) -> tuple[Array, float] | None:
    """Variance of each row's adhesion by the sensors, and the relative error of its root.

    None where the readings do not tell the noise, or show errors that last for longer than seen.
    """
    if drive.independent:
        return None
    observed = drive.observe()
    if isinstance(drive.kinematics, SignalKinematics):
        effort = drive.kinematics.effort_noise
        if not _is_bounded(effort):
            return None
        speed = drive.speed_error.std * (1.0 + observed.slip) / observed.speed
        by_slip = steepness**2 * (drive.wheel_slip_std**2 + speed**2)
        return (effort.std or 0.0) ** 2 / observed.load**2 + by_slip, _relative_error(effort)
    adhesion, slip = (
        _estimate_column(drive, column) for column in (observed.adhesion, observed.slip)
    )
    if not _is_bounded(adhesion):
        return None
    # The adhesion of a table may have its noise from the slip as well, or from the force alone.
    slip_std = slip.std if _is_bounded(slip) and slip.std is not None else 0.0
    variance = (adhesion.std or 0.0) ** 2 + (steepness * slip_std) ** 2
    return variance, _relative_error(adhesion)


def _is_bounded(noise: NoiseEstimate) -> bool:
    """Whether a noise estimate holds all of the noise: errors were seen to end."""
    if noise.std is None or noise.lasts_s is None:
        return False
    return noise.lasts_s == 0.0 or noise.lasts_s < noise.seen_s


def _relative_error(noise: NoiseEstimate) -> float:
    return noise.std_error / noise.std if noise.std else 0.0


def _estimate_column(drive: DriveData, column: Array) -> NoiseEstimate:
    """Noise of a column of a sample table, of all axles together."""
    parts = []
    for axle in np.unique(drive.axle):
        rows = drive.axle == axle
        stamps = np.rint(1e6 * drive.t_s[rows]).astype(np.int64)
        parts.append(estimate_signal(Trace(stamps, column[rows])))
    return pool(parts)
