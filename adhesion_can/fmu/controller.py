"""The reference creep controller as a slave: readings and setpoints in, efforts out."""

from enum import IntEnum
from typing import TypeVar

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.config import Configuration
from adhesion_can.control.frames import build_reference, find_cycle_us
from adhesion_can.control.inputs import Advice, Measurement
from adhesion_can.errors import InputError
from adhesion_can.fmu.service import output_variables
from adhesion_can.fmu.signals import SignalKey, signal_variable
from adhesion_can.fmu.slave import Cycle
from adhesion_can.fmu.variables import Causality, Values, Variable, in_order, known
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.readings import Role
from adhesion_can.physics.status import Status

CYCLE, SPEED_CYCLE = "cycle", "cycle_vehicle_speed"
"""Parameters: the controller's own cycle, and that of the vehicle speed."""
_USED = (
    "status", "doubt", "objection", "lambda_m", "lambda_m_std", "c1", "c2", "c3",
)  # fmt: skip
"""Outputs of the service that the controller reads."""
Item = TypeVar("Item", bound=IntEnum)
_BY_AXLE = (Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT, Role.AXLE_LOAD)


class ControllerSlave:
    """The reference creep controller for the vehicle of a configuration.

    Args:
        configuration: Vehicle, roles and cycles.

    Raises:
        ConfigError: A wheel speed or the vehicle speed has no role, its cycle is unknown, or the
            vehicle cannot be controlled.

    """

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        build_reference(configuration)  # raises where there can be none
        self._axles = range(1, configuration.vehicle.axles + 1)
        self._radius = np.array(configuration.vehicle.wheel_radius)
        speed_us = next(
            message.cycle_us or 0
            for message in configuration.messages
            if Role.VEHICLE_SPEED in message.roles
        )
        cycles = [
            Variable(
                CYCLE,
                Causality.PARAMETER,
                "time from one step of the controller to the next",
                "s",
                find_cycle_us(configuration) / 1e6,
            ),
            Variable(
                SPEED_CYCLE,
                Causality.PARAMETER,
                "time from one reading of vehicle_speed to the next",
                "s",
                speed_us / 1e6,
            ),
        ]
        keys = [SignalKey(role, axle) for role in _BY_AXLE for axle in self._axles]
        keys.append(SignalKey(Role.VEHICLE_SPEED, 0))
        advice = [
            variable for variable in output_variables(Causality.INPUT) if variable.name in _USED
        ]
        peak_slips = [
            Variable(
                f"lambda_m_{axle}",
                Causality.INPUT,
                f"axle {axle}: slip ratio of the largest adhesion",
                "1",
            )
            for axle in self._axles
        ]
        demands = [
            Variable(f"effort_demand_{axle}", Causality.OUTPUT, f"axle {axle}: effort to give", "N")
            for axle in self._axles
        ]
        readings = [signal_variable(key, Causality.INPUT) for key in keys]
        self._variables = in_order([*cycles, *readings, *advice, *peak_slips, *demands])

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Cycles, readings, outputs of the service, and efforts."""
        return self._variables

    def setup(self, values: Values, start_us: int) -> Values:
        """Start with a fresh controller that demands no effort, as `Slave.setup` defines it."""
        self._cycle = Cycle(CYCLE, values[CYCLE], start_us)
        self._speed_cycle = Cycle(SPEED_CYCLE, values[SPEED_CYCLE], start_us)
        if self._speed_cycle.cycle_us < self._cycle.cycle_us:
            what = f"shorter than {CYCLE}: readings would be missed"
            raise InputError(SPEED_CYCLE, what, f"give {values[CYCLE]:g} s or more")
        self._controller = build_reference(self._configuration, self._cycle.cycle_us / 1e6)
        self._effort = np.zeros(len(self._axles))
        return self._outputs()

    def step(self, from_us: int, until_us: int, values: Values) -> Values:
        """Make the controller's step where it is due, as `Slave.step` defines it."""
        if self._cycle.is_due(from_us, until_us):
            has_speed = self._speed_cycle.is_due(from_us, until_us)
            measured = self._measure(from_us, values, has_speed=has_speed)
            self._effort = self._controller.step(measured, self._advice(values))
        return self._outputs()

    def _measure(self, t_us: int, values: Values, *, has_speed: bool) -> Measurement:
        effort = np.nan_to_num(self._by_axle(Role.TRACTIVE_EFFORT, values))
        load = self._by_axle(Role.AXLE_LOAD, values)
        return Measurement(
            t_us / 1e6,
            known(values[Role.VEHICLE_SPEED]) if has_speed else None,
            self._by_axle(Role.WHEEL_SPEED, values) * self._radius,
            effort,
            np.where(load > 0.0, load, self._configuration.vehicle.loads(effort)),
        )

    def _by_axle(self, role: Role, values: Values) -> Array:
        return np.array([values[f"{role}_{axle}"] for axle in self._axles])

    def _advice(self, values: Values) -> Advice:
        c1, c2, c3 = (known(values[name]) for name in ("c1", "c2", "c3"))
        peak_slips = {axle: known(values[f"lambda_m_{axle}"]) for axle in self._axles}
        return Advice(
            status=_item(Status, "status", values),
            doubt=_item(Doubt, "doubt", values),
            lambda_m=known(values["lambda_m"]),
            lambda_m_std=known(values["lambda_m_std"]),
            theta=None if c1 is None or c2 is None or c3 is None else (c1, c2, c3),
            axles={axle: slip for axle, slip in peak_slips.items() if slip is not None},
            objection=_item(Objection, "objection", values),
        )

    def _outputs(self) -> Values:
        efforts = zip(self._axles, self._effort.tolist(), strict=True)
        return {f"effort_demand_{axle}": effort for axle, effort in efforts}


def _item(kind: type[Item], name: str, values: Values) -> Item:
    """Item of an enumeration that an input carries."""
    try:
        return kind(int(values[name]))
    except ValueError as error:
        numbers = ", ".join(str(member.value) for member in kind)
        raise InputError(
            name, f"no item has the number {values[name]:g}", f"known: {numbers}"
        ) from error
