"""Simulation-based calibration (Talts et al. 2018): ranks of the true μ_max and λ_m in posteriors.

Surfaces are drawn from an estimator's own prior and given to it in short drives, whatever the
status. Ranks of a right posterior are uniform. Those of drives whose slips went well beyond the
peak are shown by themselves, too.
"""

import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import scipy.stats

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(1, str(ROOT))

from _data import POOLED, feed, points  # noqa: E402  after the path
from _report import Report, over_cores  # noqa: E402
from _rows import positive, random_parser  # noqa: E402

from adhesion_can.estimation.curves.binned_points import build_points  # noqa: E402
from adhesion_can.estimation.curves.binned_samples import BinnedSamples  # noqa: E402
from adhesion_can.estimation.curves.coordinates import coordinates_of  # noqa: E402
from adhesion_can.estimation.curves.evidence import WEIGHED, fit_from_starts  # noqa: E402
from adhesion_can.estimation.curves.online_comparison import GRID  # noqa: E402
from adhesion_can.estimation.curves.peak import find_top  # noqa: E402
from adhesion_can.estimation.tracker.prior import Prior  # noqa: E402
from adhesion_can.estimation.tracker.settings import PriorSettings  # noqa: E402
from adhesion_can.estimation.tracker.tracker import Tracker  # noqa: E402
from adhesion_can.physics.burckhardt import peak  # noqa: E402
from adhesion_can.physics.curves import FAMILIES, Conditions  # noqa: E402
from adhesion_can.physics.samples import Samples  # noqa: E402

RATE_HZ = 300
"""Samples of all axles a second."""
TIMES_S = (1.0, 3.0, 9.0)
"""Times at which the posterior is asked, s."""
COUNTS = tuple(round(seconds * RATE_HZ) for seconds in TIMES_S)
NOISE_VAR, NOISE_FREEDOM = 1e-4, 4.0
"""Prior of the noise variance: what the tracker takes from samples that state it."""
REACH = (0.02, 0.3)
"""Largest slip of a drive, drawn evenly in its logarithm, whatever the surface."""
SPEED, LOAD = 10.0, 1.1e5
NEARBY = (0.35, 45.0, 0.3)
"""(c1, c2, c3) for the weights of points; without errors of the slip they do not matter."""
LEAST_P = 0.01
WELL_BEYOND = 1.5
"""Largest slip over λ_m from which a drive has gone well beyond the peak."""
VALUES = ("mu_max", "lambda_m")


def draw_noise_and_reach(rng):
    """Standard deviation of the adhesion's noise, and the largest slip."""
    noise_std = np.sqrt(NOISE_FREEDOM * NOISE_VAR / rng.chisquare(NOISE_FREEDOM))
    return float(noise_std), float(np.exp(rng.uniform(*np.log(REACH))))


def rank(values, truth, weights=None):
    """Share of a posterior below the truth."""
    return float(np.average((values < truth) + 0.5 * (values == truth), weights=weights))


def rank_in_tracker(seed, run):
    """Largest slip over λ_m, and ranks in the tracker's posterior: μ_max, λ_m at each time."""
    rng = np.random.default_rng([seed, run])
    theta = Prior(PriorSettings()).sample(1, rng)[0]
    true = peak(*theta, slip_max=np.inf)
    noise_std, reach = draw_noise_and_reach(rng)
    samples = points(rng, theta, noise_std, COUNTS[-1], slip_max=reach, rate_hz=RATE_HZ)
    samples = replace(samples, adhesion_var=np.full(len(samples), NOISE_VAR))
    tracker, ranks = Tracker(), []
    posterior = tracker._memories  # noqa: SLF001  no estimate has it
    for number, _ in enumerate(feed(tracker, samples), start=1):
        if number * POOLED in COUNTS:
            curves, weights = zip(*posterior.leading(0.0), strict=True)
            peaks = np.concatenate([one.peaks for one in curves], axis=1)
            both = zip(peaks, (true.mu_max, true.lambda_m), strict=False)
            ranks += [rank(values, truth, np.concatenate(weights)) for values, truth in both]
    return [reach / float(true.lambda_m), *ranks]


def rank_in_family(name, seed, run):
    """Largest slip over λ_m, and ranks in a family's normal approximation, as `rank_in_tracker`."""
    rng = np.random.default_rng([seed, run])
    family, conditions = FAMILIES[name], Conditions(SPEED, LOAD)
    values = draw_values(family, rng)
    true = find_top(GRID, family.adhesion(GRID, values, conditions))[:2]
    noise_std, reach = draw_noise_and_reach(rng)
    slip, one = rng.uniform(0.0, reach, COUNTS[-1]), np.ones(COUNTS[-1])
    adhesion = family.adhesion(slip, values, Conditions(SPEED * one, LOAD * one))
    measured = adhesion + noise_std * rng.standard_normal(len(slip))
    samples = replace(Samples.curve(slip, measured), speed=SPEED * one, load=LOAD * one)
    ranks = []
    for count in COUNTS:
        binned = BinnedSamples.from_samples(samples.select(slice(count)), noise_std)
        fit = fit_from_starts(build_points(binned, NEARBY), family, 1.0)
        tops = find_top(GRID, fit.draw_curves(GRID, conditions))[:2]
        ranks += [rank(drawn, truth) for drawn, truth in zip(tops, true, strict=True)]
    return [reach / true[1], *ranks]


def draw_values(family, rng):
    """Parameters drawn from a family's prior, within its bounds."""
    coordinates = coordinates_of(family)
    while True:
        noise = rng.standard_normal(len(coordinates.centre))
        drawn = coordinates.centre + coordinates.precision**-0.5 * noise
        if ((drawn > coordinates.lower) & (drawn < coordinates.upper)).all():
            return coordinates.to_values(drawn)


def measure(report, options):
    report.write(
        f"{options.runs} drives an estimator, {RATE_HZ} samples a second up to a slip of "
        f"{REACH[0]} to {REACH[1]}; p of Kolmogorov and Smirnov's test that ranks are uniform"
    )
    ways = {"tracker (Burckhardt)": rank_in_tracker}
    ways |= {f"family {one.name}": partial(rank_in_family, one.name) for one in WEIGHED}
    for title, way in ways.items():
        runs = over_cores(partial(way, options.seed), range(options.runs), options.jobs, title)
        reach, *ranks = np.array(runs).T
        cells = [(seconds, value) for seconds in TIMES_S for value in VALUES]
        for (seconds, value), own in zip(cells, ranks, strict=True):
            p, text = describe(own)
            _, beyond = describe(own[reach > WELL_BEYOND])
            report.check(
                f"{title}, {value} after {seconds:.0f} s",
                f"{text}; well beyond the peak {beyond}",
                f"p above {LEAST_P}",
                met=p > LEAST_P,
            )


def describe(ranks):
    """P-value of uniform ranks, and the figures in words."""
    p = float(scipy.stats.kstest(ranks, "uniform").pvalue)
    inside = float(np.mean((ranks > 0.025) & (ranks < 0.975)))
    return p, f"p {p:.3f}, mean rank {ranks.mean():.3f}, 95 % intervals hold {inside:.1%}"


def main():
    parser = random_parser("ranks", __doc__)
    parser.add_argument(
        "--runs", type=positive(int), default=2000, metavar="N", help="drives (default 2000)"
    )
    report = Report()
    measure(report, parser.parse_args())
    report.summarise()


if __name__ == "__main__":
    main()
