"""The service as a slave: readings in, setpoints out.

The readings are fed at the start of a step and the core is brought to its end, so a setpoint uses
what was read before its due time, as on a bus.
"""

from collections.abc import Iterable
from dataclasses import replace

from adhesion_can.config import Configuration
from adhesion_can.fmu.signals import cycle_variable, group_signals, signal_variable
from adhesion_can.fmu.slave import Cycle
from adhesion_can.fmu.variables import (
    DOUBT,
    OBJECTION,
    STATUS,
    Causality,
    Values,
    Variable,
    available,
    enumerated,
    finite,
    in_order,
)
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.readings import Reading, Role
from adhesion_can.physics.status import Status
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.outputs import Outputs, Setpoint

_OUTPUT = Causality.OUTPUT


class ReadingsCore(ServiceCore):
    """The core without its receiver: readings in place of frames.

    Nothing is checked that belongs to a bus: ranges, counters, or signals that stand still.
    """

    def feed_readings(self, t_us: int, readings: Iterable[Reading]) -> None:
        """Bring the core to a time, µs, and give it the readings of that time."""
        self.advance(t_us)
        if not self.schedule.started:
            self.start(t_us)
            self._inputs.start(t_us)
            self.emit(t_us, self._inputs.snapshot)
        self._inputs.add(readings)
        self.use_speed_source(self._inputs.speed_source)


class ServiceSlave:
    """The service, by the signals of a configuration.

    Args:
        configuration: Vehicle, roles, cycles, settings and extended model.

    Raises:
        ConfigError: The roles do not suffice to estimate adhesion.

    """

    def __init__(self, configuration: Configuration) -> None:
        configuration.require_service()
        self._configuration = configuration
        channels = configuration.channels
        self._groups = group_signals(configuration.messages)
        inputs = {
            key: signal_variable(key, Causality.INPUT, channels)
            for group in self._groups
            for key in group.keys
        }
        self._names = {key: variable.name for key, variable in inputs.items()}
        parameters = [
            cycle_variable(group, [self._names[key] for key in group.keys])
            for group in self._groups
        ]
        signals = set(self._names)
        self._axles = [
            axle
            for role, axle in sorted(signals)
            if role is Role.WHEEL_SPEED and (Role.TRACTIVE_EFFORT, axle) in signals
        ]
        outputs = [*output_variables(_OUTPUT), *axle_variables(self._axles)]
        self._variables = in_order([*parameters, *inputs.values(), *outputs])

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Cycles, readings, and the contents of the service's messages."""
        return self._variables

    def setup(self, values: Values, start_us: int) -> Values:
        """Start with a fresh core, as `Slave.setup` defines it."""
        self._cycles = [
            Cycle(group.parameter, values[group.parameter], start_us) for group in self._groups
        ]
        self._core = ReadingsCore(self._with_cycles())
        return self._outputs()

    def step(self, from_us: int, until_us: int, values: Values) -> Values:
        """Feed the readings that are due and advance, as `Slave.step` defines it."""
        readings = [
            Reading(from_us, key.role, key.axle, finite(values[self._names[key]]))
            for group, cycle in zip(self._groups, self._cycles, strict=True)
            if cycle.is_due(from_us, until_us)
            for key in group.keys
        ]
        if readings:
            self._core.feed_readings(from_us, readings)
        self._core.advance(until_us)
        return self._outputs()

    def _with_cycles(self) -> Configuration:
        """The configuration with the cycles of the parameters."""
        cycles = {
            (group.message.plan.name, group.message.channel): cycle.cycle_us
            for group, cycle in zip(self._groups, self._cycles, strict=True)
        }
        choices = tuple(
            replace(choice, cycle_us=cycles[choice.message, choice.channel])
            for choice in self._configuration.choices
        )
        return replace(self._configuration, choices=choices)

    def _outputs(self) -> Values:
        outputs = self._core.outputs
        values = output_values(outputs)
        for axle in self._axles:
            values |= setpoint_values(outputs.axles.get(axle, Setpoint()), f"_{axle}")
        return values


def output_variables(causality: Causality) -> list[Variable]:
    """Contents of the service's messages: outputs of the service, inputs of who uses it."""
    return [
        enumerated("status", causality, STATUS, "status of the service", Status.INIT),
        enumerated(
            "doubt",
            causality,
            DOUBT,
            "condition that the residual depends on, where the curve cannot explain it",
            Doubt.NOT_AVAILABLE,
        ),
        enumerated(
            "objection",
            causality,
            OBJECTION,
            "reading that cannot be right, so that the peak is not vouched for",
            Objection.NONE,
        ),
        Variable("mu_max", causality, "largest adhesion coefficient", "1"),
        Variable(
            "mu_max_std",
            causality,
            "standard deviation of mu_max; infinite where it is not identifiable",
            "1",
        ),
        Variable("lambda_m", causality, "slip ratio of the largest adhesion", "1"),
        Variable(
            "lambda_m_std",
            causality,
            "standard deviation of lambda_m; infinite where it is not identifiable",
            "1",
        ),
        Variable("creep_speed_setpoint", causality, "creep speed to hold", "m/s"),
        *(
            Variable(name, causality, f"{name} of Burckhardt's curve", "1")
            for name in ("c1", "c2", "c3")
        ),
        Variable("surface_age", causality, "time since the rail last changed", "s"),
    ]


def axle_variables(axles: Iterable[int]) -> list[Variable]:
    """Setpoints by axle, as outputs."""
    variables = []
    for axle in axles:
        variables += [
            Variable(f"mu_max_{axle}", _OUTPUT, f"axle {axle}: largest adhesion coefficient", "1"),
            Variable(
                f"lambda_m_{axle}", _OUTPUT, f"axle {axle}: slip ratio of the largest adhesion", "1"
            ),
            Variable(
                f"creep_speed_setpoint_{axle}", _OUTPUT, f"axle {axle}: creep speed to hold", "m/s"
            ),
        ]
    return variables


def output_values(outputs: Outputs) -> dict[str, float]:
    """Values of `output_variables`."""
    theta = outputs.theta or (None, None, None)
    return {
        "status": float(outputs.status),
        "doubt": float(outputs.doubt),
        "objection": float(outputs.objection),
        **setpoint_values(outputs.setpoint, ""),
        "mu_max_std": available(outputs.mu_max_std),
        "lambda_m_std": available(outputs.lambda_m_std),
        **{name: available(c) for name, c in zip(("c1", "c2", "c3"), theta, strict=True)},
        "surface_age": available(outputs.surface_age_s),
    }


def setpoint_values(setpoint: Setpoint, suffix: str) -> dict[str, float]:
    """Values of a setpoint by the names of the variables with a suffix."""
    return {
        f"mu_max{suffix}": available(setpoint.mu_max),
        f"lambda_m{suffix}": available(setpoint.lambda_m),
        f"creep_speed_setpoint{suffix}": available(setpoint.creep_speed),
    }
