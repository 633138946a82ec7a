"""The simulated locomotive as a slave: efforts or setpoints in, readings and the truth out.

Readings are those that a bus would carry, with noise, resolution and cycles of their messages, but
all messages are in phase, so that a master with a coarse step gets them at their stamps.
"""

from collections.abc import Iterable
from math import isfinite

from adhesion_can.api.simulation import build_run_settings, make_simulation, sent_messages
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.receiver import decode
from adhesion_can.config import Configuration
from adhesion_can.errors import InputError
from adhesion_can.fmu.signals import SignalKey, signal_variable
from adhesion_can.fmu.variables import (
    STATUS,
    Causality,
    EnumerationType,
    Values,
    Variable,
    VariableType,
    available,
    enumerated,
    finite,
    in_order,
)
from adhesion_can.physics.readings import Role
from adhesion_can.physics.status import Status
from adhesion_can.simulation.run import STEP_US
from adhesion_can.simulation.scenarios import SCENARIOS

SCENARIO = EnumerationType(
    "Scenario",
    tuple(
        (scenario.name, number, scenario.meaning) for number, scenario in enumerate(SCENARIOS, 1)
    ),
)
DEFAULT_SCENARIO = "dry-wet-greasy-dry"
_PARAMETER, _INPUT, _OUTPUT = Causality


class LocomotiveSlave:
    """The locomotive of a configuration on the rail of a scenario.

    Args:
        configuration: Vehicle, database, roles, and the extended model whose effects act.

    Raises:
        ConfigError: The configuration cannot be simulated.

    """

    def __init__(self, configuration: Configuration) -> None:
        self._configuration = configuration
        self._axles = range(1, configuration.vehicle.axles + 1)
        self._messages = {
            (message.plan.frame_id, message.plan.is_extended, message.channel or ""): message
            for message in sent_messages(configuration)
        }
        keys = [
            SignalKey(signal.role, signal.axle)
            for message in self._messages.values()
            for signal in message.signals
            if signal.role is not Role.CHANNEL and signal.axle <= len(self._axles)
        ]
        sensors = {key: signal_variable(key, _OUTPUT) for key in keys}
        self._names = {key: variable.name for key, variable in sensors.items()}
        demands = [
            Variable(
                f"effort_demand_{axle}",
                _INPUT,
                f"axle {axle}: effort demanded by a controller; NaN on all axles from the start: "
                "the drive follows the setpoint, and probes where it is not known",
                "N",
            )
            for axle in self._axles
        ]
        setpoint = [
            enumerated("status", _INPUT, STATUS, "status of the service", Status.INIT),
            Variable("creep_speed_setpoint", _INPUT, "creep speed to hold in TRACKING", "m/s"),
        ]
        outputs = [*sensors.values(), *_truth(self._axles)]
        self._variables = in_order([*_parameters(), *demands, *setpoint, *outputs])

    @property
    def variables(self) -> tuple[Variable, ...]:
        """The run, what the drive follows, readings, and the truth."""
        return self._variables

    def setup(self, values: Values, start_us: int) -> Values:
        """Start a run, as `Slave.setup` defines it; its time is 0 at the start."""
        settings = build_run_settings(
            _scenario(values["scenario"]),
            values["duration"],
            round(values["seed"]),
            (),
            self._configuration,
            obey=True,
            load_transfer=bool(values["load_transfer"]),
            along_track=bool(values["along_track"]),
        )
        self._start_us = start_us
        self._simulation = make_simulation(settings, self._configuration, slot_us=0)
        self._is_demanded = False
        self._readings = {
            variable.name: variable.start
            for variable in self._variables
            if variable.name in self._names.values()
        }
        self._receive(self._simulation.first_frames())
        return self._outputs()

    def step(self, from_us: int, until_us: int, values: Values) -> Values:
        """Simulate until the last whole step of 2 ms, as `Slave.step` defines it."""
        del from_us  # where the run has come to is known
        simulation = self._simulation
        efforts = {axle: values[f"effort_demand_{axle}"] for axle in self._axles}
        self._is_demanded = self._is_demanded or any(map(isfinite, efforts.values()))
        while simulation.now_us + STEP_US <= until_us - self._start_us:
            if self._is_demanded:
                simulation.demand_efforts(efforts)
            simulation.take_setpoint(
                known=values["status"] == Status.TRACKING,
                creep_speed=finite(values["creep_speed_setpoint"]),
            )
            self._receive(simulation.step())
        return self._outputs()

    def _receive(self, frames: Iterable[Frame]) -> None:
        """Take the readings of the latest frames."""
        for frame in frames:
            message = self._messages[frame.arbitration_id, frame.is_extended, frame.channel]
            for reading in decode(message, frame).values:
                name = self._names.get(SignalKey(reading.role, reading.axle))
                if name is not None:
                    self._readings[name] = available(reading.value)

    def _outputs(self) -> Values:
        values, simulation = dict(self._readings), self._simulation
        mu_max, lambda_m = simulation.find_peaks()
        truth = {
            "true_mu_max": mu_max.tolist(),
            "true_lambda_m": lambda_m.tolist(),
            "true_force": simulation.plant.force.tolist(),
        }
        for name, numbers in truth.items():
            values |= {f"{name}_{axle}": x for axle, x in zip(self._axles, numbers, strict=True)}
        values["true_adhesion_used"] = simulation.adhesion_used()
        return values


def _parameters() -> list[Variable]:
    names = [rail.name for rail in SCENARIOS]
    scenario = enumerated(
        "scenario", _PARAMETER, SCENARIO, "rail of the run", 1 + names.index(DEFAULT_SCENARIO)
    )
    switches = {
        "load_transfer": "whether axle loads change under effort",
        "along_track": "whether each axle meets a change of the rail where the first one met it",
    }
    return [
        scenario,
        Variable("duration", _PARAMETER, "time over which the surfaces are spread", "s", 60.0),
        Variable("seed", _PARAMETER, "seed of the noise, 0 or more", "", 1.0, VariableType.INTEGER),
        *(
            Variable(name, _PARAMETER, meaning, "", 0.0, VariableType.BOOLEAN)
            for name, meaning in switches.items()
        ),
    ]


def _truth(axles: Iterable[int]) -> list[Variable]:
    meanings = {
        "true_mu_max": ("largest adhesion coefficient of the rail", "1"),
        "true_lambda_m": ("slip ratio of the largest adhesion", "1"),
        "true_force": ("force at the contact", "N"),
    }
    by_axle = [
        Variable(f"{name}_{axle}", _OUTPUT, f"axle {axle}: {meaning}, without error", unit)
        for name, (meaning, unit) in meanings.items()
        for axle in axles
    ]
    used = "sum of the axles' forces over the sum of their loads, without error"
    return [*by_axle, Variable("true_adhesion_used", _OUTPUT, used, "1")]


def _scenario(number: float) -> str:
    """Name of a scenario by its number."""
    if number not in range(1, len(SCENARIOS) + 1):
        raise InputError(
            "scenario", f"no scenario has the number {number:g}", f"known: {SCENARIO.legend}"
        )
    return SCENARIOS[int(number) - 1].name
