"""Rows: accuracy in experiment 3, and what following a slow change costs."""

import time
from dataclasses import replace
from functools import partial

import numpy as np
from _data import DECLARED, SLIP_MAX, feed, points
from _report import over_cores

from adhesion_can.estimation.registry import ESTIMATORS, oracle
from adhesion_can.estimation.tracker.settings import MemorySettings, TrackerSettings
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.experiments.figures_of_merit import collect_runs, compute_figures, rms
from adhesion_can.experiments.runs import participants, run_once
from adhesion_can.experiments.simulated_data import EXPERIMENTS, MU_MAX, QUANTITIES, SURFACES
from adhesion_can.physics.burckhardt import adhesion, peak

LAMBDA_M = QUANTITIES.index("lambda_m")
PAPER = "paper (mean)"
# The closer look at the switches is another row's.
EXPERIMENT = replace(EXPERIMENTS[3], detail_runs=0)


def one_run(seed, task):
    noise_std, run = task
    found = participants(EXPERIMENT, {n: ESTIMATORS[n] for n in ("tracker", "window")}, oracle)
    who = {name: found[name] for name in ("tracker", "oracle", PAPER, "window")}
    return run_once(EXPERIMENT, noise_std, run, seed, who, clock=time.perf_counter)


def accuracy(report, options):
    """RMSE in experiment 3 of tracker, oracle, paper and window, over the same data."""
    runs, levels = options.runs, EXPERIMENT.noise_stds
    report.write(
        f"experiment 3, {runs} runs, {EXPERIMENT.updates} updates of {EXPERIMENT.block} samples"
    )
    tasks = [(noise_std, run) for run in range(runs) for noise_std in levels]
    tracks = over_cores(partial(one_run, options.seed), tasks, options.jobs, "accuracy")
    for noise_std in levels:
        own = [track for task, track in zip(tasks, tracks, strict=True) if task[0] == noise_std]
        made = collect_runs(EXPERIMENT, noise_std, options.seed, own)
        rmse = {result.name: compute_figures(result, made).rmse for result in made.results}
        steady = {result.name: compute_figures(result, made).rmse_steady for result in made.results}
        rmse["Cramér-Rao bound"] = rms(made.bound, 0)
        report.write(f"noise sd {noise_std}: RMSE of μ_max and λ_m")
        for name, value in rmse.items():
            late = steady.get(name)
            rest = "" if late is None else f"; {pair(late)} without the first update after a switch"
            report.write(f"  {name:16} {pair(value)}{rest}")
        for column, what, of_paper in ((MU_MAX, "μ_max", 0.35), (LAMBDA_M, "λ_m", 0.25)):
            own = rmse["tracker"][column]
            for name, most in (("oracle", 1.05), (PAPER, of_paper)):
                report.at_most(
                    f"noise {noise_std}: {what}: tracker/{name}", own / rmse[name][column], most
                )
            share = own / rmse["window"][column]
            label = f"noise {noise_std}: {what}: tracker/window"
            report.check(label, f"{share:.3f}", "below 1", met=share < 1)
            report.write(f"{what}: tracker/bound {own / rmse['Cramér-Rao bound'][column]:.3f}")


def pair(values):
    return f"{values[MU_MAX]:.5f} {values[LAMBDA_M]:.5f}"


# --------------------------------------------------------------------------------- slow change

DRIFT_S, DRIFT, SLOW_UPDATE = 600.0, 0.17, 120
SLOW_RATE_HZ = 600
MEMORIES = {"tracker": None, "3600 s alone": (3600.0,), "8 s alone": (8.0,)}


def one_drift(task):
    """Error of μ_max after each update, and declared changes, by the name of the memory."""
    noise_std, fall, seed = task
    rng = np.random.default_rng([seed, round(1000 * noise_std)])
    samples = points(rng, (0.0, 1.0, 0.0), noise_std, round(DRIFT_S * SLOW_RATE_HZ))
    # All of the curve is scaled.
    scale = 1.0 - fall * np.arange(len(samples)) / len(samples)
    c1, c2, c3 = SURFACES[0]
    curve = adhesion(samples.slip, c1, c2, c3)
    samples = replace(samples, adhesion=samples.adhesion + scale * curve)
    truth = float(peak(c1, c2, c3).mu_max) * scale[SLOW_UPDATE - 1 :: SLOW_UPDATE]
    found = {}
    for name, times_s in MEMORIES.items():
        memory = MemorySettings() if times_s is None else MemorySettings(times_s=times_s)
        estimates = list(feed(Tracker(TrackerSettings(memory=memory)), samples, SLOW_UPDATE))
        declared = sum(e.change_probability >= DECLARED for e in estimates)
        found[name] = np.array([e.mu_max for e in estimates]) - truth, declared
    return found


def slow(report, options):
    """RMSE of μ_max while the curve falls slowly, and on one that stays."""
    runs = max(options.runs // 12, 1)
    report.write(
        f"{DRIFT_S:.0f} s, slips in 0..{SLIP_MAX}, updates of {SLOW_UPDATE} samples every "
        f"{SLOW_UPDATE / SLOW_RATE_HZ} s (pooled, for a shorter run), {runs} runs"
    )
    cells = [(noise_std, fall) for noise_std in (0.01, 0.1) for fall in (DRIFT, 0.0)]
    tasks = [(*cell, options.seed + run) for cell in cells for run in range(runs)]
    results = over_cores(one_drift, tasks, options.jobs, "slow")
    for i, (noise_std, fall) in enumerate(cells):
        own = results[i * runs : (i + 1) * runs]
        rmse = {n: float(np.sqrt(np.mean([r[n][0] ** 2 for r in own]))) for n in MEMORIES}
        declared = {n: sum(r[n][1] for r in own) for n in MEMORIES}
        rail = f"μ falls by {100 * fall:.0f} %" if fall else "constant rail"
        report.write(f"noise sd {noise_std}, {rail}: RMSE of μ_max")
        for name in MEMORIES:
            report.write(
                f"  {name:13} {rmse[name]:.5f}, tracker/it {rmse['tracker'] / rmse[name]:.2f}, "
                f"{declared[name]} changes declared"
            )
