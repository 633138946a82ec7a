"""Kinematics at the rows of a drive for any sensor delays, from signals or from a table."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.measured_load import LEAST_LOAD_SHARE, MeasuredLoad
from adhesion_can.diagnosis.drive.shift_rows import shift_rows
from adhesion_can.diagnosis.drive.smoothing import SmoothedSignal, integrate
from adhesion_can.diagnosis.drive.turn_swing import TurnSwing, find_turn_swing
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.sampling.noise import NoiseEstimate

RowSelection = NDArray[np.bool_] | slice
CACHED_DELAYS = 6
"""Pairs of delays whose kinematics are kept."""


class Kinematics(NamedTuple):
    """Kinematics of every row; shape (n,) each.

    Attributes:
        wheel_speed: Angular speed of the wheel, rad/s.
        wheel_accel: Angular acceleration of the wheel, rad/s².
        speed: Vehicle speed, m/s.
        load: Axle load, N.
        wheel_std: Standard deviation of the wheel's circumferential speed, m/s.

    """

    wheel_speed: Array
    wheel_accel: Array
    speed: Array
    load: Array
    wheel_std: Array


class SpeedError(NamedTuple):
    """Error of the vehicle speed, which all axles share and which lasts.

    Attributes:
        std: Standard deviation of the smoothed vehicle speed, m/s.
        window_s: Width of the smoothing window, over which errors are correlated, s.
        largest_std: Largest standard deviation that the readings do not rule out, m/s: of noise
            that lasts for longer than the window they show how fast it wanders, not how far.

    """

    std: float
    window_s: float
    largest_std: float


def median_step(t_s: Array, axles: NDArray[np.int64], speed: Array | float = 1.0) -> float:
    """Median time between rows of an axle that follow each other; 0 where none do.

    Args:
        t_s: Times of the rows, s, shape (n,).
        axles: Axle number of each row, shape (n,).
        speed: Vehicle speed from row to row, m/s, shape (n - 1,): the median is that of the way, m.

    """
    step = np.diff(t_s)
    follows = (step > 0.0) & (np.diff(axles) == 0)
    return float(np.median((step * speed)[follows])) if follows.any() else 0.0


@dataclass(frozen=True, eq=False)
class SmoothedSignals:
    """Smoothed signals of one recording.

    Attributes:
        wheels: Smoothed wheel speeds by axle, rad/s.
        speed: Smoothed vehicle speed, m/s.
        loads: Measured axle loads by axle.
        effort: Smoothed tractive efforts by axle, N; they give the load transfer where loads are
            not measured.
        vehicle: Configured vehicle.
        high_pass: High-pass part of the wheel speeds by axle, one pair of stamps, s, and values,
            rad/s, for each gap-free run.
        direction_changes: Stamps, s, and directions of travel from then on, 1 forward and −1 in
            reverse; None: forward throughout.
        effort_noise: Noise of the effort readings, N, of all axles together.

    """

    wheels: Mapping[int, SmoothedSignal]
    speed: SmoothedSignal
    loads: Mapping[int, MeasuredLoad]
    effort: Mapping[int, SmoothedSignal]
    vehicle: Locomotive
    high_pass: Mapping[int, list[tuple[Array, Array]]] = field(default_factory=dict)
    direction_changes: tuple[Array, Array] | None = None
    effort_noise: NoiseEstimate = field(default_factory=NoiseEstimate)

    @property
    def radius(self) -> Array:
        """Configured wheel radii, m; shape (axles,)."""
        return np.array(self.vehicle.wheel_radius)

    def compute_load(self, axle: int, t_s: Array) -> Array:
        """Load of an axle, N: measured, or static with the load transfer of the efforts.

        It is never below the least plausible one: rows there are left out (`is_load_known`).
        """
        if axle in self.loads:
            return self.loads[axle].interpolate(t_s)
        static = self.vehicle.axle_load[axle - 1]
        geometry = self.vehicle.geometry
        if geometry is None or len(self.effort) < self.vehicle.axles:
            return np.full(len(t_s), static)
        share = geometry.load_transfer(np.eye(self.vehicle.axles))[:, axle - 1]
        transferred = np.zeros(len(t_s))
        for other, smooth in self.effort.items():
            transferred += share[other - 1] * np.interp(t_s, smooth.t_s, smooth.value)
        load = static + self.compute_direction(t_s) * transferred
        return np.asarray(np.maximum(load, LEAST_LOAD_SHARE * static))

    def is_load_known(self, axle: int, t_s: Array) -> NDArray[np.bool_]:
        """Whether the load of an axle is plausible at given times, shape (n,)."""
        if axle in self.loads:
            return self.loads[axle].is_known(t_s)
        least = LEAST_LOAD_SHARE * self.vehicle.axle_load[axle - 1]
        return np.asarray(self.compute_load(axle, t_s) > least)

    def compute_direction(self, t_s: Array) -> Array:
        """Direction of travel at given times, 1 or −1; shape (n,)."""
        if self.direction_changes is None or not len(self.direction_changes[0]):
            return np.ones(len(t_s))
        stamps, sign = self.direction_changes
        return np.asarray(sign[np.maximum(np.searchsorted(stamps, t_s, side="right") - 1, 0)])


class SignalKinematics:
    """Kinematics from the signals of a recording; those of the last few delays are kept.

    Args:
        axles: Axle number of each row, shape (n,).
        t_s: Stamp of each row, s; shape (n,).
        signals: Smoothed signals of the recording.

    """

    def __init__(self, axles: NDArray[np.int64], t_s: Array, signals: SmoothedSignals) -> None:
        self._axles, self._t_s, self._signals = axles, t_s, signals
        self.high_pass = signals.high_pass
        self._cached = lru_cache(maxsize=CACHED_DELAYS)(self._interpolate)

    @property
    def speed_error(self) -> SpeedError:
        """Error of the vehicle speed that all axles share."""
        speed = self._signals.speed
        return SpeedError(speed.std, speed.window_s, speed.largest_std)

    @property
    def effort_noise(self) -> NoiseEstimate:
        """Noise of the effort readings, N, of all axles together."""
        return self._signals.effort_noise

    @cached_property
    def cycle_s(self) -> float:
        """Longest time between two readings of a signal, s, median of each signal."""
        s = self._signals
        stamps = [s.speed.t_s, *(signal.t_s for signal in (*s.wheels.values(), *s.effort.values()))]
        return max((float(np.median(np.diff(t))) for t in stamps if len(t) > 1), default=0.0)

    @property
    def total_effort(self) -> Array:
        """Smoothed effort of all axles together at the rows, N; shape (n,)."""
        total = np.zeros(len(self._t_s))
        for effort in self._signals.effort.values():
            total += np.interp(self._t_s, effort.t_s, effort.value)
        return total

    @property
    def vehicle(self) -> Locomotive:
        """Configured vehicle."""
        return self._signals.vehicle

    @cached_property
    def travel(self) -> Array:
        """Direction of travel at the rows, 1 or −1; shape (n,)."""
        return self._signals.compute_direction(self._t_s)

    @cached_property
    def efforts(self) -> Array | None:
        """Smoothed efforts of all axles at the rows, N, shape (n, axles); None: one is missing."""
        smoothed = self._signals.effort
        if len(smoothed) < self.vehicle.axles:
            return None
        at = (
            np.interp(self._t_s, effort.t_s, effort.value) for _, effort in sorted(smoothed.items())
        )
        return np.stack(list(at), axis=1)

    @cached_property
    def _rows(self) -> Mapping[int, NDArray[np.int64]]:
        """Indices of the rows of each axle that has a wheel speed."""
        return {axle: np.flatnonzero(self._axles == axle) for axle in self._signals.wheels}

    @cached_property
    def _turned(self) -> Mapping[int, Array]:
        """Angle that each wheel has turned since its first reading, rad, by axle."""
        return {axle: integrate(wheel) for axle, wheel in self._signals.wheels.items()}

    def wheel_angle(self, effort_delay: float) -> Array:
        """Angle that the row's wheel had turned when the effort was measured, rad; shape (n,)."""
        angle = np.empty(len(self._t_s))
        for axle, wheel in self._signals.wheels.items():
            rows = self._axles == axle
            at = self._t_s[rows] - effort_delay
            angle[rows] = np.interp(at, wheel.t_s, self._turned[axle])
        return angle

    def acceleration(self, speed_delay: float, effort_delay: float) -> Array:
        """Acceleration of the vehicle at the time at which the effort was measured, m/s², (n,)."""
        speed = self._signals.speed
        return np.interp(self._t_s - effort_delay + speed_delay, speed.t_s, speed.rate)

    def once_per_turn(self, axle: int) -> TurnSwing:
        """What an axle's wheel speed shows once a turn."""
        wheel = self._signals.wheels[axle]
        return find_turn_swing(wheel.t_s, wheel.value, self._turned[axle])

    def select_rows(self, kept: RowSelection) -> "SignalKinematics":
        """Kinematics at some of the rows."""
        return SignalKinematics(self._axles[kept], self._t_s[kept], self._signals)

    def with_efforts(self, efforts: Mapping[int, SmoothedSignal]) -> "SignalKinematics":
        """The same with other smoothed efforts by axle, N."""
        return SignalKinematics(self._axles, self._t_s, replace(self._signals, effort=efforts))

    def __call__(self, speed_delay: float, effort_delay: float) -> Kinematics:
        """Kinematics at the time at which the effort was measured.

        Args:
            speed_delay: Delay of the vehicle speed, s.
            effort_delay: Delay of the effort, s.

        """
        return self._cached(float(speed_delay), float(effort_delay))

    def _interpolate(self, speed_delay: float, effort_delay: float) -> Kinematics:
        t, s = self._t_s - effort_delay, self._signals
        wheel_speed, wheel_accel, speed, load, wheel_std = np.empty((5, len(t)))
        for axle, wheel in s.wheels.items():
            rows = self._rows[axle]
            at = t[rows]
            wheel_speed[rows] = np.interp(at, wheel.t_s, wheel.value)
            wheel_accel[rows] = np.interp(at, wheel.t_s, wheel.rate)
            speed[rows] = np.interp(at + speed_delay, s.speed.t_s, s.speed.value)
            load[rows] = s.compute_load(axle, at)
            wheel_std[rows] = s.radius[axle - 1] * wheel.std
        return Kinematics(wheel_speed, wheel_accel, speed, load, wheel_std)


class TableKinematics:
    """Kinematics that a sample table gives in its rows.

    A wheel of radius 1 m without inertia, with the slips of the table, replaces the real one.

    Args:
        axles: Axle number of each row, shape (n,).
        t_s: Stamps, s, ascending for each axle; shape (n,).
        columns: Wheel speed, rad/s, vehicle speed, m/s, and load, N; shape (3, n).

    """

    speed_error = SpeedError(0.0, 0.0, 0.0)
    vehicle: Locomotive | None = None
    travel: Array | float = 1.0
    efforts: Array | None = None

    def __init__(self, axles: NDArray[np.int64], t_s: Array, columns: Array) -> None:
        self._axles, self._t_s, self._columns = axles, t_s, columns
        self.high_pass: Mapping[int, list[tuple[Array, Array]]] = {}

    @cached_property
    def cycle_s(self) -> float:
        """Time between two rows of an axle, s, median."""
        return median_step(self._t_s, self._axles)

    def wheel_angle(self, _effort_delay: float) -> Array | None:
        """None: a table has no wheels that turn."""
        return None

    def acceleration(self, _speed_delay: float, _effort_delay: float) -> Array | None:
        """None: a table has speeds at its rows alone."""
        return None

    def select_rows(self, kept: RowSelection) -> "TableKinematics":
        """Kinematics at some of the rows."""
        return TableKinematics(self._axles[kept], self._t_s[kept], self._columns[:, kept])

    def __call__(self, speed_delay: float, effort_delay: float) -> Kinematics:
        """Kinematics at the time at which the effort of each row was measured.

        Args:
            speed_delay: Delay of the vehicle speed, s.
            effort_delay: Delay of the effort, s.

        """
        columns, none = self._columns, np.zeros(len(self._t_s))
        if effort_delay != 0.0 or speed_delay != 0.0:
            columns = np.empty_like(columns)
            later = (0.0, speed_delay, 0.0)
            for axle in np.unique(self._axles):
                rows = self._axles == axle
                t_s = self._t_s[rows]
                for target, values, shift in zip(columns, self._columns, later, strict=True):
                    by_s = shift - effort_delay
                    target[rows] = shift_rows(t_s, values[rows], by_s) if by_s else values[rows]
        return Kinematics(columns[0], none, columns[1], columns[2], none)
