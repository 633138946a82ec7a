"""μ_max while the wheels have used only a part of it: error beside the least possible, coverage.

The mean of the exact posterior has the least error of all estimators that know the prior and the
noise, but not which share of μ_max was used.
"""

import sys
from functools import partial
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(1, str(ROOT))

from _data import POOLED, feed, points  # noqa: E402  after the path
from _exact_posterior import exact_posterior  # noqa: E402
from _prepeak_bound import (  # noqa: E402
    LARGEST_SLIP,
    components,
    draw_surface,
    local_variance,
    log_peak,
    slip_at_use,
    theta_of,
    van_trees_variance,
)
from _report import Report, over_cores  # noqa: E402
from _rows import positive, random_parser  # noqa: E402

from adhesion_can.estimation.identifiability import IdentifiabilitySettings  # noqa: E402
from adhesion_can.estimation.tracker.settings import PriorSettings  # noqa: E402
from adhesion_can.estimation.tracker.tracker import Tracker  # noqa: E402

USED = (0.5, 0.6, 0.7, 0.8, 0.9, 0.95)
"""Largest adhesion of the samples as a share of μ_max."""
LARGEST_RATIO, COVERAGE = 1.2, (0.90, 0.97)
NINETY_FIVE = 1.96
BOUND_DRAWS = 100
"""Surfaces a component over which the bounds are averaged."""


def estimate_once(options, task):
    """Error and std of ln μ_max, whether it and the peak are identifiable, the local bound.

    Then error and std of the exact posterior's mean.
    """
    used, run = task
    rng = np.random.default_rng([options["seed"], run])
    parts = components(PriorSettings())
    weights = np.array([weight for weight, *_ in parts])
    _, centre, scale = parts[rng.choice(len(parts), p=weights / weights.sum())]
    phi = draw_surface(rng, centre, scale)
    theta = theta_of(phi)
    top = slip_at_use(theta, used)
    samples = points(rng, theta, options["noise_std"], options["samples"], slip_max=top)
    *_, last = feed(Tracker(), samples)
    truth, noise_std = log_peak(phi), options["noise_std"]
    exact = exact_posterior(samples.slip, samples.adhesion, noise_std, parts, LARGEST_SLIP, truth)
    return (
        np.log(max(last.mu_max, 1e-6)) - truth,
        last.mu_max_std / last.mu_max if last.mu_max > 0 else np.inf,
        last.identifiable.mu_max,
        last.identifiable.both,
        local_variance(phi, scale, used, options["samples"], noise_std),
        exact.mean - truth,
        exact.std,
    )


def summarise(found, largest_std):
    """Figures of the runs at one share: pure, for the report.

    Args:
        found: What `estimate_once` gave for each run.
        largest_std: Largest relative standard deviation that the settings allow.
    """
    error, std, known, tracking, local, best, best_std = (
        np.array(column) for column in zip(*found, strict=True)
    )
    covered = np.abs(error) <= NINETY_FIVE * std
    return {
        "rmse": float(np.sqrt(np.mean(error**2))),
        "stated": float(np.sqrt(np.mean(std**2))),
        "bias": float(error.mean()),
        "local_bound": float(np.sqrt(np.mean(local))),
        "coverage": float(covered.mean()),
        "low_excitation": float(1.0 - np.mean(tracking.astype(bool))),
        "exact_rmse": float(np.sqrt(np.mean(best**2))),
        "exact_coverage": float(np.mean(np.abs(best) <= NINETY_FIVE * best_std)),
        "known_but_wide": int(np.sum(known.astype(bool) & (std > largest_std))),
    }


def van_trees(seed, used, samples, noise_std, draws=BOUND_DRAWS):
    """Bound of van Trees of ln μ_max over the whole prior, rms."""
    rng = np.random.default_rng([seed, 77])
    parts = components(PriorSettings())
    total = 0.0
    for weight, centre, scale in parts:
        phis = [draw_surface(rng, centre, scale) for _ in range(draws)]
        total += weight * van_trees_variance(phis, scale, used, samples, noise_std)
    return float(np.sqrt(total / sum(weight for weight, *_ in parts)))


def measure(report, options):
    largest = IdentifiabilitySettings().mu_max_std
    report.write(
        f"surfaces drawn from the tracker's prior, {options.runs} runs; {options.samples} samples "
        f"in updates of {POOLED}, adhesion noise {options.noise_std}; errors of ln μ_max, in %"
    )
    tasks = [(used, run) for used in USED for run in range(options.runs)]
    chosen = {"seed": options.seed, "noise_std": options.noise_std, "samples": options.samples}
    found = over_cores(partial(estimate_once, chosen), tasks, options.jobs, "prepeak")
    for number, used in enumerate(USED):
        own = summarise(found[number * options.runs : (number + 1) * options.runs], largest)
        least = van_trees(options.seed, used, options.samples, options.noise_std)
        local = own["local_bound"]
        report.write(
            f"used {used:.0%}: RMSE {100 * own['rmse']:.2f}, bias {100 * own['bias']:+.2f}; bound "
            f"of van Trees {100 * least:.2f}, local {100 * local:.2f}; standard deviation of the "
            f"posterior {100 * own['stated']:.2f}; LOW_EXCITATION {own['low_excitation']:.0%}; the "
            f"exact posterior: RMSE {100 * own['exact_rmse']:.2f}, {own['exact_rmse'] / local:.2f} "
            f"of the local bound, coverage {own['exact_coverage']:.1%}"
        )
        what = f"used {used:.0%}: RMSE over the local bound"
        report.at_most(what, own["rmse"] / local, LARGEST_RATIO, ".2f")
        what = f"used {used:.0%}: RMSE over that of the exact posterior's mean"
        report.at_most(what, own["rmse"] / own["exact_rmse"], LARGEST_RATIO, ".2f")
        low, high = COVERAGE
        report.check(
            f"used {used:.0%}: coverage of ±{NINETY_FIVE} std",
            f"{own['coverage']:.1%}",
            f"{low:.0%} to {high:.0%}",
            met=low <= own["coverage"] <= high,
        )
        report.check(
            f"used {used:.0%}: called identifiable with a std above {largest:.0%}",
            str(own["known_but_wide"]),
            "0",
            met=own["known_but_wide"] == 0,
        )


def parse_options(arguments=None):
    parser = random_parser("prepeak", __doc__)
    add, count = parser.add_argument, positive(int)
    add("--runs", type=count, default=100, metavar="N", help="runs at each share (default 100)")
    add("--samples", type=count, default=1200, metavar="N", help="samples of a run (default 1200)")
    add("--noise-std", type=positive(float), default=0.01, metavar="X",
        help="of the adhesion (default 0.01)")  # fmt: skip
    return parser.parse_args(arguments)


def main():
    report = Report()
    measure(report, parse_options())
    report.summarise()


if __name__ == "__main__":
    main()
