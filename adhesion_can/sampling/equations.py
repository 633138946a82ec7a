"""Settings and equations of the samples: from measured values to slip ratio and adhesion.

Two formers use them: `SampleFormer` reading by reading, `ColumnFormer` whole columns. Their samples
are equal to the last bit.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.kinematics import (
    V_MIN,
    adhesion_coefficient,
    creep_speed,
    slip_ratio,
    wheelset_effort,
)
from adhesion_can.physics.readings import Direction, Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.ranges import Within, require_ranges

TRAVEL_DIRECTION = "travel"
"""Covariate: 1 forwards, and as long as no direction is known; -1 in reverse."""


class AidColumns(NamedTuple):
    """Names of the covariates that carry an aid of the observed speed.

    Attributes:
        value: Name of that with the latest reading, in the unit of its role.
        stamp: Name of that with the stamp of this reading, µs.

    """

    value: str
    stamp: str


AID_COLUMNS: Mapping[Role, AidColumns] = {
    Role.GNSS_SPEED: AidColumns("gnss_speed_mps", "gnss_speed_us"),
    Role.ACCELERATION: AidColumns("acceleration_mps2", "acceleration_us"),
}
"""Covariates by role; samples carry them where the vehicle speed is observed."""


@dataclass(frozen=True, slots=True)
class Sensors:
    """Standard deviations of the measurements, for the variances of the samples.

    Noise alone; what the resolution of the signals adds is known from the database.

    Attributes:
        wheel_speed_std: Standard deviation of the wheel speed, rad/s.
        vehicle_speed_std: Standard deviation of the vehicle speed, m/s.
        effort_std: Standard deviation of the effort of an axle, N. Without the key 1 % of the mean
            static load, which is the default's for 245 kN.

    """

    wheel_speed_std: Annotated[float, Within(0, 100)] = 0.005
    vehicle_speed_std: Annotated[float, Within(0, 100)] = 0.01
    effort_std: Annotated[float, Within(0, 1e7)] = 2450.0

    def __post_init__(self) -> None:
        # The ranges are those of a file: the resolution of the signals adds to the largest, too.
        stds = (self.wheel_speed_std, self.vehicle_speed_std, self.effort_std)
        if not all(std >= 0 for std in stds):
            raise ValueError("standard deviations must not be negative")


@dataclass(frozen=True, slots=True)
class SamplingSettings:
    """Conditions under which a sample is formed.

    Attributes:
        v_min: Lowest vehicle speed with a slip ratio, m/s.
        max_gap_cycles: Longest time between two readings that bracket a stamp, in cycles of their
            message.
        min_load_share: Lowest share of the static load with an adhesion coefficient, 1.

    """

    v_min: Annotated[float, Within(0.01, 1000)] = V_MIN
    max_gap_cycles: Annotated[float, Within(1, 1000)] = 3.0
    min_load_share: Annotated[float, Within(0.001, 0.99)] = 0.1

    def __post_init__(self) -> None:
        require_ranges(self)


TRAVEL_BY_DIRECTION: Mapping[int, float] = {Direction.FORWARD: 1.0, Direction.REVERSE: -1.0}
"""Value of `TRAVEL_DIRECTION` by direction; another direction leaves it as it is."""


@dataclass(frozen=True)
class SampleEquations:
    """Equations of a vehicle's samples, with its data, sensors and settings.

    Attributes:
        configured: Vehicle with the radii, loads and inertia as configured.
        cycles_us: Cycle time of each role's message, µs; a gap is a multiple of it.
        settings: Conditions under which a sample is formed.
        sensors: Standard deviations of the measurements.
        instruments: Errors of the sensors and of the vehicle's data, corrected in the readings.
        with_travel: Whether samples carry the covariate `TRAVEL_DIRECTION`.
        channels: Names of the covariates from the user's channels, by their numbers from 1.
        with_aids: Whether samples carry the covariates of `AID_COLUMNS`.

    """

    configured: Locomotive
    cycles_us: Mapping[Role, int]
    settings: SamplingSettings
    sensors: Sensors
    instruments: Instruments = PERFECT
    with_travel: bool = False
    channels: tuple[str, ...] = ()
    with_aids: bool = False

    @property
    def aids(self) -> Mapping[Role, AidColumns]:
        """Covariates that carry the aids of the observed speed, by role."""
        return AID_COLUMNS if self.with_aids else {}

    def covariate(self, role: Role, number: int) -> str:
        """Name of the covariate that a role carries; '' where it carries none.

        Args:
            role: Meaning of the signal.
            number: Number of a channel of the user's.

        """
        return self.channels[number - 1] if role is Role.CHANNEL else COVARIATES.get(role, "")

    @cached_property
    def vehicle(self) -> Locomotive:
        """Vehicle with the errors of its data corrected."""
        return self.instruments.vehicle(self.configured)

    @cached_property
    def speed_lag_us(self) -> int:
        """Delay of the stamps of the vehicle speed against those of the wheel speeds, µs."""
        return round(self.instruments.speed_lag * 1e6)

    @cached_property
    def effort_lag_us(self) -> int:
        """Delay of the stamps of the effort against those of the wheel speeds, µs."""
        return round(self.instruments.effort_lag * 1e6)

    @cached_property
    def lag_us(self) -> int:
        """Time that samples wait for late readings, µs."""
        return max(self.speed_lag_us, self.effort_lag_us, 0)

    def gap_us(self, role: Role) -> float:
        """Longest time between two readings of a role that bracket a stamp, µs."""
        return self.settings.max_gap_cycles * self.cycles_us.get(role, 0)

    @cached_property
    def longest_gap_us(self) -> float:
        """Longest gap allowed in the signals that every sample needs, µs."""
        required = (Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT)
        return max(self.gap_us(role) for role in required)

    @cached_property
    def give_up_us(self) -> float:
        """Longest time that a wheel speed waits for its bracket, µs."""
        return 2 * self.longest_gap_us + self.lag_us

    def oldest_needed_us(self, waiting_us: Iterable[int], now_us: int) -> int:
        """Oldest stamp around which a sample may still need readings, µs.

        Args:
            waiting_us: Stamps of the wheel speeds that wait for their brackets, µs.
            now_us: Current time, µs.

        """
        limit = round(now_us - 4 * self.longest_gap_us - self.lag_us)
        return max(min(waiting_us, default=now_us), limit)

    @cached_property
    def transfer(self) -> list[list[float]] | None:
        """Change of each axle's load by each axle's effort; None without a geometry."""
        geometry = self.vehicle.geometry
        if geometry is None:
            return None
        rows: list[list[float]] = geometry.load_transfer(np.eye(self.vehicle.axles)).T.tolist()
        return rows

    @cached_property
    def load_age_us(self) -> int:
        """Greatest age of what measured loads need: the load before, and its effort; µs."""
        return round(self.gap_us(Role.AXLE_LOAD)) + max(self.effort_lag_us, 0)

    @cached_property
    def radius(self) -> Array:
        """Wheel radius of each axle, m, shape (axles,)."""
        return np.array(self.vehicle.wheel_radius)

    def derive(self, rows: "Measured") -> "Derived":
        """Slip, adhesion and creep speed of measured rows (eq. 1-3), with their variances."""
        noise, inertia = self.sensors, self.vehicle.wheelset_inertia
        omega, v, load = rows.wheel_speed, rows.speed, rows.load
        r = self.radius[rows.axle - 1]
        by_wheel = r * noise.wheel_speed_std / v
        by_vehicle = r * omega * noise.vehicle_speed_std / (v * v)
        # Two readings make a central difference.
        by_difference = wheelset_effort(noise.wheel_speed_std / rows.span, inertia, r)
        # What noise alone explains (4 standard deviations) is no transient.
        change_noise = 4 * sqrt(6.0) * 2 * noise.wheel_speed_std / rows.span
        change = np.where(
            np.abs(rows.acceleration_change) > change_noise, rows.acceleration_change, 0.0
        )
        by_change = wheelset_effort(change / 2, inertia, r)
        by_step = np.where(
            rows.effort_step_std > 4 * noise.effort_std / sqrt(2.0), rows.effort_step_std, 0.0
        )
        adhesion = adhesion_coefficient(rows.effort, load, rows.wheel_accel, inertia, r)
        by_load = adhesion * rows.transfer_std
        return Derived(
            slip=slip_ratio(omega, v, r, self.settings.v_min),
            adhesion=adhesion,
            creep_speed=creep_speed(omega, v, r),
            slip_var=by_wheel**2,
            slip_common_var=by_vehicle**2,
            adhesion_var=(noise.effort_std**2 + 2 * by_difference**2) / (load * load),
            transient_var=(by_change**2 + by_step**2 + by_load**2) / (load * load),
        )


class Measured(NamedTuple):
    """Columns of measured values at wheel-speed stamps.

    Attributes:
        axle: Number of the axle, 1.., shape (n,).
        wheel_speed: Angular speed ω of the wheel, rad/s, shape (n,).
        wheel_accel: Acceleration dω/dt by the central difference, rad/s², shape (n,).
        span: Time span of the central difference, s, shape (n,).
        speed: Vehicle speed, m/s, shape (n,).
        effort: Effort of the axle, N, shape (n,).
        load: Wheelset load, N, shape (n,).
        acceleration_change: Difference of dω/dt after and before the stamp, rad/s², shape (n,).
        effort_step_std: Standard deviation of an effort that stepped between its readings, N,
            shape (n,).
        transfer_std: Standard deviation of what was transferred since the load was read, N, shape
            (n,); 0 for a load that was not measured.

    """

    axle: NDArray[np.int64]
    wheel_speed: Array
    wheel_accel: Array
    span: Array
    speed: Array
    effort: Array
    load: Array
    acceleration_change: Array
    effort_step_std: Array
    transfer_std: Array

    def select(self, kept: NDArray[np.bool_]) -> "Measured":
        """Some of the rows."""
        return self._replace(**{name: column[kept] for name, column in self._asdict().items()})


class Derived(NamedTuple):
    """Columns of the derived fields of `Sample`, by the same names, shape (n,) each."""

    slip: Array
    adhesion: Array
    creep_speed: Array
    slip_var: Array
    slip_common_var: Array
    adhesion_var: Array
    transient_var: Array
