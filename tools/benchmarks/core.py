"""The service core on the contract's full input set, without an estimator, against real time."""

import time
from statistics import median

from adhesion_can.config import load_configuration
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

DURATION_S, RUNS, TARGET = 20.0, 7, 30.0


class Known:
    """Stands in for an estimator: takes the samples and says the same each time."""

    def __init__(self, estimate):
        self.estimate = estimate

    def update(self, samples, now_us):  # noqa: ARG002
        return self.estimate


def seconds_for(core, frames):
    began = time.perf_counter()
    answers = 0
    for frame in frames:
        answers += len(core.feed(frame))
    return time.perf_counter() - began, answers


def main():
    config = load_configuration()
    simulation = Simulation(RunSettings(scenario_by_name("dry"), DURATION_S), config.database)
    frames = [frame for step in simulation.run() for frame in step]
    core = ServiceCore(config)
    seconds_for(core, frames)
    estimate = core.estimate  # so that every output carries numbers
    bare, full = [], []
    for _ in range(RUNS):
        spent, answers = seconds_for(ServiceCore(config, lambda: Known(estimate)), frames)
        bare.append(DURATION_S / spent)
        full.append(DURATION_S / seconds_for(ServiceCore(config), frames)[0])
    print(
        f"{len(frames) / DURATION_S:.0f} frames/s in, {answers / DURATION_S:.0f} out, "
        f"{DURATION_S:.0f} s, median of {RUNS}"
    )
    met = "met" if median(bare) >= TARGET else "MISSED"
    print(
        f"  without an estimator: {median(bare):.0f} times real time (target {TARGET:.0f}: {met})"
    )
    print(f"  with the {config.estimator}: {median(full):.0f} times real time")


if __name__ == "__main__":
    main()
