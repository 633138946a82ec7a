"""Where the kinematics of a course's rows come from, for any delays of the sensors."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.smoothing import Smooth
from adhesion_can.physics.vehicle import Locomotive

Rows = NDArray[np.bool_] | slice


class Kinematics(NamedTuple):
    """Of each row: rad/s, rad/s², m/s, N, and the wheel speed's doubt, m/s; shape (n,)."""

    wheel_speed: Array
    wheel_accel: Array
    speed: Array
    load: Array
    wheel_std: Array


@dataclass(frozen=True, eq=False)
class Signals:
    """The smooth signals of one recording.

    Attributes:
        wheels: by axle.
        speed: of the vehicle.
        loads: measured ones by axle, stamps in s and N.
        effort: smoothed, by axle, for the transfer of load where it is not measured.
        vehicle: configured.
        rough: see `Source`.
        travel: stamps, s, and direction of travel from then on, 1 forward, −1 in reverse; None:
            forward throughout.

    """

    wheels: Mapping[int, Smooth]
    speed: Smooth
    loads: Mapping[int, tuple[Array, Array]]
    effort: Mapping[int, Smooth]
    vehicle: Locomotive
    rough: Mapping[int, list[tuple[Array, Array]]] = field(default_factory=dict)
    travel: tuple[Array, Array] | None = None

    @property
    def radius(self) -> Array:
        """Configured, by axle, m."""
        return np.array(self.vehicle.wheel_radius)

    def load(self, axle: int, t_s: Array) -> Array:
        """Load of an axle: measured, or static with the transfer of load."""
        if axle in self.loads:
            return np.interp(t_s, *self.loads[axle])
        static = self.vehicle.axle_load[axle - 1]
        geometry = self.vehicle.geometry
        if geometry is None or len(self.effort) < self.vehicle.axles:
            return np.full(len(t_s), static)
        share = geometry.load_transfer(np.eye(self.vehicle.axles))[:, axle - 1]
        moved = np.zeros(len(t_s))
        for other, smooth in self.effort.items():
            moved += share[other - 1] * np.interp(t_s, smooth.t_s, smooth.value)
        return static + self.direction(t_s) * moved

    def direction(self, t_s: Array) -> Array:
        """Direction of travel at times, 1 or −1."""
        if self.travel is None or not len(self.travel[0]):
            return np.ones(len(t_s))
        stamps, sign = self.travel
        return np.asarray(sign[np.maximum(np.searchsorted(stamps, t_s, side="right") - 1, 0)])


class Source:
    """Kinematics at the rows for any delays; the last few are kept.

    Attributes:
        rough: by axle, the wheel speed's fast part stretch by stretch: stamps, s, and rad/s.

    """

    def __init__(self, axles: NDArray[np.int64], t_s: Array, signals: Signals) -> None:
        self._axles, self._t_s, self._signals = axles, t_s, signals
        self.rough = signals.rough
        self._cached = lru_cache(maxsize=6)(self._at)

    @property
    def speed_doubt(self) -> tuple[float, float]:
        """See `Course.speed_doubt`."""
        return self._signals.speed.std, self._signals.speed.window_s

    def rows(self, kept: Rows) -> "Source":
        """Kinematics at some of the rows."""
        return Source(self._axles[kept], self._t_s[kept], self._signals)

    def __call__(self, speed_delay: float, effort_delay: float) -> Kinematics:
        """Kinematics at the moment at which the effort was measured.

        Args:
            speed_delay: of the vehicle speed, s.
            effort_delay: of the effort, s.

        """
        return self._cached(float(speed_delay), float(effort_delay))

    def _at(self, speed_delay: float, effort_delay: float) -> Kinematics:
        t, s = self._t_s - effort_delay, self._signals
        columns = np.empty((4, len(t)))
        wheel_std = np.empty(len(t))
        for axle, wheel in s.wheels.items():
            rows = self._axles == axle
            at = t[rows]
            columns[0, rows] = np.interp(at, wheel.t_s, wheel.value)
            columns[1, rows] = np.interp(at, wheel.t_s, wheel.rate)
            columns[2, rows] = np.interp(at + speed_delay, s.speed.t_s, s.speed.value)
            columns[3, rows] = s.load(axle, at)
            wheel_std[rows] = s.radius[axle - 1] * wheel.std
        return Kinematics(columns[0], columns[1], columns[2], columns[3], wheel_std)


class TableSource:
    """Kinematics that a TABLE gives: they stand in its rows.

    A wheel of radius 1 m without inertia that has the slips of the table stands for the real one.

    Args:
        axles: of the rows, shape (n,).
        t_s: stamps, ascending for each axle, shape (n,).
        columns: wheel speed, speed, load of each row, shape (3, n).

    """

    speed_doubt = (0.0, 0.0)

    def __init__(self, axles: NDArray[np.int64], t_s: Array, columns: Array) -> None:
        self._axles, self._t_s, self._columns = axles, t_s, columns
        self.rough: Mapping[int, list[tuple[Array, Array]]] = {}

    def rows(self, kept: Rows) -> "TableSource":
        """Kinematics at some of the rows."""
        return TableSource(self._axles[kept], self._t_s[kept], self._columns[:, kept])

    def __call__(self, _speed_delay: float, effort_delay: float) -> Kinematics:
        """Kinematics of each row, or as they were a delay before it."""
        columns, none = self._columns, np.zeros(len(self._t_s))
        if effort_delay != 0.0:
            columns = np.empty_like(columns)
            for axle in np.unique(self._axles):
                rows = self._axles == axle
                at = self._t_s[rows] - effort_delay
                for to, of in zip(columns, self._columns, strict=True):
                    to[rows] = np.interp(at, self._t_s[rows], of[rows])
        return Kinematics(columns[0], none, columns[1], columns[2], none)
