"""Row: the service on hours of driving over one rail, beside its tracker alone."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from _report import over_cores

from adhesion_can.config import load_configuration
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name
from adhesion_can.simulation.sensors import SensorNoiseSettings

DRIVE_S = 600.0
SPEEDS = (7.5, 14.0)
"""Mean speed, m/s; it swings by 60 %, so the slowest drives come down to 3 m/s."""
NOISE = (0.5, 4.0)
"""Factor of the sensors' noise in every other drive."""
SETTLED_S = 20.0
"""Time from which errors and TRACKING are counted, s."""


class Driven(NamedTuple):
    """What a core said in one drive.

    Attributes:
        changes: Surface changes declared.
        setpoints: Setpoints after the first seconds.
        tracking: Those in TRACKING.
        doubted: Those with a doubt.
        squares: Sum of the squared relative errors of μ_max in TRACKING.

    """

    changes: int
    setpoints: int
    tracking: int
    doubted: int
    squares: float


class Listener:
    """Counts what a core says; a change is one entry into SURFACE_CHANGE."""

    def __init__(self, mu_max):
        self._mu_max = mu_max
        self._before = Status.INIT
        self.counts = Driven(0, 0, 0, 0, 0.0)

    def add(self, due_us, outputs):
        changed = outputs.status is Status.SURFACE_CHANGE and self._before is not outputs.status
        self._before = outputs.status
        settled = due_us >= SETTLED_S * 1e6
        tracking = settled and outputs.status is Status.TRACKING
        doubted = settled and outputs.doubt not in (Doubt.NONE, Doubt.NOT_AVAILABLE)
        error = outputs.setpoint.mu_max / self._mu_max - 1.0 if tracking else 0.0
        step = (changed, settled, tracking, doubted, error**2)
        self.counts = Driven(*(a + b for a, b in zip(self.counts, step, strict=True)))


def driven(task):
    """What the service says in a drive, and its tracker alone where the noise is as configured."""
    seed, rough = task
    rng = np.random.default_rng(seed)
    factor = float(np.exp(rng.uniform(*np.log(NOISE)))) if rough else 1.0
    scenario = replace(scenario_by_name("sweep"), speed=float(rng.uniform(*SPEEDS)))
    nominal = SensorNoiseSettings()
    noise = replace(
        nominal,
        wheel_speed=factor * nominal.wheel_speed,
        vehicle_speed=factor * nominal.vehicle_speed,
        effort=factor * nominal.effort,
    )
    config = load_configuration()
    settings = RunSettings(scenario, DRIVE_S, seed=int(rng.integers(2**31)), noise=noise)
    run = Simulation(settings, config.database)
    mu_max = run.sections[0].surface.mu_max
    makers = (None,) if rough else (None, Tracker)
    listeners = [Listener(mu_max) for _ in makers]
    cores = [
        ServiceCore(config, maker, on_setpoint=listener.add)
        for maker, listener in zip(makers, listeners, strict=True)
    ]
    for frames in run.run():
        for frame in frames:
            for core in cores:
                core.feed(frame)
    return [listener.counts for listener in listeners]


def driving_row(report, options):
    """Surface changes, doubt, errors and TRACKING on hours of driving over one dry rail."""
    count = max(round(options.driven_hours * 3600 / DRIVE_S), 2)
    report.write(
        f"{count} drives of {DRIVE_S:.0f} s: creep swept in traction and braking, coasting, mean "
        f"speed {SPEEDS[0]:g} to {SPEEDS[1]:g} m/s that varies by 60 %; every other one with "
        f"{NOISE[0]:g} to {NOISE[1]:g} times the configured noise"
    )
    tasks = [((options.seed, number), number % 2 == 1) for number in range(count)]
    found = over_cores(driven, tasks, options.jobs, "driving")
    as_configured, rough = found[::2], found[1::2]
    alone = summed([both[1] for both in as_configured])
    for name, drives in (("configured noise", as_configured), ("other noise", rough)):
        service = summed([drive[0] for drive in drives])
        hours = len(drives) * DRIVE_S / 3600
        changes = f"{service.changes:.0f}"
        met = service.changes == 0
        report.check(f"{name}: changes declared in {hours:.1f} h", changes, "0", met=met)
        doubted = service.doubted / service.setpoints
        report.at_most(f"{name}: share of the time with a doubt, %", 100.0 * doubted, 0.1)
        share = service.tracking / service.setpoints
        error = rmse(service)
        if name == "configured noise":
            wanted = alone.tracking / alone.setpoints
            report.check(
                f"{name}: TRACKING",
                f"{100 * share:.2f} %",
                f"as the tracker alone, {100 * wanted:.2f} %",
                met=share >= wanted - 1e-3,
            )
            what = f"RMSE of mu_max in TRACKING ({100 * error:.3f} %) over the tracker's"
            report.at_most(f"{name}: {what}", error / rmse(alone), 1.05)
        else:
            report.write(
                f"{name}: TRACKING {100 * share:.2f} %, RMSE of mu_max there {100 * error:.3f} %"
            )


def summed(drives):
    """Totals of several drives."""
    return Driven(*np.sum(drives, axis=0))


def rmse(counts):
    """Relative RMSE of μ_max over the setpoints in TRACKING."""
    return float(np.sqrt(counts.squares / max(counts.tracking, 1)))
