"""Sensors on the bus of any database: frames with noisy measurements, by the signals' roles."""

from collections import Counter
from collections.abc import Mapping, Sequence
from statistics import fmean

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.bus.database import INPUT_MESSAGES, CanDatabase
from adhesion_can.bus.e2e import COUNTS, protect
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.roles import BoundMessage, BoundSignal, bind, packaged_choices
from adhesion_can.errors import InputError
from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.instrument_laws import Quantity
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.readings import Direction, Role, SpeedSource
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.simulation.sensors import (
    NOISE_ROOM,
    SLOT_US,
    WHOLE_VEHICLE,
    PlantState,
    SensorErrors,
    SensorNoiseSettings,
    StateHistory,
    delays_by_role_us,
    none_for_nan,
)

GNSS_STD = 0.05
"""Standard deviation of the role `gnss_speed`, m/s."""


def packaged_messages(database: CanDatabase) -> tuple[BoundMessage, ...]:
    """All input messages of the packaged message set, in the order of the bus.

    Args:
        database: Database that has them, by their names.

    """
    choices = sorted(packaged_choices(), key=lambda choice: INPUT_MESSAGES.index(choice.message))
    most_axles = max(choice.axle for choice in choices)
    return bind(choices, database, [1.0] * most_axles, "the packaged message set")


class RoleTransmitter:
    """One message: when it is due next, and its payload from values by signal.

    Args:
        message: Message with the roles of its signals.
        first_us: Time of its first frame, µs: the phase of the message.

    """

    def __init__(self, message: BoundMessage, first_us: int) -> None:
        plan = message.plan
        for signal in message.signals:
            if plan.multiplexed.get(signal.plan.name):
                raise InputError(
                    f"roles.{signal.name}",
                    f"{plan.name}.{signal.plan.name} is multiplexed, which the simulation does "
                    "not support",
                    "map the role to another signal, or remove it",
                )
        if message.cycle_us is None:
            raise InputError(
                f"roles.{message.signals[0].name}",
                f"the cycle of {plan.name} is unknown",
                "write cycle_ms at its role, or GenMsgCycleTime in the database",
            )
        self.name = plan.name
        self.signals = message.signals
        self.due_us = first_us
        self._message = message
        self._cycle_us = message.cycle_us
        self._count = 0

    def frame(self, values: Mapping[str, float | None]) -> Frame:
        """The frame now due; the next one is due a cycle later."""
        message, plan = self._message, self._message.plan
        payload = plan.encode(values)
        if message.data_id is not None:
            protect(payload, message.data_id, self._count)
            self._count = (self._count + 1) % COUNTS
        frame = Frame(
            self.due_us,
            plan.frame_id,
            bytes(payload),
            channel=message.channel or "",
            is_extended=plan.is_extended,
            is_fd=plan.size > 8,
        )
        self.due_us += self._cycle_us
        return frame


class RoleSensors:
    """All messages that a configuration listens for, each at its cycle.

    Args:
        messages: Messages with the roles of their signals.
        noise: Standard deviations of the noise.
        rng: Generator of the noise.
        instruments: Errors of the sensors beside the noise.
        vehicle: Configured vehicle, on which some errors depend.
        slot_us: Time from one message's first frame to that of the next, µs; 0: they are in phase.

    Raises:
        InputError: A signal is multiplexed, or the cycle of a message is unknown.

    """

    def __init__(
        self,
        messages: Sequence[BoundMessage],
        noise: SensorNoiseSettings,
        rng: np.random.Generator,
        instruments: Instruments,
        vehicle: Locomotive,
        slot_us: int = SLOT_US,
    ) -> None:
        self._noise = noise
        self._rng = rng
        self._instruments = instruments
        self._errors = SensorErrors(instruments, vehicle)
        self._axles = vehicle.axles
        self._delay_us = delays_by_role_us(instruments)
        longest_us = max(self._delay_us.values())
        self._history = StateHistory(longest_us)
        self._std = {
            Role.WHEEL_SPEED: noise.wheel_speed,
            Role.VEHICLE_SPEED: noise.vehicle_speed,
            Role.TRACTIVE_EFFORT: noise.effort,
            Role.AXLE_LOAD: noise.load,
        }
        self._effort_bias: list[float] = np.broadcast_to(
            instruments.effort_bias, vehicle.axles
        ).tolist()
        self._sent: Counter[tuple[str, str]] = Counter()
        """Number of values sent by the names of message and signal."""
        self._saturated: Counter[tuple[str, str]] = Counter()
        """Number of those at an end of the signal's range."""
        sent = [message for message in messages if message.roles - {Role.CHANNEL}]
        self._transmitters = [
            RoleTransmitter(message, slot * slot_us) for slot, message in enumerate(sent)
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
        if self._history.is_empty:
            self._history.add(from_us, before)
        self._history.add(until_us, after)
        frames = []
        for transmitter in self._transmitters:
            while transmitter.due_us <= until_us:
                values = self._values(transmitter)
                frames.append(transmitter.frame(values))
        return sorted(frames, key=lambda frame: frame.t_us)

    def _values(self, transmitter: RoleTransmitter) -> dict[str, float | None]:
        """Values of a message's signals, in their units, at its due time."""
        given: dict[str, list[float | None]] = {}
        states: dict[int, PlantState] = {}
        for signal in transmitter.signals:
            t_us = transmitter.due_us - self._delay_us.get(signal.role, 0)
            if t_us not in states:
                states[t_us] = self._history.at(t_us)
            measured = None
            if signal.axle <= self._axles:
                measured = self._measure(signal, states[t_us], t_us / 1e6)
            value = None if measured is None else none_for_nan(measured)
            given.setdefault(signal.plan.name, []).append(
                None if value is None else (value + signal.offset) / signal.scale
            )
        values: dict[str, float | None] = {}
        signals = {signal.plan.name: signal for signal in transmitter.signals}
        for signal in transmitter.signals:
            # One force of several axles has shares that agree but for their noise.
            known = [value for value in given[signal.plan.name] if value is not None]
            value = fmean(known) if len(known) > 1 else next(iter(known), None)
            if value is not None or signal.plan.not_available is not None:
                values[signal.plan.name] = value
        return {
            name: value if value is None else self._within(transmitter, signals[name], value)
            for name, value in values.items()
        }

    def saturation(self) -> list[str]:
        """Sentences on the signals that stood at an end of their range, and for how long."""
        return [
            f"{signal.name} ({sender.name}.{signal.plan.name}): at an end of its range in "
            f"{100 * count / self._sent[key]:.1f} % of its frames"
            for sender in self._transmitters
            for signal in sender.signals
            if (count := self._saturated[key := (sender.name, signal.plan.name)])
        ]

    def _within(self, transmitter: RoleTransmitter, signal: BoundSignal, value: float) -> float:
        """A value as its signal can carry it: a sensor stops at the end of its range.

        InputError where the signal cannot carry even its first value.
        """
        low, high = signal.plan.sendable
        sent = min(max(value, low), high)
        key = (transmitter.name, signal.plan.name)
        self._sent[key] += 1
        if sent != value:
            self._saturated[key] += 1
            room = NOISE_ROOM * self._std.get(signal.role, 0.0) / abs(signal.scale)
            if self._sent[key] == 1 and abs(sent - value) > room:
                raise InputError(
                    f"roles.{signal.name}",
                    f"{transmitter.name}.{signal.plan.name} would be {value:.6g}, beyond its range "
                    f"in the database ({low:g} to {high:g})",
                    "correct the range, the unit of the role or its sign",
                )
        return sent

    def _measure(self, signal: BoundSignal, state: PlantState, time_s: float) -> float | None:
        """Measured value of a role, SI; None where the locomotive has no such sensor."""

        def read(quantity: Quantity, column: Array) -> float:
            if not self._errors.has(quantity):
                return float(column[0])
            axles = np.array([float(signal.axle)]) if signal.axle else WHOLE_VEHICLE
            return float(self._errors.add(quantity, column, state, time_s, axles)[0])

        noise, instruments, axle = self._noise, self._instruments, signal.axle - 1
        match signal.role:
            case Role.WHEEL_SPEED:
                speed = read(Quantity.WHEEL_SPEED, state.wheel_speed[axle : axle + 1])
                return max(speed + self._draw(noise.wheel_speed), 0.0)
            case Role.VEHICLE_SPEED:
                true = read(Quantity.SPEED, np.array([state.speed]))
                speed = (1.0 + instruments.speed_error) * true
                return max(speed + self._draw(noise.vehicle_speed), 0.0)
            case Role.TRACTIVE_EFFORT:
                effort = read(Quantity.EFFORT, state.effort[axle : axle + 1])
                return effort + self._effort_bias[axle] + self._draw(noise.effort)
            case Role.AXLE_LOAD:
                load = read(Quantity.LOAD, state.load[axle : axle + 1])
                return load + self._draw(noise.load)
        return self._measure_surroundings(signal.role, state)

    def _measure_surroundings(self, role: Role, state: PlantState) -> float | None:
        """Measured value of a role that is no quantity of the drive."""
        if role is Role.GNSS_SPEED:
            return max(state.speed + self._draw(GNSS_STD), 0.0)
        if (name := COVARIATES.get(role)) is not None:
            return state.conditions.covariates(state.gradient)[name]
        states = {Role.SPEED_SOURCE: SpeedSource.RADAR, Role.DIRECTION: Direction.FORWARD}
        return states.get(role)

    def _draw(self, std: float) -> float:
        return std * float(self._rng.standard_normal())
