"""What the sensors make of the plant's state, and the frames that carry it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from adhesion_can.bus.codec import MessagePlan
from adhesion_can.bus.database import INPUT_MESSAGES, CanDatabase, e2e_data_id
from adhesion_can.bus.e2e import COUNTS, protect
from adhesion_can.bus.frame import Frame
from adhesion_can.physics.burckhardt import Array
from adhesion_can.physics.data import Direction, SpeedSource

SLOT_US = 250
"""Two frames of 8 bytes follow each other at 500 kbit/s in about this time."""

AXLES_PER_MESSAGE = 3


@dataclass(frozen=True, slots=True)
class NoiseSettings:
    """Standard deviations of white noise, one draw a frame and signal.

    Attributes:
        wheel_speed: rad/s.
        vehicle_speed: m/s.
        effort: N; 1 % of the axle load.
        load: N.

    """

    wheel_speed: float = 0.003
    vehicle_speed: float = 0.01
    effort: float = 2450.0
    load: float = 500.0


@dataclass(frozen=True, slots=True)
class PlantState:
    """What can be measured at one moment: SI, arrays of shape (axles,)."""

    wheel_speed: Array
    speed: float
    effort: Array
    load: Array
    gradient: float

    def towards(self, other: "PlantState", share: float) -> "PlantState":
        """Between this state (share 0) and a later one (share 1)."""
        return PlantState(
            self.wheel_speed + share * (other.wheel_speed - self.wheel_speed),
            self.speed + share * (other.speed - self.speed),
            self.effort + share * (other.effort - self.effort),
            self.load + share * (other.load - self.load),
            other.gradient,
        )


class Transmitter:
    """One input message: when it is due next, and its payload from a state.

    Args:
        database: with the message.
        name: of the message.
        slot: place in the order of the bus; the message's phase.

    """

    def __init__(self, database: CanDatabase, name: str, slot: int) -> None:
        message = database.message(name)
        self.name = name
        self._plan = MessagePlan(message)
        self._data_id = e2e_data_id(message) or message.frame_id
        self._count = 0
        self.cycle_us = int(message.cycle_time or 0) * 1000
        self.due_us = slot * SLOT_US

    def frame(self, values: Mapping[str, float | None]) -> Frame:
        """The frame now due; the next one is due a cycle later."""
        payload = self._plan.encode(values)
        protect(payload, self._data_id, self._count)
        frame = Frame(self.due_us, self._plan.frame_id, bytes(payload))
        self._count = (self._count + 1) % COUNTS
        self.due_us += self.cycle_us
        return frame


class Sensors:
    """All input messages of the contract, each at its cycle.

    Args:
        database: our own message set.
        noise: see there.
        rng: random numbers.

    """

    def __init__(
        self, database: CanDatabase, noise: NoiseSettings, rng: np.random.Generator
    ) -> None:
        self._noise = noise
        self._rng = rng
        self._transmitters = [
            Transmitter(database, name, slot) for slot, name in enumerate(INPUT_MESSAGES)
        ]

    def due(
        self, after: PlantState, before: PlantState, from_us: int, until_us: int
    ) -> list[Frame]:
        """Frames due after `from_us` and until `until_us`, in the order of their stamps.

        Args:
            after: state at `until_us`.
            before: state at `from_us`.
            from_us: begin of the step, µs.
            until_us: end of it.

        """
        frames = []
        ready = [t for t in self._transmitters if t.due_us <= until_us]
        for transmitter in sorted(ready, key=lambda t: t.due_us):
            share = (transmitter.due_us - from_us) / (until_us - from_us)
            state = before.towards(after, max(share, 0.0))
            frames.append(transmitter.frame(self._values(transmitter.name, state)))
        return frames

    def _values(self, name: str, state: PlantState) -> dict[str, float | None]:
        noise, rng = self._noise, self._rng
        if name == "VehicleSpeed":
            speed = max(state.speed + noise.vehicle_speed * rng.standard_normal(), 0.0)
            return {
                "VehicleSpeed": speed,
                "VehicleSpeedSource": float(SpeedSource.RADAR),
                "Direction": float(Direction.FORWARD),
            }
        if name == "Environment":
            return {
                "AmbientTemperature": 15.0,
                "RailTemperature": 18.0,
                "RelativeHumidity": 60.0,
                "SandingActive": 0.0,
                "Rain": 0.0,
            }
        if name == "TrackGeometry":
            return {"Gradient": state.gradient * 1e3, "Curvature": 0.0}
        first = AXLES_PER_MESSAGE * (int(name[-1]) - 1)
        signal, column, spread = {
            "WheelSpeeds": ("WheelSpeed", state.wheel_speed, noise.wheel_speed),
            "TractiveEffort": ("TractiveEffort", state.effort, noise.effort),
            "AxleLoads": ("AxleLoad", state.load, noise.load),
        }[name[:-1]]
        axles = range(first, min(first + AXLES_PER_MESSAGE, len(column)))
        measured = column[axles.start : axles.stop] + spread * rng.standard_normal(len(axles))
        if signal == "WheelSpeed":
            measured = np.maximum(measured, 0.0)  # a magnitude
        values: dict[str, float | None] = {
            f"{signal}_Ax{first + place}": None for place in range(1, AXLES_PER_MESSAGE + 1)
        }
        return values | {
            f"{signal}_Ax{axle + 1}": float(x) for axle, x in zip(axles, measured, strict=True)
        }
