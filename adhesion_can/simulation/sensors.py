"""What sensors measure: the plant's state, as late and as wrong as they read it."""

from bisect import bisect_right
from dataclasses import dataclass
from math import isnan

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.bus.frame import to_us
from adhesion_can.physics.instrument_laws import Quantity, Situation, total_error
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.readings import Role
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.surroundings import DEFAULT_CONDITIONS, SurroundingConditions

SLOT_US = 250
"""Duration of a frame of 8 bytes at 500 kbit/s, about, µs."""
NOISE_ROOM = 5.0
"""Distance from the end of a signal's range that noise does not bridge, in standard deviations."""


@dataclass(frozen=True, slots=True)
class SensorNoiseSettings:
    """Standard deviations of white noise, one draw a frame and signal.

    The defaults are those of the default locomotive, 245 kN an axle.

    Attributes:
        wheel_speed: Standard deviation of a wheel speed, rad/s.
        vehicle_speed: Standard deviation of the vehicle speed, m/s.
        effort: Standard deviation of an axle's effort, N; 1 % of the axle load.
        load: Standard deviation of an axle's load, N; 0.2 % of the axle load.

    """

    wheel_speed: float = 0.003
    vehicle_speed: float = 0.01
    effort: float = 2450.0
    load: float = 500.0


@dataclass(frozen=True, slots=True)
class PlantState:
    """Quantities that sensors measure, at one time.

    Attributes:
        wheel_speed: Angular speed of each wheelset, rad/s, shape (axles,).
        speed: Vehicle speed, m/s.
        effort: Effort at the rim of each axle, N, shape (axles,).
        load: Load of each axle, N, shape (axles,).
        gradient: Gradient of the track, m/m, positive uphill.
        conditions: Surroundings of the locomotive.
        acceleration: Acceleration of the vehicle, m/s².
        wheel_angle: Angle that each wheelset has turned, rad, shape (axles,); None where it is
            not known.

    """

    wheel_speed: Array
    speed: float
    effort: Array
    load: Array
    gradient: float
    conditions: SurroundingConditions = DEFAULT_CONDITIONS
    acceleration: float = 0.0
    wheel_angle: Array | None = None

    def towards(self, other: "PlantState", share: float) -> "PlantState":
        """State between this one (share 0) and a later one (share 1), by linear interpolation."""
        return PlantState(
            self.wheel_speed + share * (other.wheel_speed - self.wheel_speed),
            self.speed + share * (other.speed - self.speed),
            self.effort + share * (other.effort - self.effort),
            self.load + share * (other.load - self.load),
            other.gradient,
            other.conditions,
            other.acceleration,
            _between(self.wheel_angle, other.wheel_angle, share),
        )


def _between(before: Array | None, after: Array | None, share: float) -> Array | None:
    return None if before is None or after is None else before + share * (after - before)


class StateHistory:
    """Recent states, for sensors that measure late.

    Args:
        depth_us: Largest age of a state that is needed, µs.

    """

    def __init__(self, depth_us: int) -> None:
        self._depth_us = depth_us
        self._times: list[int] = []
        self._states: list[PlantState] = []

    @property
    def is_empty(self) -> bool:
        """Whether no state was added yet."""
        return not self._times

    def add(self, t_us: int, state: PlantState) -> None:
        """Add the state at a stamp; stamps ascend."""
        self._times.append(t_us)
        self._states.append(state)
        # A thousand at a time: to drop one from the front of a list moves all others.
        if len(self._times) > 1000 and self._times[-1000] < t_us - self._depth_us:
            del self._times[:-1000], self._states[:-1000]

    def at(self, t_us: int) -> PlantState:
        """State at a stamp, between the two that stand around it; the first one before all."""
        after = bisect_right(self._times, t_us)
        if after == 0:
            return self._states[0]
        if after == len(self._times):
            return self._states[-1]
        before = self._times[after - 1]
        share = (t_us - before) / (self._times[after] - before)
        return self._states[after - 1].towards(self._states[after], share)


class SensorErrors:
    """Errors of the readings, beside noise and delays, by the laws of the instruments.

    Args:
        instruments: Errors of the sensors.
        vehicle: Configured vehicle.

    """

    def __init__(self, instruments: Instruments, vehicle: Locomotive) -> None:
        self._laws, self._vehicle = instruments.laws, vehicle
        self._lags = LagStates()
        self._kinds = {law.quantity for law in self._laws}

    def has(self, quantity: Quantity) -> bool:
        """Whether readings of a quantity have errors."""
        return quantity in self._kinds

    def add(
        self, quantity: Quantity, true: Array, state: PlantState, time_s: float, axles: Array
    ) -> Array:
        """Readings of a quantity with their errors.

        Args:
            quantity: Kind of reading.
            true: True values, shape (n,).
            state: State at the time of measurement.
            time_s: Time of measurement, s.
            axles: Number of each reading's axle; any one for a reading of the whole vehicle.

        """
        count, rows = len(axles), axles.astype(np.int64) - 1
        conditions = state.conditions.covariates(state.gradient)
        situation = Situation(
            time_s=np.full(count, time_s),
            axle=axles,
            wheel_speed=state.wheel_speed[rows],
            wheel_accel=np.zeros(count),
            speed=np.full(count, state.speed),
            effort=state.effort[rows],
            load=state.load[rows],
            vehicle=self._vehicle,
            efforts=np.broadcast_to(state.effort, (count, len(state.effort))),
            acceleration=np.full(count, state.acceleration),
            wheel_angle=None if state.wheel_angle is None else state.wheel_angle[rows],
            covariates={name: np.full(count, value) for name, value in conditions.items()},
            is_true=True,
        )
        error = total_error(self._laws, quantity, situation, self._lags)
        return np.asarray(true * (1.0 + error.relative) + error.absolute)


WHOLE_VEHICLE = np.ones(1)
"""Axle in whose place a reading of the whole vehicle is kept."""


def delays_by_role_us(instruments: Instruments) -> dict[Role, int]:
    """Age of the values of each role at their stamp, µs; where one is early the others are late."""
    delays = {
        Role.WHEEL_SPEED: instruments.wheel_speed_delay,
        Role.VEHICLE_SPEED: instruments.speed_delay,
        Role.TRACTIVE_EFFORT: instruments.effort_delay,
    }
    earliest = min(*delays.values(), 0.0)
    return {role: to_us(delay - earliest) for role, delay in delays.items()}


def none_for_nan(value: float) -> float | None:
    """A reading, or None, 'not available', where its error has no value."""
    return None if isnan(value) else value
