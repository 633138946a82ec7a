"""`experiment`: the paper's three experiments, every estimator side by side."""

import argparse
import csv
import os
import platform
import signal
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import active_children, get_context
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np

from adhesion_can.cli.common import progress
from adhesion_can.cli.outputs import add_json, make_folder, require_outputs, talk, write_json
from adhesion_can.cli.reports import add_report, missing_report, write_report
from adhesion_can.errors import InputError
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.registry import estimator_by_name, known_estimators, oracle
from adhesion_can.experiments.figures_of_merit import NoiseLevelResult, collect_runs
from adhesion_can.experiments.runs import EstimatorRun, participants, run_once
from adhesion_can.experiments.simulated_data import EXPERIMENTS, Experiment
from adhesion_can.files import whole_file
from adhesion_can.printable import say
from adhesion_can.reporting.experiment import (
    CSV_COLUMNS,
    csv_rows,
    document,
    merit_table,
    page,
    verdict,
)
from adhesion_can.reporting.text import PIPE_WIDTH, FittingTable, console
from adhesion_can.version import __version__

RUNS = 20


class _Task(NamedTuple):
    """One run at one noise level, as a worker process gets it."""

    experiment: Experiment
    noise_std: float
    run: int
    seed: int
    names: tuple[str, ...]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Repeats an experiment of the paper with every estimator on the same data. 1: one "
        "surface, data in sequence; 2: the surface switches twice, ordinary differential "
        "evolution; 3: the same with the paper's two changes. Writes experiment-N.html (extra "
        "'report'), .json and .csv."
    )
    parser.add_argument("number", type=int, choices=sorted(EXPERIMENTS), metavar="1|2|3")
    parser.add_argument(
        "--runs", type=int, default=RUNS, metavar="N", help=f"of the Monte Carlo (default {RUNS})"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("adhesion-can-experiment"),
        metavar="DIR",
        help="folder for page and numbers (default ./adhesion-can-experiment)",
    )
    parser.add_argument(
        "--start",
        metavar="C1,C2,C3",
        help=(
            "start values of estimators in experiments 2 and 3 (default: the paper's "
            "0.5,30,0.08, which is also the curve of the first surface)"
        ),
    )
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of all runs (default 1)")
    parser.add_argument(
        "--jobs", type=int, default=os.cpu_count() or 1, metavar="N", help="processes (default all)"
    )
    parser.add_argument(
        "--estimator",
        action="append",
        metavar="NAME",
        help="only this estimator, with the paper's and the oracle; may be repeated: "
        + ", ".join(known_estimators()),
    )
    add_report(parser, html=False)
    add_json(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    _check(options)
    experiment = _experiment(options)
    out = options.out / f"experiment-{options.number}"
    missing = missing_report(out.with_suffix(".html"))
    if missing:
        say(f"writing the numbers, but no page: {missing}")
    names = tuple(n for n in known_estimators() if not options.estimator or n in options.estimator)
    outcomes = _run_all(experiment, options, names)
    provenance = _provenance(options)
    numbers = document(outcomes, provenance)
    write_json(str(out.with_suffix(".json")), numbers, own_name=True)
    with whole_file(out.with_suffix(".csv"), own_name=True) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(CSV_COLUMNS)
        writer.writerows(csv_rows(outcomes))
    report: list[str] = []
    if not missing:
        texts = {name: str(value) for name, value in provenance.items() if value}
        report = write_report(page(outcomes, texts), options, out.with_suffix(".html"))
    write_json(options.json, numbers)
    if talk(options):
        _print(outcomes, out, missing)
        for line in report[1:]:
            say(line, sys.stdout)
    return 0


def _check(options: argparse.Namespace) -> None:
    for name in ("runs", "jobs"):
        if getattr(options, name) < 1:
            raise InputError(f"--{name}", f"{getattr(options, name)} is too few", "give 1 or more")
    if options.seed < 0:
        raise InputError("--seed", f"{options.seed} is negative", "give 0 or more")
    for name in options.estimator or ():
        if name not in known_estimators():
            raise InputError(
                "--estimator", f"no estimator {name!r}", f"known: {', '.join(known_estimators())}"
            )
    _experiment(options)
    make_folder(options.out, "--out")
    out = options.out / f"experiment-{options.number}"
    outputs = {f"--out {suffix}": out.with_suffix(suffix) for suffix in (".html", ".json", ".csv")}
    require_outputs(options, own=outputs)


def _experiment(options: argparse.Namespace) -> Experiment:
    """The experiment, with the start of the estimators that was chosen."""
    experiment = EXPERIMENTS[options.number]
    if options.start is None:
        return experiment
    where, fix = f"--start {options.start}", "give C1,C2,C3, such as 0.3,60,0.2"
    if experiment.theta0 is None:
        raise InputError(where, "experiment 1 starts anywhere in the range", "remove --start")
    try:
        c1, c2, c3 = map(float, options.start.split(","))
        EvolutionSettings(theta0=(c1, c2, c3))
    except ValueError as error:
        raise InputError(where, "not a curve within the search range", fix) from error
    return replace(experiment, theta0=(c1, c2, c3))


def _work(task: _Task) -> dict[str, EstimatorRun]:
    """One run, in a worker process: estimators are made there, by name."""
    made = {name: estimator_by_name(name) for name in task.names}
    who = participants(task.experiment, made, oracle)
    return run_once(
        task.experiment, task.noise_std, task.run, task.seed, who, clock=time.perf_counter
    )


def _run_all(
    experiment: Experiment, options: argparse.Namespace, names: tuple[str, ...]
) -> list[NoiseLevelResult]:
    """All runs over all processes; a run does not depend on which process it falls to."""
    # The first runs have the most to do: all their noise levels come first.
    tasks = [
        _Task(experiment, noise_std, number, options.seed, names)
        for number in range(options.runs)
        for noise_std in experiment.noise_stds
    ]
    done: dict[tuple[float, int], dict[str, EstimatorRun]] = {}
    jobs = min(options.jobs, len(tasks))
    with (
        progress(f"experiment {experiment.number}", len(tasks), "") as show,
        ProcessPoolExecutor(
            jobs,
            mp_context=get_context("spawn"),
            # Ctrl-C ends the workers without a word of their own.
            initializer=signal.signal,
            initargs=(signal.SIGINT, signal.SIG_DFL),
        ) as pool,
    ):
        waiting = {pool.submit(_work, task): task for task in tasks}
        try:
            for future in as_completed(waiting):
                task = waiting[future]
                done[task.noise_std, task.run] = future.result()
                show(len(done))
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in active_children():
                worker.terminate()  # a SIGTERM, unlike Ctrl-C, did not reach them
            raise
    return [
        collect_runs(
            experiment, sd, options.seed, [done[sd, number] for number in range(options.runs)]
        )
        for sd in experiment.noise_stds
    ]


def _provenance(options: argparse.Namespace) -> dict[str, Any]:
    chosen = "" if options.start is None else f" --start {options.start}"
    chosen += "".join(f" --estimator {name}" for name in options.estimator or ())
    return {
        "version": __version__,
        "command": f"adhesion-can experiment {options.number} --runs {options.runs} "
        f"--seed {options.seed}{chosen}",
        "seed": options.seed,
        "runs": options.runs,
        "jobs": options.jobs,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors",
        "inputs": [],
    }


def _print(outcomes: Sequence[NoiseLevelResult], out: Path, missing: str) -> None:
    screen = console()
    for made in outcomes:
        shown = merit_table(made)
        screen.print(FittingTable(shown.caption, shown.columns, shown.rows))
    lines = [*fill(merit_table(outcomes[0]).note, PIPE_WIDTH).splitlines(), ""]
    for made in outcomes:
        lines += verdict(made)
    endings = (".json", ".csv") if missing else (".html", ".json", ".csv")
    lines += [f"written: {out.with_suffix(ending)}" for ending in endings]
    if missing:
        lines.append(f"no page: {missing}")
    for line in lines:
        screen.print(line)
