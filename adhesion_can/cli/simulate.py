"""`simulate`: the locomotive, as a log as fast as it goes or on a bus in real time."""

import argparse
import time
from pathlib import Path
from typing import Any

import can

from adhesion_can.bus.database import load_database
from adhesion_can.bus.frame import Frame
from adhesion_can.cli.common import (
    add_bus,
    add_configuration,
    add_model,
    bus_is_configured,
    bus_opener,
    configuration,
    progress,
    require_outputs,
    require_positive,
    write_json,
)
from adhesion_can.cli.effect_option import SYNTAX, effects_help, parse_effects
from adhesion_can.config import Configuration
from adhesion_can.errors import BusError, InputError
from adhesion_can.estimation.extended.correction import require_axles, require_channels
from adhesion_can.files import whole_file
from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.effects import ActiveEffect
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.recording import from_message, to_message
from adhesion_can.reporting.provenance import provenance
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import SCENARIOS, scenario_by_name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    names = "\n".join(f"  {s.name:20}{s.meaning}" for s in SCENARIOS)
    parser.description = (
        f"Scenarios:\n{names}\n\nEffects, with what --effect NAME alone takes:\n{effects_help()}"
    )
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--scenario", required=True, metavar="NAME")
    parser.add_argument("--duration", type=float, default=60.0, metavar="S", help="default 60")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the noise (default 1)")
    parser.add_argument("--log", type=Path, metavar="F.log", help="write candump text")
    parser.add_argument("--truth", type=Path, metavar="F.json", help="write what is true")
    parser.add_argument(
        "--effect", action="append", default=[], metavar=SYNTAX, help="may be repeated"
    )
    add_model(
        parser,
        "its effects act here, on the rails of the scenario and not on its own base curve; the "
        "service of --closed-loop knows them",
    )
    parser.add_argument(
        "--closed-loop", action="store_true", help="the drive obeys AdhesionSetpoint"
    )
    parser.add_argument("--load-transfer", action="store_true", help="axle loads move under effort")
    parser.add_argument(
        "--along-track",
        action="store_true",
        help="each axle finds a change of the rail where the first one found it",
    )
    add_configuration(parser)
    add_bus(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    settings = _settings(options)
    config = configuration(options)
    database = load_database(options.dbc)
    on_bus = "interface" in options or "channel" in options
    if options.log is None:
        on_bus = on_bus or bus_is_configured()
    if on_bus is (options.log is not None):
        raise InputError("simulate", "give either --log or a bus (-i, -c)", "choose one of them")
    written = {"--log": options.log, "--truth": options.truth}
    require_outputs(options, written, [config.database.path])
    simulation = Simulation(settings, database)
    if on_bus:
        with bus_opener(options)() as bus:
            _on_bus(simulation, bus)
    else:
        core = ServiceCore(config) if options.closed_loop else None
        _to_log(simulation, options.log, core)
    if options.truth is not None:
        write_json(str(options.truth), {**simulation.truth(), **provenance(config)})
    return 0


def _settings(options: argparse.Namespace) -> RunSettings:
    require_positive(options.duration, "--duration")
    if options.seed < 0:
        raise InputError("--seed", f"{options.seed} is negative", "give 0 or more")
    try:
        scenario = scenario_by_name(options.scenario)
    except KeyError as error:
        raise InputError(
            "--scenario",
            f"no scenario {options.scenario!r}",
            f"known: {', '.join(s.name for s in SCENARIOS)}",
        ) from error
    config = configuration(options)
    return RunSettings(
        scenario,
        options.duration,
        seed=options.seed,
        vehicle=config.vehicle,
        effects=(*parse_effects(options.effect, config.vehicle), *_of_model(config, options)),
        obey=options.closed_loop,
        load_transfer=options.load_transfer,
        along_track=options.along_track,
    )


def _of_model(config: Configuration, options: argparse.Namespace) -> tuple[ActiveEffect, ...]:
    """Effects of --model, which must be possible here and not given by --effect as well."""
    model = config.model
    if model is None:
        return ()
    mend = "take the spline out of the model"
    require_channels(model, COVARIATES.values(), "the simulated locomotive", mend)
    require_axles(model, config.vehicle.axles)
    given = {text.partition("=")[0].partition(":")[0] for text in options.effect}
    for active in model.effects:
        if active.effect.id in given:
            raise InputError(
                f"--effect {active.effect.id}", "is in the --model as well", "give it once"
            )
    return model.actives


def _to_log(simulation: Simulation, path: Path, core: ServiceCore | None) -> None:
    duration = simulation.settings.duration_s
    with whole_file(path) as file, progress("simulating", duration, "s") as show:
        for frames in simulation.run():
            for frame in frames:
                if core is not None:
                    _answer(simulation, core, frame, file)
                file.write(format_frame(frame))
            if simulation.now_us % 1_000_000 == 0:
                show(simulation.now_us / 1e6)


def _answer(simulation: Simulation, core: ServiceCore, frame: Frame, file: Any) -> None:
    """Let the service answer and the drive receive it, before the frame is written after it."""
    for answer in core.feed(frame):
        file.write(format_frame(answer))
        simulation.receive(answer)


def _on_bus(simulation: Simulation, bus: can.BusABC) -> None:
    began = time.monotonic()
    with progress("simulating", simulation.settings.duration_s, "s") as show:
        for frames in simulation.run():
            ahead = simulation.now_us / 1e6 - (time.monotonic() - began)
            if ahead > 0:
                time.sleep(ahead)
            try:
                for frame in frames:
                    bus.send(to_message(frame))
                _receive_all(simulation, bus)
            except (can.CanError, OSError) as error:
                raise BusError(
                    str(bus.channel_info),
                    f"the bus is gone ({error})",
                    "bring it up and begin again",
                ) from error
            if simulation.now_us % 1_000_000 == 0:
                show(simulation.now_us / 1e6)


def _receive_all(simulation: Simulation, bus: can.BusABC) -> None:
    while (message := bus.recv(0.0)) is not None:
        simulation.receive(from_message(message))
