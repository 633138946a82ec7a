"""Rows: how soon a change of the rail is declared, and how often without one."""

import time
from functools import partial
from math import log
from typing import NamedTuple

import numpy as np
from _data import DECLARED, POOLED, SLIP_MAX, drive, feed, points
from _report import aside, over_cores

from adhesion_can.estimation.tracker.settings import RunLengthSettings
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.experiments.simulated_data import RATE_HZ, SURFACES
from adhesion_can.physics.burckhardt import RAIL, adhesion
from adhesion_can.physics.samples import Samples

NOISE = (0.01, 0.1)
BEFORE, AFTER = 209 * POOLED, 50 * POOLED
SINGLE = 5 * POOLED
"""Samples before a switch that already come one by one where all after it do."""


class Switch(NamedTuple):
    """A change of the rail: from which, to which, and how the samples come."""

    number: int
    noise_std: float
    offset: int
    size: int


def samples_per_nat(switch):
    """Inverse of the Kullback-Leibler divergence per sample, of the new rail from the old one."""
    h = np.linspace(0.0, SLIP_MAX, 20001)
    old, new = SURFACES[switch.number : switch.number + 2]
    away = adhesion(h, *new) - adhesion(h, *old)
    return 2.0 * switch.noise_std**2 / float(np.mean(away**2))


def delay(switch, seed):
    """Samples from the switch until it is declared; inf: never, NaN: already before."""
    rng = np.random.default_rng(seed)
    old, new = SURFACES[switch.number : switch.number + 2]
    at = BEFORE + switch.offset
    before = points(rng, old, switch.noise_std, at)
    after = points(
        rng, new, switch.noise_std, AFTER - switch.offset, first_us=round(at * 1e6 / RATE_HZ)
    )
    samples = Samples.concatenate([before, after])
    tracker, seen = Tracker(), 0
    slow = BEFORE - SINGLE
    for part, size in ((slice(slow), POOLED), (slice(slow, None), switch.size)):
        for estimate in feed(tracker, samples.select(part), size):
            seen += size
            if estimate.change_probability >= DECLARED:
                return seen - at if seen > at else np.nan
    return np.inf


def delays(seed, runs, switch):
    return [delay(switch, [seed, run]) for run in range(runs)]


def delay_row(report, options):
    """Delay until a change is declared, against what the divergence of the two rails allows."""
    runs, alpha = 4 * options.runs, RunLengthSettings().false_alarm
    report.write(
        f"switches of experiment 3, {runs} runs, {BEFORE} samples before; median delay in samples, "
        f"bound ln(1/{alpha:g})/divergence"
    )
    ways = ((0, POOLED), (POOLED // 2, POOLED), (0, 1))
    switches = [
        Switch(number, noise_std, offset, size)
        for offset, size in ways
        for noise_std in NOISE
        for number in range(len(SURFACES) - 1)
    ]
    found = over_cores(partial(delays, options.seed, runs), switches, options.jobs, "delay")
    for switch, values in zip(switches, map(np.array, found), strict=True):
        bound = log(1.0 / alpha) * samples_per_nat(switch)
        early, kept = int(np.isnan(values).sum()), values[~np.isnan(values)]
        if not len(kept):
            kept = np.array([np.inf])
        middle, late = np.quantile(kept, [0.5, 0.9], method="inverted_cdf")
        begin = "begins" if switch.offset == 0 else "is within"
        way = "sample by sample" if switch.size == 1 else f"the switch {begin} an update"
        what = f"{way}, noise {switch.noise_std}, switch {switch.number + 1}"
        further = f"90 %: {late:.0f}, bound {bound:.1f}, declared before it: {early}"
        if switch.size == POOLED and switch.offset == 0:
            most = max(float(POOLED), 2.0 * bound)
            value = f"{middle:.0f}; {further}"
            report.check(what, value, f"at most {most:.1f}", met=middle <= most)
        else:
            report.write(f"{what}: {middle:.0f}; {further}")


# --------------------------------------------------------------------------- false alarms

AXLE_RATE_HZ, AXLE_UPDATE = 100, 2
PIECE = 50_000
"""Samples that are drawn at once."""
LOCOMOTIVE_S = 120.0


class Constant(NamedTuple):
    """A drive over a rail that stays."""

    name: str
    theta: tuple
    noise_std: float
    samples: int
    seed: int


def declared_on(rail):
    """Changes declared on a constant rail."""
    rng = np.random.default_rng([rail.seed, round(1000 * rail.noise_std)])
    tracker, declared, reported = Tracker(), 0, 1
    began = time.perf_counter()
    for begin in range(0, rail.samples, PIECE):
        n = min(PIECE, rail.samples - begin)
        first_us = round(begin * 1e6 / AXLE_RATE_HZ)
        part = points(rng, rail.theta, rail.noise_std, n, first_us=first_us, rate_hz=AXLE_RATE_HZ)
        for estimate in feed(tracker, part, AXLE_UPDATE):
            declared += estimate.change_probability >= DECLARED
        share = (begin + n) / rail.samples
        if share * 4 >= reported and share < 1:
            reported = int(share * 4) + 1
            aside(
                f"  {rail.name}, noise {rail.noise_std}: {100 * share:.0f} %, {declared} declared, "
                f"{time.perf_counter() - began:.0f} s"
            )
    return declared


def alarm_row(report, options):
    """Changes declared on rails that do not change."""
    rails = [(f"experiment {i}", theta) for i, theta in enumerate(SURFACES, start=1)]
    rails += [(surface.name, surface.theta) for surface in RAIL]
    n = round(options.hours * 3600 * AXLE_RATE_HZ / (len(rails) * len(NOISE)))
    n = max(n // AXLE_UPDATE, 1) * AXLE_UPDATE
    drives = [
        Constant(name, theta, noise_std, n, options.seed + i)
        for i, (name, theta) in enumerate(rails)
        for noise_std in NOISE
    ]
    began = time.perf_counter()
    found = over_cores(declared_on, drives, options.jobs, "alarms")
    spent = time.perf_counter() - began
    updates = len(drives) * n // AXLE_UPDATE
    report.check(
        f"declared in {options.hours:g} h of 100 Hz, {len(drives)} constant rails, {updates} "
        f"updates, {spent:.0f} s",
        str(sum(found)),
        "0",
        met=not any(found),
    )
    for rail, declared in zip(drives, found, strict=True):
        if declared:
            report.write(f"{declared} on {rail.name} {rail.theta}, noise {rail.noise_std}")
    run = drive("dry", LOCOMOTIVE_S, options.seed)
    report.check(
        f"declared on the simulated locomotive, dry, closed loop, {LOCOMOTIVE_S:.0f} s",
        str(run.declared),
        "0",
        met=run.declared == 0,
    )
