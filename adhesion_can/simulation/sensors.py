"""Sensors: from the plant's state to frames with its noisy measurements."""

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.bus.database import INPUT_MESSAGES, CanDatabase
from adhesion_can.bus.frame import Frame, to_us
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.physics.instrument_laws import Quantity, Situation, total_error
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.readings import Direction, Role, SpeedSource
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.surroundings import DEFAULT_CONDITIONS, SurroundingConditions

SLOT_US = 250
"""Duration of a frame of 8 bytes at 500 kbit/s, about, µs."""

AXLES_PER_MESSAGE = 3

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
        if quantity not in self._kinds:
            return true
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


class Transmitter:
    """One input message: when it is due next, and its payload from a state.

    Args:
        database: Database with the message.
        name: Name of the message.
        slot: Place in the order of the bus, from 0: the phase of the message.

    """

    def __init__(self, database: CanDatabase, name: str, slot: int) -> None:
        self.name = name
        self._message = ProtectedMessage(database.message(name))
        self.due_us = slot * SLOT_US

    def frame(self, values: Mapping[str, float | None]) -> Frame:
        """The frame now due; the next one is due a cycle later."""
        frame = self._message.frame(self.due_us, values)
        self.due_us += self._message.cycle_us
        return frame


def delays_by_role_us(instruments: Instruments) -> dict[Role, int]:
    """Age of the values of each role at their stamp, µs; where one is early the others are late."""
    delays = {
        Role.WHEEL_SPEED: instruments.wheel_speed_delay,
        Role.VEHICLE_SPEED: instruments.speed_delay,
        Role.TRACTIVE_EFFORT: instruments.effort_delay,
    }
    earliest = min(*delays.values(), 0.0)
    return {role: to_us(delay - earliest) for role, delay in delays.items()}


_ROLES = {
    "WheelSpeeds1": Role.WHEEL_SPEED,
    "WheelSpeeds2": Role.WHEEL_SPEED,
    "VehicleSpeed": Role.VEHICLE_SPEED,
    "TractiveEffort1": Role.TRACTIVE_EFFORT,
    "TractiveEffort2": Role.TRACTIVE_EFFORT,
}


class SimulatedSensors:
    """All input messages of the packaged message set, each at its cycle.

    Args:
        database: The message set of adhesion-can.
        noise: Standard deviations of the noise.
        rng: Generator of the noise.
        instruments: Errors of the sensors beside the noise.
        vehicle: Configured vehicle, on which some errors depend; None: the default.

    """

    def __init__(
        self,
        database: CanDatabase,
        noise: SensorNoiseSettings,
        rng: np.random.Generator,
        instruments: Instruments = PERFECT,
        vehicle: Locomotive | None = None,
    ) -> None:
        self._noise = noise
        self._rng = rng
        self._instruments = instruments
        self._errors = SensorErrors(instruments, vehicle or Locomotive())
        of_roles = delays_by_role_us(instruments)
        self._delay_us = {name: of_roles[role] for name, role in _ROLES.items()}
        longest_us = max(self._delay_us.values())
        self._history = StateHistory(longest_us) if longest_us else None
        self._transmitters = [
            Transmitter(database, name, slot) for slot, name in enumerate(INPUT_MESSAGES)
        ]

    def due(
        self, after: PlantState, before: PlantState, from_us: int, until_us: int
    ) -> list[Frame]:
        """Frames due after `from_us` and until `until_us`, in the order of their stamps.

        Args:
            after: State at `until_us`.
            before: State at `from_us`.
            from_us: Start of the step, µs.
            until_us: End of the step, µs.

        """
        if self._history is not None:
            if self._history.is_empty:
                self._history.add(from_us, before)
            self._history.add(until_us, after)
        frames = []
        ready = [t for t in self._transmitters if t.due_us <= until_us]
        for transmitter in sorted(ready, key=lambda t: t.due_us):
            share = (transmitter.due_us - from_us) / (until_us - from_us)
            state = before.towards(after, max(share, 0.0))
            delay_us = self._delay_us.get(transmitter.name, 0)
            if delay_us and self._history is not None:
                state = self._history.at(transmitter.due_us - delay_us)
            time_s = (transmitter.due_us - delay_us) / 1e6
            frames.append(transmitter.frame(self._values(transmitter.name, state, time_s)))
        return frames

    def _values(self, name: str, state: PlantState, time_s: float) -> dict[str, float | None]:
        noise, rng = self._noise, self._rng
        if name == "VehicleSpeed":
            read = self._errors.add(
                Quantity.SPEED, np.array([state.speed]), state, time_s, WHOLE_VEHICLE
            )
            speed = (1.0 + self._instruments.speed_error) * float(read[0])
            measured_speed = max(speed + noise.vehicle_speed * rng.standard_normal(), 0.0)
            return {
                "VehicleSpeed": none_for_nan(measured_speed),
                "VehicleSpeedSource": float(SpeedSource.RADAR),
                "Direction": float(Direction.FORWARD),
            }
        if name == "Environment":
            return {
                "AmbientTemperature": state.conditions.ambient_temperature,
                "RailTemperature": state.conditions.rail_temperature,
                "RelativeHumidity": state.conditions.humidity,
                "SandingActive": state.conditions.sanding,
                "Rain": state.conditions.rain,
            }
        if name == "TrackGeometry":
            return {
                "Gradient": state.gradient * 1e3,
                "Curvature": state.conditions.curvature * 1e3,
            }
        first = AXLES_PER_MESSAGE * (int(name[-1]) - 1)
        bias = self._instruments.effort_bias
        signal, quantity, column, spread, offset = {
            "WheelSpeeds": (
                "WheelSpeed", Quantity.WHEEL_SPEED, state.wheel_speed, noise.wheel_speed, 0.0
            ),
            "TractiveEffort": (
                "TractiveEffort", Quantity.EFFORT, state.effort, noise.effort, bias
            ),
            "AxleLoads": ("AxleLoad", Quantity.LOAD, state.load, noise.load, 0.0),
        }[name[:-1]]  # fmt: skip
        axles = range(first, min(first + AXLES_PER_MESSAGE, len(column)))
        read = self._errors.add(
            quantity, column[axles.start : axles.stop], state, time_s, np.array(axles) + 1.0
        )
        measured = read + offset + spread * rng.standard_normal(len(axles))
        if signal == "WheelSpeed":
            measured = np.maximum(measured, 0.0)  # a magnitude
        values: dict[str, float | None] = {
            f"{signal}_Ax{first + place}": None for place in range(1, AXLES_PER_MESSAGE + 1)
        }
        return values | {
            f"{signal}_Ax{axle + 1}": none_for_nan(x)
            for axle, x in zip(axles, measured.tolist(), strict=True)
        }


def none_for_nan(value: float) -> float | None:
    """A reading, or None, 'not available', where its error has no value."""
    return None if isnan(value) else value
