"""What a planned drive is predicted with: vehicle, train, sensors and noise of the longest drive.

The longest, by its rows, shows most of loads and resistance; the last one may have been a short one
that was made to decide.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.kinematics import SignalKinematics, SpeedError
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel, WhitenedRegression
from adhesion_can.physics.vehicle import Locomotive

LARGEST_SLOPE = 0.2
"""Largest decrease of the acceleration per m/s of speed, 1/s."""
LEAST_SPEED_RANGE = 0.5
"""Range of the speed, m/s, from which a drive shows how the acceleration depends on it."""
BIN_S = 1.0
"""Time over which efforts and speeds are averaged for the train's acceleration, s."""


@dataclass(frozen=True, slots=True)
class TrainResistance:
    """Acceleration of the train without effort: offset + slope · speed.

    Attributes:
        mass: Mass of locomotive and train, kg.
        offset: Acceleration at speed 0, m/s².
        slope: Change of the acceleration with the speed, 1/s; not above 0.
        is_known: Whether the drive shows it; else offset and slope are 0 for want of better.

    """

    mass: float
    offset: float
    slope: float
    is_known: bool = True


@dataclass(frozen=True, eq=False)
class DriveSetting:
    """Vehicle, train, sensors and noise.

    Attributes:
        vehicle: Configured vehicle.
        load: Mean load of each axle, N; shape (axles,).
        resistance: Acceleration of the train without effort.
        speed: Median speed of the longest drive, m/s.
        covariates: Mean of each further channel.
        wheel_std: Standard deviation of the rims' measured speeds, m/s.
        speed_error: Error of the vehicle speed that all axles share.
        noise: Standard deviation of an adhesion in a row where the curve is flat, with the memory
            of the noise taken into account.
        cycle_s: Time between two rows of an axle, s.
        block_length_s: Length of a block, s.

    """

    vehicle: Locomotive
    load: Array
    resistance: TrainResistance
    speed: float
    covariates: Mapping[str, float]
    wheel_std: float
    speed_error: SpeedError
    noise: float
    cycle_s: float
    block_length_s: float

    @property
    def assumption(self) -> str:
        """What is assumed since the drive does not show it, a sentence; '' for nothing."""
        if self.resistance.is_known:
            return ""
        return (
            "The resistance of the train is set to 0, because no three consecutive seconds of "
            "the drive have all axles; on grades, speeds will differ from the plan."
        )


def build_drive_setting(
    regression: WhitenedRegression, fitted: FittedModel, block_length_s: float
) -> DriveSetting | None:
    """Setting of a drive like those that were diagnosed; None where these are sample tables.

    Args:
        regression: Data with weights and filter.
        fitted: Best model's fit to them.
        block_length_s: Length of a block, s.

    """
    drives = [d for d in regression.data.drives if isinstance(d.kinematics, SignalKinematics)]
    drive = max(drives, key=len, default=None)
    if drive is None or not len(drive):
        return None
    kinematics = drive.kinematics
    assert isinstance(kinematics, SignalKinematics)  # noqa: S101  chosen above
    vehicle, observed = kinematics.vehicle, drive.observe()
    load = np.array(vehicle.axle_load, dtype=np.float64)
    for axle in np.unique(drive.axle):
        load[axle - 1] = float(observed.load[drive.axle == axle].mean())
    step = np.diff(drive.t_s)
    return DriveSetting(
        vehicle=vehicle,
        load=load,
        resistance=_fit_resistance(drive, observed.speed, vehicle),
        speed=float(np.median(observed.speed)),
        covariates={name: float(np.mean(x)) for name, x in drive.covariates.items()},
        wheel_std=float(np.median(kinematics(0.0, 0.0).wheel_std)),
        speed_error=kinematics.speed_error,
        noise=_find_noise(regression, fitted),
        cycle_s=float(np.median(step[(step > 0.0) & (np.diff(drive.axle) == 0)])),
        block_length_s=block_length_s,
    )


def _find_noise(regression: WhitenedRegression, fitted: FittedModel) -> float:
    """Noise of a row's adhesion where the curve is flat, as one without memory shows as much.

    A signal that changes slowly passes the whitening filter with the sum of its coefficients.
    """
    used = regression.used
    share = regression.slip_variance_share[used]
    flat = float(np.median(1.0 / (regression.scale[used] * np.sqrt(1.0 / (1.0 - share)))))
    white = fitted.grams.square / max(float(fitted.grams.rows.sum()), 1.0)
    weight = float(np.median(regression.weight[used]))
    passes = max(abs(float(regression.whitener.taps.sum())), 1e-3)
    return float(flat * np.sqrt(white) / weight / passes)


def _fit_resistance(drive: DriveData, speed: Array, vehicle: Locomotive) -> TrainResistance:
    """Acceleration without effort from the balance of the train, second by second.

    It needs a second with one before and one after it, in all of which every axle has rows.
    """
    second = np.floor(drive.t_s / BIN_S).astype(np.int64)
    count = int(second.max()) + 1
    force, axles = np.zeros(count), np.zeros(count)
    for axle in np.unique(drive.axle):
        rows = drive.axle == axle
        number = np.bincount(second[rows], minlength=count)
        force += np.bincount(second[rows], drive.effort[rows], count) / np.maximum(number, 1)
        axles += number > 0
    mean = np.bincount(second, speed, count) / np.maximum(np.bincount(second, minlength=count), 1)
    whole = axles == vehicle.axles
    inner = np.flatnonzero(whole[2:] & whole[1:-1] & whole[:-2]) + 1
    mass = vehicle.train_mass
    if not len(inner):
        return TrainResistance(mass, 0.0, 0.0, is_known=False)
    rest = (mean[inner + 1] - mean[inner - 1]) / (2.0 * BIN_S) - force[inner] / mass
    slope = 0.0
    v = mean[inner]
    if np.ptp(v) > LEAST_SPEED_RANGE:
        slope = float(np.clip(np.polyfit(v, rest, 1)[0], -LARGEST_SLOPE, 0.0))
    return TrainResistance(mass, float(rest.mean() - slope * v.mean()), slope)


def describe_setting(drives: Sequence[DriveData]) -> str:
    """Why drives give no setting."""
    names = ", ".join(drive.name for drive in drives)
    return f"{names}: a sample table has no wheel and vehicle speeds for planning a drive"
