"""Rows: time of an update, and memory over a day."""

import gc
import sys
import time
import tracemalloc
from statistics import mean, median

import numpy as np
from _data import DECLARED, POOLED, drive, points

from adhesion_can.estimation.baselines.paper import PaperEstimator
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.differential_evolution import search
from adhesion_can.estimation.registry import EstimatorSettings, make_default
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.experiments.simulated_data import SURFACES
from adhesion_can.physics.burckhardt import RAIL

DRIVE_S = 40.0
REPEATS = 3
WHOLE_S, AXLES = 120.0, 6
EVERY = 10
"""Updates from one block of the paper's to the next."""


def paper_block():
    """Settings of the paper's search, and the slips and adhesion of a block."""
    settings = EvolutionSettings()
    samples = points(np.random.default_rng(1), SURFACES[0], 0.01, settings.block)
    return settings, *samples.folded()


def timed(updates):
    """Seconds of each update, and of each of the paper's blocks among them."""
    block = points(np.random.default_rng(1), SURFACES[0], 0.01, EvolutionSettings().block)
    paper = PaperEstimator()
    paper.update(block, 0)
    tracker, ours, theirs = Tracker(), [], []
    for k, (samples, now_us) in enumerate(updates):
        began = time.perf_counter()
        tracker.update(samples, now_us)
        ours.append(time.perf_counter() - began)
        if k % EVERY == 0:
            began = time.perf_counter()
            paper.update(block, 0)
            theirs.append(time.perf_counter() - began)
    return ours, theirs


def time_row(report, options):
    """An update of the tracker against the paper's estimator on one block, in one run."""
    report.write(
        f"updates of {POOLED} samples from the simulated locomotive at 10 m/s, {DRIVE_S:.0f} s, "
        f"{REPEATS} times; between them the paper's on {EvolutionSettings().block} samples"
    )
    rails = (("three changes", "dry-wet-greasy-dry"), ("constant rail", "dry"))
    for name, scenario in rails:
        updates = [u for u in drive(scenario, DRIVE_S, options.seed).updates if len(u[0])]
        ours, theirs = [], []
        for _ in range(REPEATS):
            a, b = timed(updates)
            ours += a
            theirs += b
        block = median(theirs)
        report.at_most(f"{name}: median update/median block", median(ours) / block, 0.1)
        report.write(
            f"{name}: update median {1e3 * median(ours):.3f} ms, mean {1e3 * mean(ours):.3f} "
            f"({mean(ours) / block:.3f} of a block), 99 % {1e3 * np.quantile(ours, 0.99):.3f}, "
            f"longest {1e3 * max(ours):.1f}; block median {1e3 * block:.3f} ms"
        )
    whole_row(report, options)


def whole_row(report, options):
    """An update of the service's estimator over that of its tracker, both of the same samples."""
    for scenario in ("dry", "sweep", "polach-wet"):
        updates = [u for u in drive(scenario, WHOLE_S, options.seed).updates if len(u[0])]
        ratios, alone = [], []
        for _ in range(REPEATS):
            tracker, whole = (
                seconds_of(Tracker(), updates),
                seconds_of(service_estimator(), updates),
            )
            ratios.append(whole / tracker)
            alone.append(tracker / len(updates))
        name = f"{scenario}, {WHOLE_S:.0f} s: update with noise and doubt/tracker alone"
        report.at_most(name, median(ratios), 1.3, ".2f")
        report.write(f"{scenario}: tracker alone {1e3 * median(alone):.3f} ms an update")


def service_estimator():
    return make_default(EstimatorSettings(), AXLES)


def seconds_of(estimator, updates):
    """Seconds for all updates."""
    began = time.perf_counter()
    for samples, now_us in updates:
        estimator.update(samples, now_us)
    return time.perf_counter() - began


# --------------------------------------------------------------------------------- memory

DAY_US = 24 * 3600 * 1_000_000
STRETCHES = 50
"""Of one rail each; the marks below fall on their ends."""
MARKS = (0.1, 0.5, 1.0)
LOOKS = 50
"""Updates before each mark over which the memory's median is taken."""


def forget_names():
    """Empty CPython's cache of attributes.

    It comes to keep up to 4096 names that NumPy makes anew in each call: bounded, and no part of
    the tracker.
    """
    clear = getattr(sys, "_clear_internal_caches", None) or sys._clear_type_cache  # noqa: SLF001
    clear()


def day(count, seed):
    """The samples of each update through a day, with the number of the update."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        theta = RAIL[k * STRETCHES // count % len(RAIL)].theta
        yield k, points(rng, theta, 0.01, POOLED, first_us=round(k * (DAY_US / count)))


def traced(count, seed):
    """Bytes held at each mark, and the number of changes declared."""
    ends = [round(mark * count) for mark in MARKS]
    held, declared = {end: [] for end in ends}, 0
    tracemalloc.start()
    tracker = Tracker()
    for k, samples in day(count, seed):
        declared += tracker.update(samples, int(samples.t_us[-1])).change_probability >= DECLARED
        for end in ends:
            if end - LOOKS <= k < end:
                gc.collect()
                forget_names()
                held[end].append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    return [median(held[end]) for end in ends], declared


def tenths(count, seed):
    """Median seconds of an update in the first and last tenth, and of the paper's search there."""
    rng = np.random.default_rng(seed)
    settings, h, z = paper_block()
    ours, theirs = np.empty(count), np.full(count, np.nan)
    tracker = Tracker()
    for k, samples in day(count, seed):
        now_us = int(samples.t_us[-1])
        began = time.perf_counter()
        tracker.update(samples, now_us)
        ours[k] = time.perf_counter() - began
        if k % EVERY == 0:
            began = time.perf_counter()
            search(h, z, SURFACES[0], settings, rng)
            theirs[k] = time.perf_counter() - began
    parts = slice(count // 10), slice(-(count // 10), None)
    return [(float(np.median(ours[part])), float(np.nanmedian(theirs[part]))) for part in parts]


def memory_row(report, options):
    """Memory and time of an update through a day, with changes of the rail."""
    count = max(options.soak_updates // STRETCHES, 2 * LOOKS) * STRETCHES
    bytes_at, declared = traced(count, options.seed)
    report.write(
        f"{count} updates of {POOLED} samples, stamps over 24 h, {STRETCHES - 1} changes of the "
        f"rail, {declared} declared"
    )
    shown = ", ".join(f"{b / 1024:.1f} KiB" for b in bytes_at)
    growth = 100 * (bytes_at[-1] / bytes_at[0] - 1)
    report.write(f"memory after {', '.join(f'{100 * m:.0f} %' for m in MARKS)}: {shown}")
    report.at_most("growth of the memory from 10 % to 100 %, in %", growth, 1.0, ".2f")
    # Tracing slows, and more so with time: the clock has a run of its own. What else the machine
    # does lengthens the paper's search alike.
    (early, early_block), (late, late_block) = tenths(count, options.seed)
    report.write(
        f"update, median: {1e3 * early:.3f} ms in the first tenth, {1e3 * late:.3f} in the last; "
        f"the paper's search {1e3 * early_block:.3f} and {1e3 * late_block:.3f}"
    )
    growth = 100 * (late / late_block / (early / early_block) - 1)
    report.at_most("growth of the time against the paper's search, in %", growth, 1.0, ".2f")
