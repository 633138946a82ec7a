"""A creep controller in a case: locomotive, service and controller by the frames of one bus."""

from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
from _pulling_cases import CASES
from _rival_controllers import RIVALS, Oracle

from adhesion_can.config import load_configuration
from adhesion_can.control.creep_controller import CreepController, Mode
from adhesion_can.control.frames import ControllerOnBus
from adhesion_can.control.settings import ControlSettings
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import STEP_US, Simulation

OURS = "ours"
SAMPLE_S = 0.01
TRACE_STEPS = 20
"""Samples in a row of a trace."""


def make_ours(vehicle, share=None):
    """Our controller, which aims at a share of the peak's adhesion.

    Near the peak the elasticity falls with the root of what is missing there, so the search's goal
    follows.
    """
    settings = ControlSettings()
    if share is not None:
        factor = sqrt((1.0 - share) / (1.0 - settings.target_share))
        search = replace(
            settings.search,
            goal=factor * settings.search.goal,
            slip_price=factor * settings.search.slip_price,
        )
        settings = replace(settings, target_share=share, search=search)
    return CreepController(vehicle, settings)


OUR_OTHERS = (0.985,)
"""Shares of the peak's adhesion for the front of ours."""
MAKERS = {rival.name: rival for rival in (Oracle, *RIVALS)} | {OURS: make_ours}
COLUMNS = ("time_s", "force_share", "slip", "largest_over_peak", "setpoint", "lambda_m")
"""Columns of a trace: mean share of the available force; median slip ratio; largest slip of an axle
over that of its peak; median slip that the controller wanted, null where it wants none; median slip
of the peaks."""


@dataclass(frozen=True)
class Task:
    """A run.

    Attributes:
        case: Number of the case.
        name: Name of the controller.
        setting: Setting of the controller; None: its usual one.
        seed: Seed of the sensors.
        traced: Whether the trace is kept.

    """

    case: int
    name: str
    setting: float | None = None
    seed: int = 1
    traced: bool = False


def pull(task):
    """Figures of a controller in a case."""
    case, configuration = CASES[task.case], load_configuration()
    simulation = Simulation(case.run_settings(task.seed), configuration.database, case.rails)
    settings = () if task.setting is None else (task.setting,)
    controller = MAKERS[task.name](configuration.vehicle, *settings)
    core = ServiceCore(configuration) if task.name == OURS else None
    frames = ControllerOnBus(configuration, controller)
    figures = Figures(simulation, controller)
    for step, sent in enumerate(simulation.run()):
        if task.name == Oracle.name:
            controller.lambda_m = figures.peaks[1]
        for frame in sent:
            for own in [*(core.feed(frame) if core else ()), frame]:
                for demand in frames.feed(own):
                    simulation.receive(demand)
        if step * STEP_US % round(SAMPLE_S * 1e6) == 0:
            figures.add()
    row = {"case": case.name, "controller": task.name, "setting": task.setting, "seed": task.seed}
    return row | figures.summary() | ({"trace": figures.trace()} if task.traced else {})


class Figures:
    """Sums over a run."""

    def __init__(self, simulation, controller):
        self._simulation, self._controller = simulation, controller
        self._limit = simulation.settings.drive.effort_max
        self._force = self._available = self._slip_energy = self._work = self._excursions = 0.0
        self._worst = self._beyond_s = self._run_away_s = 0.0
        self._away_s = np.zeros(len(simulation.plant.force))
        self._held = self._samples = 0
        self._trace = []
        self.peaks = simulation.find_peaks()
        """Largest adhesion under each axle and its slip ratio."""
        # A family's peak is looked for along its curve, and moves with speed and load alone.
        self._peaks_every = 1 if simulation.settings.scenario.family is None else 10

    def add(self):
        plant, controller = self._simulation.plant, self._controller
        if self._samples % self._peaks_every == 0:
            self.peaks = self._simulation.find_peaks()
        mu_max, lambda_m = self.peaks
        available = np.minimum(mu_max * plant.load, self._limit).sum()
        lost = plant.force * plant.slip * plant.speed * SAMPLE_S
        self._force += plant.force.sum()
        self._available += available
        self._work += plant.force.sum() * plant.speed * SAMPLE_S
        self._slip_energy += lost.sum()
        relative = plant.slip / lambda_m
        self._worst = max(self._worst, float(relative.max()))
        self._beyond_s += SAMPLE_S * float((relative > 2.0).mean())
        self._away_s = np.where(relative > 3.0, self._away_s + SAMPLE_S, 0.0)
        self._run_away_s = max(self._run_away_s, float(self._away_s.max()))
        self._samples += 1
        if isinstance(controller, CreepController):
            self._held += controller.mode is Mode.HOLD
            if controller.excursion is not None:
                self._excursions += float(lost[controller.excursion - 1])
        wanted = controller.slip
        self._trace.append((
            plant.time_s, plant.force.sum() / available, np.median(plant.slip), relative.max(),
            np.nan if wanted is None else np.median(wanted), np.median(lambda_m),
        ))  # fmt: skip

    def summary(self):
        return {
            "utilisation": self._force / self._available,
            "slip_energy": self._slip_energy / max(self._work, 1.0),
            "worst": self._worst,
            "beyond_s": self._beyond_s,
            "run_away_s": self._run_away_s,
            "excursions": self._excursions / max(self._slip_energy, 1.0),
            "held": self._held / self._samples,
        }

    def trace(self):
        """Columns of `COLUMNS`: means over 0.2 s, of the slip over the peak's the largest."""
        whole = len(self._trace) // TRACE_STEPS * TRACE_STEPS
        rows = np.array(self._trace[:whole], dtype=float).reshape(-1, TRACE_STEPS, len(COLUMNS))
        values = rows.mean(axis=1)
        values[:, 3] = rows[:, :, 3].max(axis=1)
        return {
            name: [round(float(x), 4) if np.isfinite(x) else None for x in column]
            for name, column in zip(COLUMNS, values.T, strict=True)
        }
