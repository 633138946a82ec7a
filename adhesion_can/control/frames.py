"""The creep controller on a bus: frames of the vehicle and of the service in, demands out.

As the core of the service it touches no bus and no clock: `feed` takes a frame, `advance` a time.
A step is made once the wheel speeds of all axles have come, or a cycle and a half after the last.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from math import nan
from typing import Protocol

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.bus.checked_message import CheckedMessage, SignalValues
from adhesion_can.bus.database import (
    DEMAND_MESSAGES,
    OUTPUT_MESSAGES,
    SAND_DEMAND,
    database_with,
)
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.j1939 import IdFilter
from adhesion_can.bus.output_values import objection_in, status_in, theta_in
from adhesion_can.bus.protected_message import ProtectedMessage
from adhesion_can.bus.receiver import Receiver
from adhesion_can.bus.rejection import Rejection
from adhesion_can.config import Configuration
from adhesion_can.control.creep_controller import CreepController
from adhesion_can.control.inputs import Advice, Measurement
from adhesion_can.control.plan_follower import PlanFollower
from adhesion_can.control.settings import ControlSettings
from adhesion_can.errors import ConfigError
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.driving_plan import DrivingPlan
from adhesion_can.physics.objection import NEEDS_RELIEF
from adhesion_can.physics.readings import Reading, Role, role_name

STALE_CYCLES = 3
"""Number of cycles without a valid frame after which a signal counts as not available."""
LATE_CYCLES = 1.5
"""Number of cycles after the last step at which the next is made with what has come."""
PHASE_MARGIN = 0.58
"""Largest bandwidth times cycle: with the dead time of a cycle a phase margin of 45 degrees."""
DEMANDED_AXLES = 6


class EffortController(Protocol):
    """What makes efforts of measurements and of the service's setpoints."""

    def step(self, measured: Measurement, advice: Advice) -> Array:
        """Effort to demand of each axle until the next cycle, N, shape (axles,).

        Args:
            measured: Measured state.
            advice: Latest contents of the service's messages.

        """


class ControllerOnBus:
    """Controller, its inputs by the configuration's roles, and its demands.

    Args:
        configuration: Database, roles and vehicle.
        controller: Controller that makes the demands; None: the reference controller.
        sand: Function that returns whether sand is demanded; None: it never is.

    Raises:
        ConfigError: A wheel speed or the vehicle speed has no role, its cycle is unknown, or the
            vehicle cannot be controlled.

    """

    def __init__(
        self,
        configuration: Configuration,
        controller: EffortController | None = None,
        sand: Callable[[], bool] | None = None,
    ) -> None:
        self._sand = sand or (lambda: False)
        vehicle = configuration.vehicle
        self._vehicle = vehicle
        self._cycle_us = find_cycle_us(configuration)
        self.controller = controller or build_reference(configuration)
        """Controller that the demands come from."""
        used = {Role.VEHICLE_SPEED, Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT, Role.AXLE_LOAD}
        messages = [m for m in configuration.messages if any(s.role in used for s in m.signals)]
        self.receiver = Receiver(messages)
        """Receiver of the vehicle's frames, with its counts."""
        database = database_with(OUTPUT_MESSAGES, configuration.database)
        self._advices = [CheckedMessage(database.message(name)) for name in OUTPUT_MESSAGES]
        database = database_with(DEMAND_MESSAGES, configuration.database)
        self._demands = [ProtectedMessage(database.message(name)) for name in DEMAND_MESSAGES]
        self._radius = np.array(vehicle.wheel_radius)
        self._values: dict[tuple[Role, int], tuple[int, float]] = {}
        self._cycles = {
            (signal.role, signal.axle): message.cycle_us or self._cycle_us
            for message in messages
            for signal in message.signals
        }
        self._new_speed: float | None = None
        self._axles = range(1, vehicle.axles + 1)
        self._waiting = set(self._axles)
        """Axles whose wheel speed has not come since the last step."""
        self._stepped_us: int | None = None
        self.advice = Advice()
        """Latest contents of the service's messages."""
        self._advised_us: int | None = None

    @property
    def ids(self) -> list[IdFilter]:
        """Filters of every message to receive."""
        plans = (message.plan for message in self._advices)
        advice_ids = [IdFilter.exact(plan.frame_id, plan.is_extended) for plan in plans]
        return [*self.receiver.ids, *advice_ids]

    @property
    def next_due_us(self) -> int | None:
        """Time at which a step is made whatever comes, µs; None before the first."""
        if self._stepped_us is None:
            return None
        return self._stepped_us + round(LATE_CYCLES * self._cycle_us)

    def feed(self, frame: Frame) -> list[Frame]:
        """Process a frame; returns the demands of the steps up to it."""
        demands = self.advance(frame.t_us)
        for message in self._advices:
            if message.is_carried_by(frame):
                self._take_advice(message.plan.name, message.read(frame), frame.t_us)
                return demands
        outcome = self.receiver.accept(frame)
        if outcome is None or isinstance(outcome, Rejection):
            return demands
        self._take_readings(outcome)
        if not self._waiting:
            demands += self._step(frame.t_us)
        return demands

    def advance(self, t_us: int) -> list[Frame]:
        """Bring the controller to a time, µs; returns the demands of the steps up to it."""
        demands: list[Frame] = []
        while (due_us := self.next_due_us) is not None and due_us <= t_us:
            demands += self._step(due_us)
        return demands

    def stop(self, t_us: int) -> list[Frame]:
        """Last frames: no effort is demanded any more."""
        return self._compose(t_us, np.full(self._vehicle.axles, np.nan))

    def _take_readings(self, readings: Iterable[Reading]) -> None:
        for reading in readings:
            key = (reading.role, reading.axle)
            if reading.value is None:
                self._values.pop(key, None)
            else:
                self._values[key] = (reading.t_us, reading.value)
            if reading.role is Role.VEHICLE_SPEED:
                self._new_speed = reading.value
            elif reading.role is Role.WHEEL_SPEED:
                self._waiting.discard(reading.axle)

    def _step(self, t_us: int) -> list[Frame]:
        if self._advised_us is not None:
            stale_us = STALE_CYCLES * self._advices[0].cycle_us
            if t_us - self._advised_us > stale_us:
                self.advice, self._advised_us = Advice(), None
        self._stepped_us = t_us
        self._waiting = set(self._axles)
        effort = np.nan_to_num(self._by_axle(Role.TRACTIVE_EFFORT, t_us))
        static = self._vehicle.loads(effort)
        load = self._by_axle(Role.AXLE_LOAD, t_us)
        measured = Measurement(
            t_us / 1e6,
            self._new_speed,
            self._by_axle(Role.WHEEL_SPEED, t_us) * self._radius,
            effort,
            np.where(load > 0.0, load, static),
        )
        self._new_speed = None
        return self._compose(t_us, self.controller.step(measured, self.advice))

    def _by_axle(self, role: Role, t_us: int) -> Array:
        """Latest values of a role, shape (axles,); NaN where they are stale or not received."""
        latest = np.full(self._vehicle.axles, nan)
        for axle in self._axles:
            value = self._values.get((role, axle))
            if value is not None:
                at_us, number = value
                if t_us - at_us <= STALE_CYCLES * self._cycles[role, axle]:
                    latest[axle - 1] = number
        return latest

    def _compose(self, t_us: int, effort: Array) -> list[Frame]:
        known = {axle: float(x) for axle, x in enumerate(effort, 1) if np.isfinite(x)}
        values = {
            f"EffortDemand_Ax{axle}": known.get(axle) for axle in range(1, DEMANDED_AXLES + 1)
        }
        values[SAND_DEMAND] = float(self._sand())
        return [
            message.frame(t_us, {n: x for n, x in values.items() if n in message.plan.signals})
            for message in self._demands
        ]

    def _take_advice(self, name: str, values: SignalValues | Rejection, t_us: int) -> None:
        if isinstance(values, Rejection):
            return
        if name == "AdhesionSetpoint":
            self._advised_us = t_us
            status = status_in(values)
            self.advice = replace(self.advice, status=status, lambda_m=values["LambdaM"])
        elif name == "AdhesionModel":
            objection = objection_in(values)
            self.advice = replace(
                self.advice,
                theta=theta_in(values),
                objection=objection,
                relief_wanted=objection in NEEDS_RELIEF,
            )
        elif name == "AdhesionQuality":
            doubt = _doubt_in(values)
            self.advice = replace(self.advice, doubt=doubt, lambda_m_std=values["LambdaMStd"])
        elif name == "AxleSetpoint":
            self.advice = replace(self.advice, axles=_with_axle(self.advice.axles, values))


def _doubt_in(values: SignalValues) -> Doubt:
    """Doubt of `AdhesionQuality`; of one that only a newer service knows: the curve is doubted."""
    number = values.get("Doubt")
    if number is None:  # a user's database may lack it
        return Doubt.NONE
    return Doubt(int(number)) if number in set(Doubt) else Doubt.SHAPE


def _with_axle(axles: Mapping[int, float], values: SignalValues) -> Mapping[int, float]:
    axle = int(values["Axle"] or 0)
    slip = values.get(f"LambdaM_Ax{axle}")
    others = {number: known for number, known in axles.items() if number != axle}
    return others if slip is None else {**others, axle: slip}


def build_follower(configuration: Configuration, plan: DrivingPlan) -> PlanFollower:
    """A follower of a driving plan at the cycle of the configured wheel speeds.

    Args:
        configuration: Database, roles and vehicle.
        plan: Plan to drive.

    Raises:
        ConfigError: A wheel speed or the vehicle speed has no role, its cycle is unknown, or the
            vehicle cannot drive the plan.

    """
    settings = _at_cycle(ControlSettings(), find_cycle_us(configuration) / 1e6)
    try:
        return PlanFollower(configuration.vehicle, plan, settings)
    except ValueError as error:
        fix = "fix [vehicle], or compute the plan from this configuration"
        raise ConfigError(configuration.where, str(error), fix) from None


def build_reference(configuration: Configuration, cycle_s: float | None = None) -> CreepController:
    """The reference controller at a cycle.

    A slow cycle takes a smaller bandwidth than its settings state.

    Args:
        configuration: Database, roles and vehicle.
        cycle_s: Time from one step to the next, s; None: the cycle of the configured wheel speeds.

    Raises:
        ConfigError: A wheel speed or the vehicle speed has no role, its cycle is unknown, or the
            vehicle cannot be controlled.

    """
    if cycle_s is None:
        cycle_s = find_cycle_us(configuration) / 1e6
    try:
        return CreepController(configuration.vehicle, _at_cycle(ControlSettings(), cycle_s))
    except ValueError as error:
        fix = "fix [vehicle]: the controller needs it"
        raise ConfigError(configuration.where, str(error), fix) from None


def _at_cycle(settings: ControlSettings, cycle_s: float) -> ControlSettings:
    """Settings at a cycle: a slower one takes a smaller bandwidth."""
    loop = settings.loop
    slower = min(loop.bandwidth, PHASE_MARGIN / cycle_s)
    share = slower / loop.bandwidth
    return replace(
        settings,
        loop=replace(
            loop,
            cycle_s=cycle_s,
            bandwidth=slower,
            integral_rate=share * loop.integral_rate,
            stable_rate=share * loop.stable_rate,
        ),
    )


def find_cycle_us(configuration: Configuration) -> int:
    """Longest cycle of the wheel speeds, µs.

    Raises:
        ConfigError: A wheel speed or the vehicle speed has no role, or its cycle is unknown.

    """
    wanted = [(Role.VEHICLE_SPEED, 0)]
    wanted += [(Role.WHEEL_SPEED, axle) for axle in range(1, configuration.vehicle.axles + 1)]
    cycles = {
        (signal.role, signal.axle): message.cycle_us
        for message in configuration.messages
        for signal in message.signals
    }
    longest_us = 0
    for role, axle in wanted:
        name = role_name(role, axle)
        if (role, axle) not in cycles:
            raise ConfigError(
                configuration.where,
                f"no signal has the role {name}",
                "the controller needs it; map it in [roles]",
            )
        cycle_us = cycles[role, axle]
        if not cycle_us:
            raise ConfigError(
                configuration.where,
                f"the cycle of {name} is unknown",
                "write cycle_ms at its role, or GenMsgCycleTime in the database",
            )
        if role is Role.WHEEL_SPEED:
            longest_us = max(longest_us, cycle_us)
    return longest_us
