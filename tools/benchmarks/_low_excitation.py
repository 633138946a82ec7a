"""Rows: errors of the slips, and how far the stated intervals can be believed."""

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from _data import POOLED, SLIP_MAX, feed, points
from _report import over_cores

from adhesion_can.estimation.tracker.prior import Prior
from adhesion_can.estimation.tracker.settings import PriorSettings, TrackerSettings
from adhesion_can.estimation.tracker.tracker import Tracker
from adhesion_can.experiments.runs import SLIP_MAX as RANGE
from adhesion_can.physics.burckhardt import PUBLISHED, RAIL, adhesion, peak
from adhesion_can.physics.samples import Samples

NINETY = 1.645
"""Standard deviations of a normal distribution that hold 90 %."""

# ------------------------------------------------------------------------ errors in variables

SPEEDS = (2.0, 3.0, 5.0, 10.0)
SURFACE = RAIL[0]
RADIUS, WHEEL_STD, VEHICLE_STD, ADHESION_STD = 0.625, 0.005, 0.01, 0.01
TOP_SLIP, UPDATES = 0.15, 200
VALUES = ("slope at zero creep", "λ_m", "μ_max")


def measured(rng, speed, updates):
    """Samples as a locomotive's sensors make them; an update has one vehicle speed."""
    n = updates * POOLED
    creep = rng.uniform(0.0, TOP_SLIP, n)
    error = np.repeat(VEHICLE_STD * rng.standard_normal(updates), POOLED)
    wheel = speed * (1.0 + creep) / RADIUS + WHEEL_STD * rng.standard_normal(n)
    vehicle = speed + error
    slip = (RADIUS * wheel - vehicle) / vehicle
    z = adhesion(creep, *SURFACE.theta) + ADHESION_STD * rng.standard_normal(n)
    update = np.repeat(np.arange(updates), POOLED)
    place = np.tile(np.arange(POOLED), updates)
    # Six axles, 10 ms from one of their readings to the next.
    stamps = update * 20_000 + place // 6 * 10_000
    return replace(
        Samples.curve(slip, z, stamps),
        axle=place % 6 + 1,
        creep_speed=RADIUS * wheel - vehicle,
        speed=vehicle,
        slip_var=(RADIUS * WHEEL_STD / vehicle) ** 2,
        slip_common_var=(RADIUS * wheel * VEHICLE_STD / vehicle**2) ** 2,
        speed_us=update * 20_000 + 20_000,
        adhesion_var=np.full(n, ADHESION_STD**2),
    )


def one_speed(seed, task):
    """(slope, λ_m, μ_max) and their standard deviations at the end of a run, with and without."""
    speed, run = task
    samples = measured(np.random.default_rng([seed, run]), speed, UPDATES)
    found = []
    for weigh in (True, False):
        parts = TrackerSettings(errors_in_variables=weigh)
        *_, last = feed(Tracker(parts), samples)
        gradient = np.array([last.c2, last.c1, -1.0])
        slope_std = float(np.sqrt(gradient @ last.covariance @ gradient))
        values = (last.c1 * last.c2 - last.c3, last.lambda_m, last.mu_max)
        found.append((values, (slope_std, last.lambda_m_std, last.mu_max_std)))
    return found


def variables_row(report, options):
    """Bias and coverage with errors in the slips, weighed and not."""
    runs = options.runs
    c1, c2, c3 = SURFACE.theta
    truth = np.array([c1 * c2 - c3, SURFACE.lambda_m, SURFACE.mu_max])
    report.write(
        f"rail {SURFACE.theta}, slips in 0..{TOP_SLIP}, wheel speed {WHEEL_STD} rad/s, vehicle "
        f"speed {VEHICLE_STD} m/s common to {POOLED} samples, adhesion {ADHESION_STD}; {UPDATES} "
        f"updates, {runs} runs; bias ± its standard error, share within ±{NINETY} std"
    )
    tasks = [(speed, run) for speed in SPEEDS for run in range(runs)]
    results = over_cores(partial(one_speed, options.seed), tasks, options.jobs, "variables")
    for i, speed in enumerate(SPEEDS):
        own = np.array(results[i * runs : (i + 1) * runs])
        for j, way in enumerate(("weighed", "taken as exact")):
            values, stds = own[:, j, 0], own[:, j, 1]
            errors = values - truth
            bias = 100 * errors.mean(axis=0) / truth
            doubt = 100 * errors.std(axis=0) / truth / np.sqrt(runs)
            within = 100 * (np.abs(errors) <= NINETY * stds).mean(axis=0)
            shown = "; ".join(
                f"{name} {b:+.2f} ± {d:.2f} %, {w:.0f} % within"
                for name, b, d, w in zip(VALUES, bias, doubt, within, strict=True)
            )
            report.write(f"{speed:4.0f} m/s, {way}: {shown}")


# ------------------------------------------------------------------------------ low excitation


class Cell(NamedTuple):
    """What a set of runs can see of the curve."""

    noise_std: float
    top: float
    samples: int


CELLS = [
    Cell(noise_std, top, n)
    for noise_std in (0.001, 0.01, 0.1)
    for top in (0.02, 0.05, 0.1, SLIP_MAX)
    for n in (12, 120, 1200)
]


def inside(interval, truth):
    # A peak at the end of the range is there to rounding.
    return interval[0] - 1e-9 <= truth <= interval[1] + 1e-9


def judged(rng, theta, cell):
    """Whether μ_max and λ_m lie in their intervals, whether they are called identifiable, an error.

    A tracker that fails holds nothing and identifies nothing. NaN where no interval is stated.
    """
    samples = points(rng, theta, cell.noise_std, cell.samples, slip_max=cell.top)
    try:
        *_, last = feed(Tracker(), samples)
    except ValueError as error:
        return (False, False), (False, False), str(error)
    if not np.isfinite([*last.mu_max_interval, *last.lambda_m_interval]).all():
        return (np.nan, np.nan), (False, False), None
    truth = peak(*theta, slip_max=RANGE)
    held = (
        inside(last.mu_max_interval, float(truth.mu_max)),
        inside(last.lambda_m_interval, float(truth.lambda_m)),
    )
    return held, (last.identifiable.mu_max, last.identifiable.lambda_m), None


def one_cell(seed, runs, number):
    """What `judged` says on surfaces drawn from the prior, and on the published ones."""
    cell, rng = CELLS[number], np.random.default_rng([seed, number])
    drawn = Prior(PriorSettings()).sample(runs, rng)
    repeats = max(runs // 10, 1)
    published = [surface.theta for surface in PUBLISHED for _ in range(repeats)]
    return [[judged(rng, theta, cell) for theta in thetas] for thetas in (drawn, published)]


def excitation_row(report, options):
    """Coverage of the 90 % intervals, however little was seen."""
    runs = 4 * options.runs
    report.write(
        f"coverage of the 90 % intervals, surfaces drawn from the prior, {runs} runs a cell; "
        f"slips to {sorted({cell.top for cell in CELLS})}, "
        f"{sorted({cell.samples for cell in CELLS})} samples"
    )
    numbers = range(len(CELLS))
    work = partial(one_cell, options.seed, runs)
    # The longest first, so that no process is left with one of them at the end.
    order = sorted(numbers, key=lambda k: -CELLS[k].samples)
    found = dict(zip(order, over_cores(work, order, options.jobs, "excitation"), strict=True))
    failed = [error for k in numbers for each in found[k] for *_, error in each if error]
    value = f"{len(failed)}" + (f" ({failed[0]})" if failed else "")
    report.check("runs in which the tracker failed", value, "0", met=not failed)
    drawn = np.array([[held for held, *_ in found[k][0]] for k in numbers], dtype=float)
    unstated = np.isnan(drawn[..., 0])
    report.write(
        f"no interval stated in {unstated.sum()} of {unstated.size} runs: too few curves fit"
    )
    share = 100 * np.nanmean(drawn, axis=1)
    for i, value in enumerate(("μ_max", "λ_m")):
        for noise_std in sorted({cell.noise_std for cell in CELLS}):
            own = [k for k in numbers if CELLS[k].noise_std == noise_std]
            mean = float(share[own, i].mean())
            worst = min(own, key=lambda k: share[k, i])
            cell = CELLS[worst]
            report.check(
                f"{value}, noise {noise_std}: mean over the ranges, in %",
                f"{mean:.1f}; worst cell {share[worst, i]:.0f} (slip to {cell.top}, "
                f"{cell.samples} samples)",
                "85 to 95",
                met=85 <= mean <= 95,
            )
    for i, value in enumerate(("μ_max", "λ_m")):
        held = [h[i] for k in numbers for h, known, _ in found[k][1] if known[i]]
        total = sum(len(found[k][1]) for k in numbers)
        if not held:
            report.write(f"{value}: never identifiable on the published surfaces")
            continue
        covered = 100 * float(np.mean(held))
        report.check(
            f"{value} on the published surfaces where identifiable ({len(held)} of {total}), in %",
            f"{covered:.1f}",
            "at least 80",
            met=covered >= 80,
        )
