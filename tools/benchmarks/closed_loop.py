"""The reference creep controller beside others on the same rails, by the frames of one bus.

Locomotive, service and controller exchange frames as on a bench. Utilisation is the mean force over
the mean of the smaller of the available adhesion and the motors' limit, from the start on. A
run-away is a creep beyond three times that of the peak for more than half a second.
"""

import json
import sys
from pathlib import Path

import numpy as np
from _pulling_cases import CASES
from _report import Report, over_cores
from _rival_controllers import RIVALS, Oracle
from _rows import random_parser

from adhesion_can.config import load_configuration
from adhesion_can.control.creep_controller import CreepController, Mode
from adhesion_can.control.frames import ControllerOnBus
from adhesion_can.service.core import ServiceCore
from adhesion_can.simulation.run import STEP_US, Simulation

OURS = "ours"
SAMPLE_S = 0.01
CONTROLLERS = {rival.name: rival for rival in (Oracle, *RIVALS)} | {OURS: CreepController}
STEADY_SHARE, CHANGING_SHARE = 0.97, 0.94
BEHIND_BEST, BEHIND_ORACLE = 0.005, 0.02
ENERGY_SHARE = 0.8
RUN_AWAY_S = 0.5


def pull(task):
    """Figures of a controller in a case."""
    number, name, seed, with_trace = task
    case, configuration = CASES[number], load_configuration()
    simulation = Simulation(case.run_settings(seed), configuration.database, case.rails)
    controller = CONTROLLERS[name](configuration.vehicle)
    core = ServiceCore(configuration) if name == OURS else None
    frames = ControllerOnBus(configuration, controller)
    figures = Figures(simulation)
    for step, sent in enumerate(simulation.run()):
        if name == Oracle.name:
            controller.lambda_m = figures.peaks[1]
        for frame in sent:
            for own in [*(core.feed(frame) if core else ()), frame]:
                for demand in frames.feed(own):
                    simulation.receive(demand)
        if step * STEP_US % round(SAMPLE_S * 1e6) == 0:
            figures.add(controller if name == OURS else None)
    return {"case": case.name, "controller": name, **figures.summary(with_trace)}


class Figures:
    """Sums over a run."""

    def __init__(self, simulation):
        self._simulation = simulation
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

    def add(self, ours):
        plant = self._simulation.plant
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
        if ours is not None:
            self._held += ours.mode is Mode.HOLD
            if ours.excursion is not None:
                self._excursions += float(lost[ours.excursion - 1])
        self._trace.append(
            [plant.time_s, plant.force.sum() / available, *relative, float(lambda_m.mean())]
        )

    def summary(self, with_trace):
        found = {
            "utilisation": self._force / self._available,
            "slip_energy": self._slip_energy / max(self._work, 1.0),
            "worst": self._worst,
            "beyond_s": self._beyond_s,
            "run_away_s": self._run_away_s,
            "excursions": self._excursions / max(self._slip_energy, 1.0),
            "held": self._held / self._samples,
        }
        if with_trace:
            found["trace"] = [[round(float(x), 5) for x in row] for row in self._trace]
        return found


def main():
    parser = random_parser("closed-loop", __doc__.splitlines()[0])
    parser.add_argument("--only", metavar="TEXT", help="cases whose names contain this text")
    parser.add_argument("--traces", type=Path, metavar="F.json", help="write force and slips")
    options, report = parser.parse_args(), Report()
    numbers = [n for n, case in enumerate(CASES) if (options.only or "") in case.name]
    if not numbers:
        parser.error(f"no case has {options.only!r} in its name")
    tasks = [
        (number, name, options.seed, options.traces is not None)
        for number in numbers
        for name in CONTROLLERS
    ]
    rows = over_cores(pull, tasks, options.jobs, "closed loop")
    if options.traces:
        options.traces.write_text(json.dumps(rows))
    found = {(row["case"], row["controller"]): row for row in rows}
    _print_tables(numbers, found)
    _judge(numbers, found, report)
    report.summarise()
    sys.exit(0)


def _print_tables(numbers, found):
    print("utilisation, % / energy lost in slip, % of the work")
    print(f"| case | {' | '.join(CONTROLLERS)} |")
    print(f"|{'---|' * (len(CONTROLLERS) + 1)}")
    for number in numbers:
        cells = [found[CASES[number].name, name] for name in CONTROLLERS]
        texts = [f"{100 * x['utilisation']:.1f} / {100 * x['slip_energy']:.1f}" for x in cells]
        print(f"| {CASES[number].name} | {' | '.join(texts)} |")
    print("\nours: largest creep over that of the peak, s beyond twice it (mean of the axles) and")
    print("three times it (worst axle), share of the slip energy in excursions, of the time held")
    print("| case | worst | beyond 2 | beyond 3 | excursions | held |")
    print("|---|---|---|---|---|---|")
    for number in numbers:
        row = found[CASES[number].name, OURS]
        print(
            f"| {row['case']} | {row['worst']:.1f} | {row['beyond_s']:.2f} s | "
            f"{row['run_away_s']:.2f} s | {100 * row['excursions']:.1f} % | "
            f"{100 * row['held']:.0f} % |"
        )
    print()


def _judge(numbers, found, report):
    rivals = [rival.name for rival in RIVALS]
    mine = {n: found[CASES[n].name, OURS] for n in numbers}
    for number in numbers:
        case, used = CASES[number], mine[number]["utilisation"]
        wanted = {"steady": STEADY_SHARE, "changing": CHANGING_SHARE}.get(case.kind)
        if wanted is not None:
            _at_least(report, f"{case.name}: utilisation", used, wanted)
        best = max(found[case.name, name]["utilisation"] for name in rivals)
        _at_least(report, f"{case.name}: beside the best rival", used, best - BEHIND_BEST)
    means = {
        name: np.mean([found[CASES[n].name, name]["utilisation"] for n in numbers])
        for name in CONTROLLERS
    }
    for name in rivals:
        _at_least(report, f"mean, beside {name}", means[OURS], means[name])
    _at_least(report, "mean, beside the oracle", means[OURS], means[Oracle.name] - BEHIND_ORACLE)
    worst = max(row["run_away_s"] for row in mine.values())
    report.at_most("longest creep above three times the peak's, s", worst, RUN_AWAY_S, ".2f")
    _judge_energy(numbers, found, rivals, report)


def _judge_energy(numbers, found, rivals, report):
    """Slip energy where a rival uses as much as ours to half a percent, or more."""
    ratios = []
    for number in numbers:
        case = CASES[number].name
        for name in rivals:
            mine, theirs = found[case, OURS], found[case, name]
            if abs(theirs["utilisation"] - mine["utilisation"]) <= BEHIND_BEST:
                ratios.append(mine["slip_energy"] / theirs["slip_energy"])
    if not ratios:
        report.write("no rival has our utilisation to 0.5 %: no slip energy to compare")
        return
    what = f"slip energy over that of a rival of equal utilisation, median of {len(ratios)} pairs"
    report.at_most(what, float(np.median(ratios)), ENERGY_SHARE, ".2f")


def _at_least(report, what, share, least):
    report.check(what, f"{100 * share:.2f} %", f"at least {100 * least:.2f} %", met=share >= least)


if __name__ == "__main__":
    main()
