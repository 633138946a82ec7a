"""Prediction of what a planned drive measures if an explanation holds.

The controller brings the measured slips to those of the plan. So speeds and slips of the drive are
known but for the train's acceleration, which the curve gives quasi-statically; the efforts are what
the explanation leaves no residual of.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.kinematics import SignalKinematics, SmoothedSignals
from adhesion_can.diagnosis.drive.measured_load import MeasuredLoad
from adhesion_can.diagnosis.drive.smoothing import SmoothedSignal
from adhesion_can.diagnosis.next_drive.drive_setting import DriveSetting
from adhesion_can.diagnosis.next_drive.explanations import Explanation
from adhesion_can.diagnosis.regression.model import Model, RegressionData, evaluate_model
from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.curves import Conditions
from adhesion_can.physics.driving_plan import PlanStep
from adhesion_can.physics.readings import Role

STEP_S = 0.02
"""Step of the predicted signals, s."""
SMOOTH_S = 0.4
"""Time over which the axles follow a jump of the wanted slip, s."""
SETTLE_S = 0.8
"""Time after the start of a step whose rows do not count, s: how the axles get to the slips of the
step is the controller's matter."""
AHEAD_S = SMOOTH_S / 2
"""The same before its end, s: there the smoothed slips already go over to those of the next step,
which no controller knows beforehand."""
ITERATIONS, LEAST_RESIDUAL = 10, 1e-7
"""Most repetitions of the efforts, which effects of the slip work and errors of the vehicle speed
with the effort depend on, and the adhesion that may be left of them."""
SLOWEST = 1.0
"""Lowest predicted speed, m/s."""


@dataclass(frozen=True, slots=True)
class DriveStart:
    """State at which steps start.

    Attributes:
        time_s: Time since the drive's start, s.
        speed: Vehicle speed, m/s.

    """

    time_s: float
    speed: float


@dataclass(frozen=True, eq=False)
class PlannedDrive:
    """A predicted drive.

    Attributes:
        data: Rows of the drive, one surface.
        step: Number of each row's step, shape (n,).
        end: State after the last step.
        effort_max: Largest effort of an axle, N.
        speeds: Lowest and highest speed, m/s.

    """

    data: RegressionData
    step: NDArray[np.int64]
    end: DriveStart
    effort_max: float
    speeds: tuple[float, float]


def predict_drive(
    steps: Sequence[PlanStep], start: DriveStart, setting: DriveSetting, explanation: Explanation
) -> PlannedDrive:
    """What steps measure if an explanation holds.

    Args:
        steps: Steps one after another.
        start: State at their start.
        setting: Vehicle, train, sensors and noise.
        explanation: Explanation that holds.

    """
    grid, number, slip, sand = _sample_steps(steps, setting.vehicle.axles)
    speed = _integrate_speed(slip, start.speed, setting, explanation.model)
    time_s = start.time_s + grid
    since_s = grid - grid[np.searchsorted(number, number)]
    left_s = grid[np.searchsorted(number, number, side="right") - 1] - grid
    counts = (since_s >= SETTLE_S) & (left_s >= AHEAD_S)
    drive, rows = _build_drive(time_s, counts, slip, speed, sand, setting)
    data = RegressionData((drive,), np.zeros(len(drive), dtype=np.int64), 1)
    data = _with_efforts(data, explanation.model)
    load = setting.load[drive.axle - 1]
    effort = np.abs(data.drives[0].observe().adhesion * load)
    end = DriveStart(float(start.time_s + grid[-1] + STEP_S), float(speed[-1]))
    return PlannedDrive(
        data,
        np.tile(number[rows], setting.vehicle.axles),
        end,
        float(effort.max(initial=0.0)),
        (float(speed.min()), float(speed.max())),
    )


def _sample_steps(
    steps: Sequence[PlanStep], axles: int
) -> tuple[Array, NDArray[np.int64], Array, Array]:
    """Times, s, step numbers, slips (n, axles) and sand of the steps at a grid of times."""
    counts = [max(round(step.duration_s / STEP_S), 2) for step in steps]
    number = np.repeat(np.arange(len(steps), dtype=np.int64), counts)
    slip = np.concatenate(
        [
            np.nan_to_num(step.slips(np.arange(count, dtype=np.float64) * STEP_S, axles))
            for step, count in zip(steps, counts, strict=True)
        ]
    )
    # A jump of the wanted slip takes the wheels a moment.
    width = max(round(SMOOTH_S / STEP_S), 1)
    slip = scipy.ndimage.uniform_filter1d(slip, width, axis=0, mode="nearest")
    sand = np.repeat([float(step.sand) for step in steps], counts)
    grid: Array = np.arange(len(number), dtype=np.float64) * STEP_S
    return grid, number, slip, sand


def _integrate_speed(slip: Array, begin: float, setting: DriveSetting, model: Model) -> Array:
    """Vehicle speed, m/s, shape (n,): the curve's force at the slips, and the train's resistance.

    Args:
        slip: Slip ratios, shape (n, axles).
        begin: Speed at the start, m/s.
        setting: Vehicle and train.
        model: Model whose curve gives the force.

    """
    conditions = Conditions(np.full(slip.size, begin), np.tile(setting.load, len(slip)))
    surface = np.zeros(slip.size, dtype=np.int64)
    adhesion = model.curves.adhesion(slip.ravel(), surface, conditions).reshape(slip.shape)
    train = setting.resistance
    push = (adhesion @ setting.load) / train.mass + train.offset
    speed = np.empty(len(slip))
    v = begin
    for place, acceleration in enumerate(push.tolist()):
        speed[place] = v
        v = max(v + STEP_S * (acceleration + train.slope * v), SLOWEST)
    return speed


def _build_drive(
    time_s: Array,
    counts: NDArray[np.bool_],
    slip: Array,
    speed: Array,
    sand: Array,
    setting: DriveSetting,
) -> tuple[DriveData, NDArray[np.int64]]:
    """Rows of the drive without efforts, and the grid places at which they stand.

    Args:
        time_s: Times of the grid, s, shape (n,).
        counts: Whether a row at that time counts, shape (n,).
        slip: Slip ratios, shape (n, axles).
        speed: Vehicle speed, m/s, shape (n,).
        sand: Whether sand is strewn, 0 or 1, shape (n,).
        setting: Vehicle, train, sensors and noise.

    """
    vehicle, axles = setting.vehicle, setting.vehicle.axles
    radius = np.array(vehicle.wheel_radius)
    none = np.empty((0, 2))

    def smooth(value: Array, std: float) -> SmoothedSignal:
        return SmoothedSignal(time_s, value, np.gradient(value, STEP_S), std, none)

    wheels = {
        axle: smooth(speed * (1.0 + slip[:, axle - 1]) / radius[axle - 1],
                     setting.wheel_std / radius[axle - 1])
        for axle in range(1, axles + 1)
    }  # fmt: skip
    error = setting.speed_error
    signals = SmoothedSignals(
        wheels,
        smooth(speed, error.std)._replace(window_s=error.window_s),
        {axle: MeasuredLoad.constant(time_s, setting.load[axle - 1]) for axle in wheels},
        {},
        vehicle,
    )
    rows = np.arange(0, len(time_s), max(round(setting.cycle_s / STEP_S), 1))
    rows = rows[counts[rows]]
    axle = np.repeat(np.arange(1, axles + 1), len(rows))
    t_s = np.tile(time_s[rows], axles)
    covariates = {name: np.full(len(t_s), mean) for name, mean in setting.covariates.items()}
    if COVARIATES[Role.SANDING] in covariates:
        covariates[COVARIATES[Role.SANDING]] = np.tile(sand[rows], axles)
    travelled = np.concatenate([[0.0], np.cumsum(speed[:-1] * STEP_S)])
    drive = DriveData(
        name="planned",
        t_s=t_s,
        axle=axle,
        place=axle.astype(np.float64),
        effort=np.zeros(len(t_s)),
        covariates=covariates,
        radius=radius,
        inertia=vehicle.wheelset_inertia,
        position=np.tile(travelled[rows], axles),
        kinematics=SignalKinematics(axle, t_s, signals),
    )
    return drive, rows


def _with_efforts(data: RegressionData, model: Model) -> RegressionData:
    """The rows with the efforts of which a model leaves no residual.

    The efforts stand among the signals as well: some instruments err with that of all axles.
    """
    for _ in range(ITERATIONS):
        (drive,) = data.drives
        drive = replace(drive, kinematics=_add_efforts(drive))
        data = replace(data, drives=(drive,))
        evaluated = evaluate_model(data, model.curves, model.active_effects)
        if np.abs(evaluated.residual).max(initial=0.0) < LEAST_RESIDUAL:
            break
        effort = drive.effort - evaluated.residual * drive.observe().load
        data = replace(data, drives=(replace(drive, effort=effort),))
    return data


def _add_efforts(drive: DriveData) -> SignalKinematics:
    """Kinematics of the drive with the efforts of its rows among the signals."""
    kinematics, none = drive.kinematics, np.empty((0, 2))
    assert isinstance(kinematics, SignalKinematics)  # noqa: S101  built above
    signals = {}
    for axle in np.unique(drive.axle).tolist():
        rows = drive.axle == axle
        t_s = drive.t_s[rows]
        grid = np.arange(t_s[0], t_s[-1] + STEP_S, STEP_S)
        effort = np.interp(grid, t_s, drive.effort[rows])
        signals[axle] = SmoothedSignal(grid, effort, np.gradient(effort, STEP_S), 0.0, none)
    return kinematics.with_efforts(signals)
