"""Simulation-based calibration (Talts et al. 2018): ranks of the true μ_max and λ_m in posteriors.

Surfaces are drawn from an estimator's own prior and given to it in short drives, whatever the
status. Ranks of a right posterior are uniform. Those of drives whose slips went well beyond the
peak are shown by themselves, too.
"""

import argparse
import os
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import scipy.stats

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(1, str(ROOT))

from _report import Report, over_cores  # noqa: E402  after the path
from _rows import positive  # noqa: E402

from adhesion_can.arrays import Array  # noqa: E402
from adhesion_can.estimation.families.binned_samples import BinnedSamples  # noqa: E402
from adhesion_can.estimation.families.comparison import (  # noqa: E402
    GRID,
    _drawn_curves,
    _top,
)
from adhesion_can.estimation.families.curve_points import build_points  # noqa: E402
from adhesion_can.estimation.families.family_fit import (  # noqa: E402
    PRIORS,
    coordinate_bounds,
    fit_from_starts,
    to_coordinates,
    to_values,
)
from adhesion_can.estimation.tracker.prior import Prior  # noqa: E402
from adhesion_can.estimation.tracker.settings import PriorSettings  # noqa: E402
from adhesion_can.estimation.tracker.tracker import Tracker  # noqa: E402
from adhesion_can.physics.burckhardt import adhesion  # noqa: E402
from adhesion_can.physics.curves import FAMILIES, Conditions, CurveFamily  # noqa: E402
from adhesion_can.physics.samples import Samples  # noqa: E402

TIMES_S = (1.0, 3.0, 9.0)
"""Times at which the posterior is asked."""
RATE_HZ = 300
"""Samples of all axles a second."""
UPDATE = 12
"""Samples of an update."""
NOISE_VAR, NOISE_FREEDOM = 1e-4, 4.0
"""Prior of the noise variance: what the tracker takes from samples that state it."""
REACH = (0.02, 0.3)
"""Largest slip of a drive, drawn evenly in its logarithm, whatever the surface."""
SPEED, LOAD = 10.0, 1.1e5
LEAST_P = 0.01
WELL_BEYOND = 1.5
"""Largest slip over λ_m from which a drive has gone well beyond the peak."""
VALUES = ("mu_max", "lambda_m")


def noise_std(rng: np.random.Generator) -> float:
    return float(np.sqrt(NOISE_FREEDOM * NOISE_VAR / rng.chisquare(NOISE_FREEDOM)))


def slips(rng: np.random.Generator, n: int) -> Array:
    low, high = np.log(REACH)
    return np.asarray(rng.uniform(0.0, np.exp(rng.uniform(low, high)), n))


def weighted_rank(values: Array, weights: Array, truth: float) -> float:
    """Share of the posterior below the truth."""
    return float(weights @ ((values < truth) + 0.5 * (values == truth)))


def rank_in_tracker(seed: int, run: int) -> list[list[float]]:
    """Ranks of μ_max and λ_m in the tracker's posterior, and the reach, at each time."""
    rng = np.random.default_rng([seed, run])
    theta = Prior(PriorSettings()).sample(1, rng)[0]
    c1, c2, c3 = theta
    s = np.log(c1 * c2 / c3)
    true = (c1 * (1.0 - np.exp(-s) * (1.0 + s)), s / c2)
    n = round(TIMES_S[-1] * RATE_HZ)
    slip = slips(rng, n)
    measured = adhesion(slip, *theta) + noise_std(rng) * rng.standard_normal(n)
    stamps = np.round(np.arange(n) * 1e6 / RATE_HZ).astype(np.int64)
    samples = replace(Samples.curve(slip, measured, stamps), adhesion_var=np.full(n, NOISE_VAR))
    tracker = Tracker()
    posterior = tracker._memories  # noqa: SLF001  no estimate has it
    found, asked = [], [round(t * RATE_HZ) for t in TIMES_S]
    for begin in range(0, n, UPDATE):
        part = samples.select(slice(begin, begin + UPDATE))
        tracker.update(part, int(part.t_us[-1]))
        if begin + UPDATE in asked:
            curves, weights = zip(*posterior.leading(0.0), strict=True)
            weight = np.concatenate(weights)
            peaks = np.concatenate([one.peaks for one in curves], axis=1)
            own = [weighted_rank(peaks[k], weight, true[k]) for k in (0, 1)]
            found.append([*own, float(slip.max() / true[1])])
    return found


def rank_in_family(name: str, seed: int, run: int) -> list[list[float]]:
    """Ranks of μ_max and λ_m in a family's normal approximation, and the reach, at each time."""
    rng = np.random.default_rng([seed, run])
    family, conditions = FAMILIES[name], Conditions(SPEED, LOAD)
    values = draw_values(family, rng)
    true = _top(GRID, family.adhesion(GRID, values, conditions))
    n = round(TIMES_S[-1] * RATE_HZ)
    slip, std = slips(rng, n), noise_std(rng)
    one = np.ones(n)
    measured = family.adhesion(slip, values, Conditions(SPEED * one, LOAD * one))
    measured = measured + std * rng.standard_normal(n)
    samples = replace(Samples.curve(slip, measured), speed=SPEED * one, load=LOAD * one)
    found = []
    for seconds in TIMES_S:
        part = samples.select(slice(round(seconds * RATE_HZ)))
        points = build_points(BinnedSamples.from_samples(part, std), (0.35, 45.0, 0.3))
        fit = fit_from_starts(points, family, 1.0)
        drawn = _drawn_curves(fit, GRID, conditions)
        tops = np.array([_top(GRID, curve)[:2] for curve in drawn])
        even = np.full(len(tops), 1.0 / len(tops))
        own = [weighted_rank(tops[:, k], even, true[k]) for k in (0, 1)]
        found.append([*own, float(slip.max() / true[1])])
    return found


def draw_values(family: CurveFamily, rng: np.random.Generator) -> Array:
    """Parameters drawn from a family's prior, within its bounds."""
    prior = PRIORS[family.name]
    centre = to_coordinates(family, np.array(prior.mean))
    lower, upper = coordinate_bounds(family)
    while True:
        drawn = centre + np.array(prior.std) * rng.standard_normal(len(centre))
        if ((drawn > lower) & (drawn < upper)).all():
            return to_values(family, drawn)


def measure(report: Report, options: argparse.Namespace) -> None:
    report.write(
        f"{options.runs} drives an estimator, {RATE_HZ} samples a second up to a slip of "
        f"{REACH[0]} to {REACH[1]}; p of Kolmogorov and Smirnov's test that ranks are uniform"
    )
    ways = {"tracker (Burckhardt)": rank_in_tracker}
    ways |= {f"family {name}": partial(rank_in_family, name) for name in PRIORS}
    for title, way in ways.items():
        ranks = np.array(
            over_cores(partial(way, options.seed), range(options.runs), options.jobs, title)
        )
        for k, value in enumerate(VALUES):
            for place, seconds in enumerate(TIMES_S):
                own, reach = ranks[:, place, k], ranks[:, place, 2]
                p, text = describe(own)
                _, beyond = describe(own[reach > WELL_BEYOND])
                report.check(
                    f"{title}, {value} after {seconds:.0f} s",
                    f"{text}; well beyond the peak {beyond}",
                    f"p above {LEAST_P}",
                    met=p > LEAST_P,
                )


def describe(ranks: Array) -> tuple[float, str]:
    """P-value of uniform ranks, and the figures in words."""
    p = float(scipy.stats.kstest(ranks, "uniform").pvalue)
    inside = float(np.mean((ranks > 0.025) & (ranks < 0.975)))
    return p, f"p {p:.3f}, mean rank {ranks.mean():.3f}, 95 % intervals hold {inside:.1%}"


def parse_options(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="tools/bench ranks", description=__doc__)
    add, count = parser.add_argument, positive(int)
    add("--runs", type=count, default=2000, metavar="N", help="drives (default 2000)")
    add("--seed", type=count, default=1, metavar="N", help="of all random numbers (default 1)")
    add("--jobs", type=count, default=os.cpu_count() or 1, metavar="N",
        help="processes (default all)")  # fmt: skip
    return parser.parse_args(arguments)


def main() -> None:
    report = Report()
    measure(report, parse_options())
    print(f"\n{report.met} of {report.met + len(report.missed)} targets met")
    for what in report.missed:
        print(f"  MISSED: {what}")


if __name__ == "__main__":
    main()
