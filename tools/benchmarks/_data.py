"""Data of the benchmarks: points of known curves, and the samples of a simulated locomotive."""

import numpy as np

from adhesion_can.config import load_configuration
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.experiments.simulated_data import RATE_HZ
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.samples import Samples
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

SLIP_MAX = 0.2
"""Slips are uniform up to here where nothing else is stated, as in experiment 3."""
POOLED = 12
"""Samples of an update: six axles at 100 Hz, 20 ms."""
DECLARED = 0.5
"""Probability of a change from which it counts as declared."""


def points(rng, theta, noise_std, n, *, slip_max=SLIP_MAX, first_us=0, rate_hz=RATE_HZ):
    """Samples of one curve, n of them, with slips drawn uniformly."""
    h = rng.uniform(0.0, slip_max, n)
    z = adhesion(h, *theta) + noise_std * rng.standard_normal(n)
    stamps = first_us + np.round(np.arange(n) * (1e6 / rate_hz)).astype(np.int64)
    return Samples.curve(h, z, stamps)


def feed(estimator, samples, size=POOLED):
    """Estimates after each update of `size` samples."""
    for begin in range(0, len(samples), size):
        part = samples.select(slice(begin, begin + size))
        yield estimator.update(part, int(part.t_us[-1]))


class Recorder:
    """A tracker in the service, with all that it was given and has sent."""

    def __init__(self):
        self.tracker = Tracker()
        self.updates = []
        self.declared = 0

    def update(self, samples, now_us):
        self.updates.append((samples, now_us))
        estimate = self.tracker.update(samples, now_us)
        self.declared += estimate is not None and estimate.change_probability >= DECLARED
        return estimate


def drive(scenario, duration_s, seed=1):
    """A simulated drive that follows the tracker's setpoint: its recorder."""
    config = load_configuration()
    settings = RunSettings(scenario_by_name(scenario), duration_s, obey=True, seed=seed)
    simulation = Simulation(settings, config.database)
    recorders = []

    def make():
        recorders.append(Recorder())
        return recorders[-1]

    core = ServiceCore(config, make)
    for frames in simulation.run():
        for frame in frames:
            for answer in core.feed(frame):
                simulation.receive(answer)
    if core.faults or len(recorders) != 1:
        raise RuntimeError(f"the service failed in {scenario}: {core.faults}")
    return recorders[0]
