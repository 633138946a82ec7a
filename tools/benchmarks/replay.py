"""Replay against real time, in columns and frame by frame.

Both take turns, so that what else the machine does meets them alike. What they send must be the
same to the byte. Then: what of an update takes how long.
"""

import argparse
import hashlib
import time
from collections import deque
from itertools import chain
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from timeit import repeat

import numpy as np
from _report import Report

from adhesion_can.config import load_configuration
from adhesion_can.estimation.registry import make_tracker
from adhesion_can.estimation.tracker.layout import NODES
from adhesion_can.recordings.candump import format_frame
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.service.core import ServiceCore
from adhesion_can.service.replay import replay, replay_blocks
from adhesion_can.simulation.run import RunSettings, Simulation
from adhesion_can.simulation.scenarios import scenario_by_name

SCENARIOS = ("sweep", "dry-wet-greasy-dry")
TARGETS = {"columns": 120.0, "frames": 60.0}


def run(path, config, way):
    """Replay in a way; seconds of the processor and digest of what was sent."""
    sent = []
    recordings = open_recordings([path])
    core = ServiceCore(config)
    began = time.process_time()
    blocks = blocks_in_sequence(recordings)
    if way == "columns":
        replay_blocks(blocks, core, sent.append)
    else:
        items = chain.from_iterable(block.items() for block in blocks)
        replay(items, core, sent.append)
    spent = time.process_time() - began
    return spent, hashlib.sha256(repr(sent).encode()).hexdigest()


def write_drive(path, scenario, duration_s):
    config = load_configuration()
    simulation = Simulation(RunSettings(scenario_by_name(scenario), duration_s), config.database)
    with path.open("w") as file:
        for step in simulation.run():
            for frame in step:
                file.write(format_frame(frame, "can0"))


def measure(path, scenario, options, report):
    config = load_configuration()
    times, digests = {way: [] for way in TARGETS}, set()
    for _ in range(options.runs):
        for way, spent in times.items():
            seconds, digest = run(path, config, way)
            spent.append(seconds)
            digests.add(digest)
    for way, spent in times.items():
        rate, target = options.duration / median(spent), TARGETS[way]
        what = f"{scenario}, {way}"
        report.check(what, f"{rate:.0f} x real time", f"{target:.0f}", met=rate >= target)
    same = len(digests) == 1
    report.check(f"{scenario}: different outputs of both ways", f"{len(digests)}", "1", met=same)


def arithmetic_us(settings):
    """Product of matrices, exponentials and logarithms of an update, µs."""
    numbers = np.random.default_rng(0)
    curves = len(settings.memory.times_s) * settings.curves
    sums, at_x = numbers.random((6, NODES)), numbers.random((NODES, curves))
    both, one = numbers.random((2, curves)), numbers.random(curves)
    terms = numbers.random((4, settings.run_length.hypotheses, NODES))
    samples = numbers.random((7, NODES))

    def run():
        sums @ at_x
        np.exp(both)
        np.log(one + 1.0)
        np.exp(one)
        np.log(terms + 1.0)
        np.exp(terms[0])
        np.exp(samples)

    return 1e6 * min(repeat(run, number=100, repeat=20)) / 100


def tell_parts(path, report):
    """Processor time of an update in columns, by what it is spent on."""
    config = load_configuration()
    updates = []
    core = ServiceCore(config, on_samples=updates.append)
    began = time.process_time()
    replay_blocks(blocks_in_sequence(open_recordings([path])), core, deque(maxlen=0).append)
    whole = time.process_time() - began
    spent = {}
    for name, estimator in (
        ("tracker", make_tracker(config.estimators)),
        ("estimator", config.make_estimator()),
    ):
        began = time.process_time()
        for samples in updates:
            estimator.update(samples, int(samples.t_us[-1]))
        spent[name] = time.process_time() - began
    each = 1e6 / len(updates)
    tracker, estimator = each * spent["tracker"], each * spent["estimator"]
    report.write(
        f"an update, µs ({len(updates)} of them): {each * whole:.0f}, of which tracker "
        f"{tracker:.0f} (product, exponentials and logarithms alone "
        f"{arithmetic_us(config.estimators.tracker):.0f}), noise and doubt "
        f"{estimator - tracker:.0f}, frames in and out {each * whole - estimator:.0f}"
    )


def main():
    parser = argparse.ArgumentParser(prog="tools/bench replay", description=__doc__)
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="runs a way (default 3)")
    parser.add_argument(
        "--duration", type=float, default=600.0, metavar="S", help="of a drive (default 600)"
    )
    options = parser.parse_args()
    report = Report()
    with TemporaryDirectory() as folder:
        for scenario in SCENARIOS:
            path = Path(folder) / f"{scenario}.log"
            write_drive(path, scenario, options.duration)
            measure(path, scenario, options, report)
        tell_parts(path, report)
    report.summarise()


if __name__ == "__main__":
    main()
