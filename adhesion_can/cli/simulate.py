"""`simulate`: the locomotive, as a log as fast as it goes or on a bus in real time."""

import argparse
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import can

from adhesion_can.api.simulation import (
    DURATION_S,
    build_run_settings,
    drive_plan,
    drive_with_reliefs,
    make_simulation,
)
from adhesion_can.bus.frame import Frame
from adhesion_can.cli.bus_options import add_bus, bus_is_configured, bus_opener
from adhesion_can.cli.common import (
    add_configuration,
    add_model,
    configuration,
    progress,
)
from adhesion_can.cli.outputs import add_file, require_candump_name, require_outputs, write_json
from adhesion_can.cli.silence import SilenceWatch, bus_name
from adhesion_can.config import Configuration
from adhesion_can.config.plan_file import read_plan
from adhesion_can.errors import BusError, InputError
from adhesion_can.files import whole_file
from adhesion_can.physics.driving_plan import DrivingPlan
from adhesion_can.printable import say
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.python_can_messages import from_message, to_message
from adhesion_can.reporting.provenance import provenance
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.effect_option import SYNTAX, effects_help
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import SCENARIOS


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    names = "\n".join(f"  {s.name:20}{s.meaning}" for s in SCENARIOS)
    parser.description = (
        f"Scenarios:\n{names}\n\nEffects, with the default sizes of --effect "
        f"NAME:\n{effects_help()}"
    )
    parser.add_argument("--scenario", required=True, metavar="NAME")
    parser.add_argument(
        "--duration", type=float, metavar="S", help="default 60, or the duration of the plan"
    )
    parser.add_argument(
        "--seed", type=int, default=1, metavar="N", help="seed of the noise (default 1)"
    )
    add_file(parser, "--log", "F.log", "write candump text", require_candump_name)
    add_file(parser, "--truth", "F.json", "write the true values")
    parser.add_argument(
        "--effect", action="append", default=[], metavar=SYNTAX, help="may be repeated"
    )
    add_model(
        parser,
        "its effects act on the surfaces of the scenario, not on its own base curve; the service "
        "of --closed-loop knows them",
    )
    parser.add_argument(
        "--closed-loop",
        action="store_true",
        help="the drive follows AdhesionSetpoint, or the efforts demanded by 'control'",
    )
    parser.add_argument(
        "--plan",
        type=Path,
        metavar="PLAN.toml",
        help=(
            "start at the plan's speed; needs --closed-loop. With --log, a controller drives "
            "the plan in simulated time; on a bus, 'control --plan' drives it"
        ),
    )
    parser.add_argument(
        "--no-radar",
        action="store_true",
        help=(
            "send no vehicle speed; the drive relieves one axle after the other of its effort, so "
            "that [observed_speed] finds it"
        ),
    )
    parser.add_argument(
        "--load-transfer", action="store_true", help="transfer axle load under effort"
    )
    parser.add_argument(
        "--along-track",
        action="store_true",
        help="each axle meets a change of the surface at the place where the first one met it",
    )
    add_configuration(parser)
    add_bus(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    plan = None if options.plan is None else read_plan(options.plan)
    if plan is not None and not options.closed_loop:
        raise InputError("--plan", "nothing would drive the plan", "add --closed-loop")
    if options.no_radar and (options.closed_loop or plan is not None):
        raise InputError(
            "--no-radar",
            "its drive makes reliefs of its own and takes no setpoints",
            "omit --closed-loop and --plan",
        )
    settings = _settings(options, config, plan)
    on_bus = "interface" in options or "channel" in options
    if options.log is None:
        on_bus = on_bus or bus_is_configured()
    if on_bus is (options.log is not None):
        given = "both are given" if on_bus else "neither is given"
        raise InputError("--log and -i", given, "name a log, or a bus with -i and -c")
    require_outputs(options, [config.database.path])
    simulation = make_simulation(settings, config, no_radar=options.no_radar)
    if plan is not None:
        simulation.await_demands()
    steps = drive_with_reliefs(simulation) if options.no_radar else simulation.run()
    if on_bus:
        with bus_opener(options)() as bus:
            where = bus_name(options, str(bus.channel_info))
            sent = _on_bus(simulation, steps, bus, where)
    else:
        where = str(options.log)
        core = ServiceCore(config) if options.closed_loop and plan is None else None
        if plan is not None:
            steps = drive_plan(simulation, config, plan)
        sent = _to_log(simulation, steps, options.log, core)
    say(
        f"{where}: {sent} frames of {settings.duration_s:g} s of '{settings.scenario.name}'",
        sys.stdout,
    )
    for note in simulation.notes():
        say(note, sys.stdout)
    if options.truth is not None:
        write_json(str(options.truth), {**simulation.truth(), **provenance(config)})
    return 0


def _settings(
    options: argparse.Namespace, config: Configuration, plan: DrivingPlan | None
) -> RunSettings:
    duration = options.duration
    if duration is None:
        duration = DURATION_S if plan is None else plan.duration_s
    return build_run_settings(
        options.scenario,
        duration,
        options.seed,
        options.effect,
        config,
        prefix="--",
        obey=options.closed_loop,
        load_transfer=options.load_transfer,
        along_track=options.along_track,
        plan=plan,
    )


def _to_log(
    simulation: Simulation, steps: Iterable[list[Frame]], path: Path, core: ServiceCore | None
) -> int:
    """Write the drive; returns the number of its frames."""
    duration, count = simulation.settings.duration_s, 0
    with whole_file(path) as file, progress("simulating", duration, "s") as show:
        for frames in steps:
            for frame in frames:
                if core is not None:
                    _answer(simulation, core, frame, file)
                file.write(format_frame(frame))
            count += len(frames)
            if simulation.now_us % 1_000_000 == 0:
                show(simulation.now_us / 1e6)
    return count


def _answer(simulation: Simulation, core: ServiceCore, frame: Frame, file: Any) -> None:
    """Let the service answer and the drive receive it, before the frame is written after it."""
    for answer in core.feed(frame):
        file.write(format_frame(answer))
        simulation.receive(answer)


def _on_bus(
    simulation: Simulation, steps: Iterable[list[Frame]], bus: can.BusABC, name: str
) -> int:
    """Send the drive in real time; returns the number of its frames."""
    began, count = time.monotonic(), 0
    silence = SilenceWatch(
        f"--closed-loop: no service on {name} yet, so the drive probes on its own; start "
        "'adhesion-can run' there",
        say,
    )
    with progress("simulating", simulation.settings.duration_s, "s") as show:
        for frames in steps:
            ahead = simulation.now_us / 1e6 - (time.monotonic() - began)
            if ahead > 0:
                time.sleep(ahead)
            try:
                for frame in frames:
                    bus.send(to_message(frame))
                while (message := bus.recv(0.0)) is not None:
                    simulation.receive(from_message(message))
                count += len(frames)
            except (can.CanError, OSError) as error:
                raise BusError(
                    name,
                    f"the bus is gone ({error})",
                    "bring it up and start again",
                ) from error
            if simulation.settings.obey:
                silence.look(heard=simulation.is_answered)
            if simulation.now_us % 1_000_000 == 0:
                show(simulation.now_us / 1e6)
    return count
