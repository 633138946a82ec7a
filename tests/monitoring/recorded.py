"""A closed loop of a few seconds: what the locomotive and the service put on their bus."""

from functools import cache

from adhesion_can.config import load_configuration
from adhesion_can.recordings.candump import format_frame
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

DURATION_S = 8.0
OWN = {0x201, 0x202, 0x203, 0x204, 0x211}


@cache
def closed_loop():
    """Frames of both, in the order of their stamps, and the simulation."""
    config = load_configuration()
    settings = RunSettings(scenario_by_name("dry"), DURATION_S, obey=True)
    simulation = Simulation(settings, config.database)
    core = ServiceCore(config)
    frames = []
    for due in simulation.run():
        for frame in due:
            for answer in core.feed(frame):
                simulation.receive(answer)
                frames.append(answer)
            frames.append(frame)
    return tuple(frames), simulation


def write_log(path, frames):
    """The frames as candump text."""
    path.write_text("".join(format_frame(frame) for frame in frames))
    return path
