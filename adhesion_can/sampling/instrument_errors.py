"""Errors of the instruments that depend on the situation, removed where samples are formed.

Constant errors are removed from the readings as they come. What depends on the efforts of other
axles, on time or on other channels is removed from the rows of measured values, in the order in
which they are collected: so readings one by one and whole columns give the same samples.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.instrument_laws import (
    InstrumentLaw,
    Need,
    Situation,
    remove_errors,
)
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.lag_states import SequentialLagStates
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.equations import Measured
from adhesion_can.values import Stateful, Value

Stamps = NDArray[np.int64]
NOT_CORRECTED = "a channel that the instrument's error depends on is not available"
"""Reason why a wheel speed gave no sample."""


class WheelAngles(Stateful):
    """Angle that each wheel has turned since its first reading, by the trapezoidal rule."""

    def __init__(self) -> None:
        self._latest: dict[int, tuple[int, float, float]] = {}

    def turn(self, axle: int, t_us: Stamps, speed: Array) -> Array:
        """Angles at further readings of an axle, rad, shape (n,).

        Args:
            axle: Number of the axle.
            t_us: Stamps, µs, ascending, shape (n,).
            speed: Available wheel speeds, rad/s, shape (n,).

        """
        before_us, before, angle = self._latest.get(axle, (int(t_us[0]), float(speed[0]), 0.0))
        times = np.concatenate([[before_us], t_us])
        speeds = np.concatenate([[before], speed])
        steps = (speeds[1:] + speeds[:-1]) * 0.5 * (np.diff(times) * 1e-6)
        # One after another: the same for any division into blocks.
        angles = np.cumsum(np.concatenate([[angle], steps]))[1:]
        self._latest[axle] = (int(t_us[-1]), float(speed[-1]), float(angles[-1]))
        return angles


@dataclass(frozen=True, eq=False)
class _Given(Value):
    """Laws of the instruments and configured vehicle, which copies share."""

    laws: tuple[InstrumentLaw, ...]
    vehicle: Locomotive


class RowCorrection(Stateful):
    """Removes the errors of situations from rows of measured values.

    Args:
        instruments: Errors of the sensors and of the vehicle's data, with one law at least.
        vehicle: Configured vehicle.

    """

    def __init__(self, instruments: Instruments, vehicle: Locomotive) -> None:
        self._given = _Given(instruments.laws, vehicle)
        self._lags = SequentialLagStates()
        self.covariates = instruments.law_covariates
        """Names of the covariates on which the errors depend."""
        self.needs_efforts = instruments.needs(Need.EFFORTS)
        """Whether an error depends on the efforts of all axles."""
        self.needs_angle = instruments.needs(Need.WHEEL_ANGLE)
        """Whether an error depends on the angle that a wheel has turned."""
        self.origin_us: int | None = None
        """Stamp of the first wheel speed, µs."""

    def begin(self, t_us: int) -> None:
        """Take a stamp as the start of the recording, unless one was taken before."""
        if self.origin_us is None:
            self.origin_us = t_us

    def correct(
        self,
        t_us: Stamps,
        rows: Measured,
        travel: Array,
        efforts: Array | None,
        angle: Array | None,
        covariates: Mapping[str, Array],
    ) -> Measured:
        """Rows without the errors; NaN where something is not known on which an error depends.

        Args:
            t_us: Stamps of the rows, µs, in the order in which they are collected; shape (n,).
            rows: Measured values.
            travel: Direction of travel, 1 or −1, shape (n,).
            efforts: Last efforts of all axles, N, shape (n, axles); None where no error depends on
                them.
            angle: Angle that the wheel has turned, rad, shape (n,); None where no error depends on
                it.
            covariates: Values of covariates by name, NaN where not known; shape (n,) each.

        """
        origin_us = int(t_us[0]) if self.origin_us is None else self.origin_us
        read = Situation(
            time_s=np.asarray((t_us - origin_us) * 1e-6, dtype=np.float64),
            axle=rows.axle.astype(np.float64),
            wheel_speed=rows.wheel_speed,
            wheel_accel=rows.wheel_accel,
            speed=rows.speed,
            effort=rows.effort,
            load=rows.load,
            vehicle=self._given.vehicle,
            travel=travel,
            efforts=efforts,
            wheel_angle=angle,
            covariates=covariates,
        )
        true = remove_errors(self._given.laws, read, self._lags).values
        return rows._replace(
            wheel_speed=true.wheel_speed,
            wheel_accel=true.wheel_accel,
            speed=true.speed,
            effort=true.effort,
            load=true.load,
        )


def is_whole(rows: Measured, v_min: float) -> NDArray[np.bool_]:
    """Whether corrected rows still make samples, shape (n,): known, fast enough and loaded."""
    known = np.isfinite(rows.wheel_speed + rows.wheel_accel + rows.speed + rows.effort + rows.load)
    with np.errstate(invalid="ignore"):
        return np.asarray(known & (rows.speed >= v_min) & (rows.load > 0.0))
