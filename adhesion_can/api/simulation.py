"""Simulated drives: frames of a locomotive on surfaces of known truth."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from adhesion_can.api.configuration import ConfigurationLike, ModelLike, as_configuration
from adhesion_can.bus.frame import Frame
from adhesion_can.bus.roles import BoundMessage, packaged_choices
from adhesion_can.config.configuration import Configuration
from adhesion_can.config.plan_file import read_plan
from adhesion_can.control.frames import ControllerOnBus, build_follower
from adhesion_can.control.relieving_drive import DriveState, RelievingDrive
from adhesion_can.errors import InputError
from adhesion_can.estimation.extended.correction import require_axles, require_channels
from adhesion_can.files import whole_file
from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.driving_plan import DrivingPlan
from adhesion_can.physics.effects import ActiveEffect
from adhesion_can.physics.readings import Role
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.formats import require_text_name
from adhesion_can.result_text import html_table
from adhesion_can.simulation.effect_option import parse_effects
from adhesion_can.simulation.own_vehicle import drive_of, noise_of, scenario_of
from adhesion_can.simulation.refusals import require_simulable
from adhesion_can.simulation.role_sensors import packaged_messages
from adhesion_can.simulation.run import STEP_US, RunSettings, Simulation
from adhesion_can.simulation.scenarios import SCENARIOS, scenario_by_name
from adhesion_can.simulation.sensors import SLOT_US

DURATION_S = 60.0
"""Simulated time where none is given, s."""


@dataclass(frozen=True)
class SimulatedDrive:
    """Frames of a simulated locomotive, with the truth behind them.

    Attributes:
        frames: Frames in the order of their stamps.
        truth: Surfaces, vehicle, effects and noise of the simulation, as `simulate --truth` has
            them.

    """

    frames: tuple[Frame, ...]
    truth: Mapping[str, Any]

    def write(self, path: str | Path) -> Path:
        """Write the frames as candump text, gzip where the suffix is .gz; returns the path."""
        path = Path(path)
        require_text_name(path, str(path))
        with whole_file(path) as file:
            file.writelines(map(format_frame, self.frames))
        return path

    def to_dict(self) -> dict[str, Any]:
        """The truth, as JSON has it."""
        return dict(self.truth)

    def _repr_html_(self) -> str:
        rows = [
            (
                f"{surface['from_s']:g} .. {surface['to_s']:g}",
                surface["name"],
                f"{surface['mu_max']:.4f}",
                f"{surface['lambda_m']:.4f}",
            )
            for surface in self.truth["surfaces"]
        ]
        title = f"Scenario {self.truth['scenario']}: {len(self.frames)} frames"
        return html_table(title, ("time s", "surface", "mu_max", "lambda_m"), rows)


def simulate(
    scenario: str,
    duration_s: float | None = None,
    seed: int = 1,
    *,
    effects: Mapping[str, float | None] | Iterable[str] = (),
    configuration: ConfigurationLike = None,
    model: ModelLike = None,
    plan: DrivingPlan | str | Path | None = None,
) -> SimulatedDrive:
    """Simulate a drive.

    Args:
        scenario: Name of the scenario: 'dry', 'wet', 'greasy', 'sweep' and others.
        duration_s: Simulated time, s; None: 60 s, or that of the plan.
        seed: Seed of the noise, 0 or more.
        effects: Sizes of effects by name, None for the typical size; or texts as `--effect` takes
            them.
        configuration: Vehicle, database, roles and settings.
        model: Extended model whose effects act in the simulation.
        plan: Driving plan that a controller follows, or its file; None: the drive of the scenario.

    Raises:
        InputError: The scenario or an effect is unknown, or a value is out of range.

    Examples:
        >>> drive = simulate("dry", duration_s=0.1)
        >>> drive.truth["surfaces"][0]["name"]
        'dry'

    """
    config = as_configuration(configuration, model)
    if isinstance(effects, Mapping):
        effects = [name if size is None else f"{name}={size!r}" for name, size in effects.items()]
    if isinstance(plan, str | Path):
        plan = read_plan(Path(plan))
    if duration_s is None:
        duration_s = DURATION_S if plan is None else plan.duration_s
    settings = build_run_settings(scenario, duration_s, seed, effects, config, plan=plan)
    simulation = make_simulation(settings, config)
    steps = simulation.run() if plan is None else drive_plan(simulation, config, plan)
    frames = tuple(frame for step in steps for frame in step)
    return SimulatedDrive(frames, simulation.truth())


def make_simulation(
    settings: RunSettings, config: Configuration, slot_us: int = SLOT_US, *, no_radar: bool = False
) -> Simulation:
    """A simulation that writes the configured database, by the roles of its signals.

    Args:
        settings: Settings of the run.
        config: Database and roles.
        slot_us: Time from one message's first frame to that of the next, µs; 0: they are in phase.
        no_radar: Whether the messages with the vehicle speed are not sent.

    Raises:
        ConfigError: Several axles share an effort, or a signal without a factor of each, or a
            message has no cycle.
        InputError: A value does not fit into its signal.

    """
    config.require_distinct_signals()
    own_messages = () if _is_packaged(config) else config.messages
    require_simulable(config.choices, own_messages, config.where)
    messages = sent_messages(config)
    if no_radar:
        messages = _without_speed(messages)
    return Simulation(settings, config.database, messages=messages, slot_us=slot_us)


def _without_speed(messages: tuple[BoundMessage, ...]) -> tuple[BoundMessage, ...]:
    """The messages but for those with the vehicle speed."""
    needed = {Role.WHEEL_SPEED, Role.TRACTIVE_EFFORT}
    for message in messages:
        if Role.VEHICLE_SPEED in message.roles and message.roles & needed:
            raise InputError(
                "--no-radar",
                f"{message.plan.name} carries the vehicle speed, and wheel speeds or efforts",
                "use a database with a message of its own for the vehicle speed",
            )
    return tuple(sent for sent in messages if Role.VEHICLE_SPEED not in sent.roles)


def sent_messages(config: Configuration) -> tuple[BoundMessage, ...]:
    """Messages that the simulated locomotive sends, in the order of the bus."""
    return packaged_messages(config.database) if _is_packaged(config) else config.messages


def _is_packaged(config: Configuration) -> bool:
    """Whether all signals are those of the packaged message set."""
    return set(config.choices) <= set(packaged_choices())


def build_run_settings(
    scenario: str,
    duration_s: float,
    seed: int,
    effects: Iterable[str],
    config: Configuration,
    *,
    prefix: str = "",
    obey: bool = False,
    load_transfer: bool = False,
    along_track: bool = False,
    plan: DrivingPlan | None = None,
) -> RunSettings:
    """Settings of a simulated run, from what a caller gave.

    Args:
        scenario: Name of the scenario.
        duration_s: Simulated time, s.
        seed: Seed of the noise.
        effects: Texts of effects, as `--effect` takes them.
        config: Vehicle, and the extended model whose effects act besides.
        prefix: Text before the names of the arguments in error messages.
        obey: Whether the drive follows the setpoints of a service.
        load_transfer: Whether the axle loads move under effort.
        along_track: Whether each axle meets a change of surface where the leading one met it.
        plan: Driving plan that a controller follows; the run starts at its speed.

    Raises:
        InputError: A name is unknown, or a value is out of range.

    """
    if not (isfinite(duration_s) and duration_s > 0):
        raise InputError(
            f"{prefix}duration", f"{duration_s} is not a positive number", "give seconds above 0"
        )
    if seed < 0:
        raise InputError(f"{prefix}seed", f"{seed} is negative", "give 0 or more")
    try:
        chosen = scenario_by_name(scenario)
    except KeyError as error:
        raise InputError(
            f"{prefix}scenario",
            f"no scenario {scenario!r}",
            f"known: {', '.join(s.name for s in SCENARIOS)}",
        ) from error
    texts = list(effects)
    drive, notes = drive_of(config.vehicle, config.limits, config.messages)
    if plan is None:
        chosen, more = scenario_of(
            chosen, config.vehicle, config.limits, config.messages, drive.slip_high
        )
        notes += more
    return RunSettings(
        chosen,
        duration_s,
        seed=seed,
        vehicle=config.vehicle,
        effects=(*parse_effects(texts, config.vehicle), *_effects_of_model(config, texts, prefix)),
        noise=noise_of(config.vehicle),
        drive=drive,
        obey=obey or plan is not None,
        load_transfer=load_transfer,
        along_track=along_track,
        start_speed=None if plan is None else plan.start_speed,
        notes=notes,
    )


def drive_plan(
    simulation: Simulation, config: Configuration, plan: DrivingPlan
) -> Iterator[list[Frame]]:
    """Steps of a run in which a controller follows a plan, in simulated time.

    Locomotive and controller exchange frames as on a bus.

    Args:
        simulation: Run whose drive obeys.
        config: Database, roles and vehicle.
        plan: Plan to drive.

    Yields:
        The locomotive's frames of each step, each followed by the demands that answer it.

    Raises:
        ConfigError: The vehicle cannot drive the plan, or its speeds have no roles.

    """
    follower = build_follower(config, plan)
    controller = ControllerOnBus(config, follower, lambda: follower.sanding)
    simulation.await_demands()
    for frames in simulation.run():
        sent: list[Frame] = []
        for frame in frames:
            sent.append(frame)
            for demand in controller.feed(frame):
                simulation.receive(demand)
                sent.append(demand)
        yield sent


PEAKS_EACH = 25
"""Steps of the simulation after which the rail under the axles is looked at again: 50 ms."""


def drive_with_reliefs(simulation: Simulation) -> Iterator[list[Frame]]:
    """Steps of a run in which one axle after the other is relieved of its effort.

    The drive knows vehicle speed and rail, as all simulated drives do; its frames carry neither.

    Args:
        simulation: Run, whose motors are given over to the drive.

    Yields:
        The locomotive's frames of each step.

    """
    plant, gains = simulation.plant, simulation.settings.drive
    axles = simulation.settings.vehicle.axles
    drive = RelievingDrive(axles, gains.gain, gains.integral_gain)
    simulation.await_demands()
    for number, frames in enumerate(simulation.run()):
        if number % PEAKS_EACH == 0:
            mu_max, peak_slip = simulation.find_peaks()
        creep = plant.radius * plant.wheel_speed - plant.speed
        time_s = simulation.now_us / 1e6
        state = DriveState(
            time_s, plant.speed, creep, simulation.effort, mu_max * plant.load, peak_slip
        )
        efforts = drive.step(state, STEP_US / 1e6)
        simulation.demand_efforts({axle: float(x) for axle, x in enumerate(efforts, 1)})
        yield frames


def _effects_of_model(
    config: Configuration, texts: Iterable[str], prefix: str
) -> tuple[ActiveEffect, ...]:
    """Effects of the extended model, which must be possible here and not given twice."""
    model = config.model
    if model is None:
        return ()
    fix = "remove the spline from the model"
    require_channels(model, COVARIATES.values(), "the simulated locomotive", fix)
    require_axles(model, config.vehicle.axles)
    given = {text.partition("=")[0].partition(":")[0] for text in texts}
    for active in model.effects:
        if active.effect.id in given:
            raise InputError(
                f"{prefix}effect {active.effect.id}",
                f"is also in the {prefix}model",
                "give it once",
            )
    return model.actives
