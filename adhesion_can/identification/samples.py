"""Readings of different rates -> samples of the adhesion curve on one time base.

A sample stands at each wheel-speed stamp. Vehicle speed and effort are interpolated between the
two readings that bracket it, never extrapolated; dω/dt is the central difference of the wheel
speeds before and after. So a sample is ready a cycle after its stamp, and a gap costs the samples
in it and no others.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import hypot, nan, sqrt
from typing import NamedTuple

import numpy as np

from adhesion_can.identification.track import WAITING, Track, Waiting
from adhesion_can.physics.data import Direction, Reading, Role, Sample, Samples
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.kinematics import (
    V_MIN,
    adhesion_coefficient,
    creep_speed,
    slip_ratio,
    wheelset_effort,
)
from adhesion_can.physics.vehicle import Locomotive

TRAVEL = "travel"
"""Covariate: 1 forwards and as long as nobody tells, -1 in reverse."""

COVARIATES: Mapping[Role, str] = {
    Role.AMBIENT_TEMPERATURE: "ambient_temperature_degC",
    Role.RAIL_TEMPERATURE: "rail_temperature_degC",
    Role.HUMIDITY: "relative_humidity_percent",
    Role.SANDING: "sanding_active",
    Role.RAIN: "rain",
    Role.GRADIENT: "gradient",
    Role.CURVATURE: "curvature_per_m",
}


@dataclass(frozen=True, slots=True)
class Sensors:
    """Standard deviations of the measurements, for the variances of the samples.

    Noise alone; what the resolution of the signals adds is known from the database.

    Attributes:
        wheel_speed_std: rad/s.
        vehicle_speed_std: m/s.
        effort_std: N.

    """

    wheel_speed_std: float = 0.005
    vehicle_speed_std: float = 0.01
    effort_std: float = 2450.0

    def __post_init__(self) -> None:
        if not min(self.wheel_speed_std, self.vehicle_speed_std, self.effort_std) >= 0:
            raise ValueError("standard deviations must not be negative")


@dataclass(frozen=True, slots=True)
class SamplingSettings:
    """When a sample is formed.

    Attributes:
        v_min: no slip ratio below this vehicle speed, m/s.
        max_gap_cycles: readings further apart than this many of their cycles bracket nothing.
        min_load_share: no adhesion below this share of the static load.

    """

    v_min: float = V_MIN
    max_gap_cycles: float = 3.0
    min_load_share: float = 0.1

    def __post_init__(self) -> None:
        if not (self.v_min > 0 and self.max_gap_cycles >= 1):
            raise ValueError("v_min must be positive, max_gap_cycles at least 1")
        if not 0 <= self.min_load_share < 1:
            raise ValueError("min_load_share must be in 0..1")


class _Row(NamedTuple):
    """Measured at one wheel-speed stamp: rad/s, rad/s², s, m/s, N; sorts by stamp and axle.

    `bend` is by how much dω/dt differs after and before the stamp, rad/s²; `spread` the standard
    deviation of an effort that stepped somewhere between its two readings, N.
    """

    t_us: int
    axle: int
    wheel_speed: float
    wheel_accel: float
    span: float
    speed: float
    effort: float
    load: float
    load_std: float
    speed_us: int
    bend: float
    spread: float


_TRAVEL_OF = {Direction.FORWARD: 1.0, Direction.REVERSE: -1.0}


class SampleFormer:
    """Forms samples from readings as they come; holds a fraction of a second of them.

    Args:
        vehicle: radii, loads, inertia.
        cycles_us: cycle of each role's message, µs; what allows a gap to be told.
        settings: see there.
        sensors: see there.
        instruments: errors of the sensors and of the vehicle's data, taken out of the readings.
        with_travel: whether samples carry the direction of travel, the covariate `TRAVEL`.

    """

    def __init__(
        self,
        vehicle: Locomotive,
        cycles_us: Mapping[Role, int],
        settings: SamplingSettings | None = None,
        sensors: Sensors | None = None,
        instruments: Instruments = PERFECT,
        *,
        with_travel: bool = False,
    ) -> None:
        self._vehicle = vehicle = instruments.vehicle(vehicle)
        self._instruments, self._with_travel = instruments, with_travel
        self._speed_lag_us = round(instruments.speed_delay * 1e6)
        self._effort_lag_us = round(instruments.effort_delay * 1e6)
        self._lag_us = max(self._speed_lag_us, self._effort_lag_us, 0)
        self._radius = np.array(vehicle.wheel_radius)
        self._settings = settings or SamplingSettings()
        self._sensors = sensors or Sensors()
        self._gap = {role: self._settings.max_gap_cycles * us for role, us in cycles_us.items()}
        required = (Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT)
        self._patience_us = max(self._gap.get(role, 0.0) for role in required)
        axles = range(1, vehicle.axles + 1)
        self._wheel = {i: Track(self._gap.get(Role.WHEEL_SPEED, 0.0)) for i in axles}
        self._effort = {i: Track(self._gap.get(Role.TRACTIVE_EFFORT, 0.0)) for i in axles}
        self._load = {i: Track(self._gap.get(Role.AXLE_LOAD, 0.0)) for i in axles}
        self._speed = Track(self._gap.get(Role.VEHICLE_SPEED, 0.0))
        self._next = dict.fromkeys(axles, 1)
        self._travel = 1.0
        self._covariates: dict[str, float] = {}
        self._history: list[tuple[int, dict[str, float]]] = []
        geometry = vehicle.geometry
        self._transfer = (
            None if geometry is None else geometry.load_transfer(np.eye(vehicle.axles)).T.tolist()
        )
        self.dropped: Counter[str] = Counter()
        """Wheel-speed readings that gave no sample, by reason."""

    def add(self, reading: Reading) -> None:
        """Take one reading; stamps must not run backwards.

        What a sensor measured earlier than it is stamped goes back to when that was; samples wait
        for it.
        """
        role, axle, wrong = reading.role, reading.axle, self._instruments
        if role is Role.WHEEL_SPEED and axle in self._wheel:
            self._wheel[axle].add(reading.t_us, reading.value)
        elif role is Role.TRACTIVE_EFFORT and axle in self._effort:
            effort = None if reading.value is None else reading.value - wrong.effort_bias
            self._effort[axle].add(reading.t_us - self._effort_lag_us, effort)
        elif role is Role.VEHICLE_SPEED:
            speed = None if reading.value is None else reading.value / (1.0 + wrong.speed_error)
            self._speed.add(reading.t_us - self._speed_lag_us, speed)
        elif role is Role.AXLE_LOAD and axle in self._load:
            self._load[axle].add(reading.t_us, reading.value)
        elif role is Role.DIRECTION and reading.value is not None:
            self._travel = _TRAVEL_OF.get(int(reading.value), self._travel)
            if self._with_travel and self._covariates.get(TRAVEL) != self._travel:
                self._set_covariate(TRAVEL, self._travel, reading.t_us)
        elif role in COVARIATES:
            self._set_covariate(COVARIATES[role], reading.value, reading.t_us)

    def _set_covariate(self, name: str, value: float | None, t_us: int) -> None:
        # A new mapping, since the samples formed so far share the old one.
        rest = {key: old for key, old in self._covariates.items() if key != name}
        self._covariates = rest if value is None else {**rest, name: value}
        if self._lag_us:
            self._history.append((t_us, self._covariates))

    def _covariates_at(self, t_us: int) -> dict[str, float]:
        """Those of a sample: the present ones, unless it had to wait for late readings."""
        if not self._lag_us:
            return self._covariates
        before = bisect_right(self._history, t_us, key=lambda entry: entry[0]) - 1
        return self._history[before][1] if before >= 0 else {}

    def collect(self, now_us: int) -> list[Sample]:
        """Samples that became complete, by stamp and axle.

        Args:
            now_us: present time; a wheel speed that has waited for its bracket longer than the
                gap allowed is given up.

        """
        formed: list[_Row] = []
        for axle, wheel in self._wheel.items():
            k = self._next[axle]
            while k < len(wheel.times) - 1:
                outcome = self._form(axle, k)
                if outcome is WAITING:
                    if now_us - wheel.times[k] <= 2 * self._patience_us + self._lag_us:
                        break
                    outcome = "no bracket"
                if isinstance(outcome, _Row):
                    formed.append(outcome)
                else:
                    self.dropped[str(outcome)] += 1
                k += 1
            self._next[axle] = k - wheel.forget_before(wheel.times[k - 1]) if wheel.times else k
        samples = self._samples(sorted(formed))
        self._forget(now_us)
        return samples

    def _forget(self, now_us: int) -> None:
        """Drop what no waiting wheel speed needs, nor any that may still be bracketed."""
        waiting = [
            wheel.times[self._next[axle] - 1]
            for axle, wheel in self._wheel.items()
            if len(wheel.times) >= self._next[axle]
        ]
        oldest = max(
            min(waiting, default=now_us), round(now_us - 4 * self._patience_us - self._lag_us)
        )
        for track in (self._speed, *self._effort.values(), *self._load.values()):
            track.forget_before(oldest)
        gone = bisect_right(self._history, oldest, key=lambda entry: entry[0]) - 1
        del self._history[: max(gone, 0)]

    def _form(self, axle: int, k: int) -> _Row | str | Waiting:  # noqa: PLR0911  a reason each
        """What a sample at the k-th wheel speed of an axle is made of, or why there is none."""
        wheel = self._wheel[axle]
        t = wheel.times[k]
        before, omega, after = wheel.values[k - 1 : k + 2]
        if before is None or omega is None or after is None:
            return "wheel speed not available"
        span = wheel.times[k + 1] - wheel.times[k - 1]
        if max(t - wheel.times[k - 1], wheel.times[k + 1] - t) > wheel.max_gap_us:
            return "gap in wheel speed"
        v = self._speed.at(t)
        effort = self._effort[axle].at(t)
        if isinstance(v, Waiting) or isinstance(effort, Waiting):
            return WAITING
        if v is None:
            return "vehicle speed not available"
        if effort is None:
            return "tractive effort not available"
        if v < self._settings.v_min:
            return "below v_min"
        loaded = self._load_at(axle, t, effort)
        if isinstance(loaded, Waiting):
            return WAITING
        load, load_std = loaded
        if load < self._settings.min_load_share * self._vehicle.axle_load[axle - 1]:
            return "axle load implausibly low"
        later = (after - omega) / ((wheel.times[k + 1] - t) * 1e-6)
        earlier = (omega - before) / ((t - wheel.times[k - 1]) * 1e-6)
        return _Row(
            t,
            axle,
            omega,
            (after - before) / (span * 1e-6),
            span * 1e-6,
            v,
            effort,
            load,
            load_std,
            self._speed.closing(t),
            later - earlier,
            self._effort[axle].spread(t),
        )

    def _samples(self, rows: list[_Row]) -> list[Sample]:
        """Eq. 1-3 on the rows of one update, and the variances that the sensors put on them."""
        if not rows:
            return []
        columns = np.array(rows, dtype=np.float64)
        axle = columns[:, 1].astype(np.int64) - 1
        _, _, omega, acceleration, span, v, effort, load, _, _, bend, spread = columns.T
        r, inertia = self._radius[axle], self._vehicle.wheelset_inertia
        noise = self._sensors
        slip = slip_ratio(omega, v, r, self._settings.v_min)
        by_wheel = r * noise.wheel_speed_std / v
        by_vehicle = r * omega * noise.vehicle_speed_std / (v * v)
        # Two readings make a central difference.
        by_difference = wheelset_effort(noise.wheel_speed_std / span, inertia, r)
        # What noise alone explains of bend and spread (4 standard deviations) is no transient.
        bend_noise = 4 * sqrt(6.0) * 2 * noise.wheel_speed_std / span
        by_bend = wheelset_effort(np.where(np.abs(bend) > bend_noise, bend, 0.0) / 2, inertia, r)
        by_spread = np.where(spread > 4 * noise.effort_std / sqrt(2.0), spread, 0.0)
        numbers = zip(
            slip.tolist(),
            adhesion_coefficient(effort, load, acceleration, inertia, r).tolist(),
            creep_speed(omega, v, r).tolist(),
            (by_wheel**2).tolist(),
            (by_vehicle**2).tolist(),
            ((noise.effort_std**2 + 2 * by_difference**2) / (load * load)).tolist(),
            ((by_bend**2 + by_spread**2) / (load * load)).tolist(),
            strict=True,
        )
        return [
            Sample(
                t_us=row.t_us,
                axle=row.axle,
                slip=slip_,
                adhesion=adhesion,
                creep_speed=creep,
                speed=row.speed,
                load=row.load,
                load_std=row.load_std,
                slip_var=slip_var,
                adhesion_var=adhesion_var,
                slip_common_var=common_var,
                speed_us=row.speed_us,
                transient_var=transient_var,
                covariates=self._covariates_at(row.t_us),
            )
            for row, (
                slip_,
                adhesion,
                creep,
                slip_var,
                common_var,
                adhesion_var,
                transient_var,
            ) in zip(rows, numbers, strict=True)
        ]

    def _load_at(self, axle: int, t_us: int, effort: float) -> tuple[float, float] | Waiting:
        """Load of an axle and the standard deviation of what was not measured, N."""
        measured = self._load[axle].held_at(t_us)
        if measured is not None:
            return measured, 0.0
        static = self._vehicle.axle_load[axle - 1]
        spread = self._vehicle.load_std * static
        if self._transfer is None:
            return static, spread
        row = self._transfer[axle - 1]
        shift = 0.0
        for j, share in enumerate(row, start=1):
            track = self._effort[j]
            other = track.at(t_us)
            if isinstance(other, Waiting) and track.times:
                return WAITING
            if other is None or isinstance(other, Waiting):
                # Another axle's effort is unknown: no transfer, but its whole size as doubt.
                return static, hypot(spread, effort * sum(row))
            shift += share * other
        return static + self._travel * shift, spread


def common_load_std(loads: np.ndarray, load_std: np.ndarray) -> float:
    """Relative standard deviation that unmeasured loads put on every adhesion value alike.

    An axle's load error is the same in all its samples, so it does not average out with them:
    it adds to the standard deviation of the curve's level as a whole.

    Args:
        loads: N, shape (n,).
        load_std: N, shape (n,).

    """
    if not len(loads):
        return 0.0
    return sqrt(float(np.mean((load_std / loads) ** 2)))


def columns_of(samples: Iterable[Sample]) -> Samples:
    """Columns of samples with every covariate that any of them carries, NaN where one does not."""
    rows = list(samples)
    names = sorted(set().union(*(row.covariates.keys() for row in rows)))
    covariates = {
        name: np.array([row.covariates.get(name, nan) for row in rows], dtype=np.float64)
        for name in names
    }
    return replace(Samples.of(rows), covariates=covariates)
