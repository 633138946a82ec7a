"""What tables of independent points carry: fits that know the law and look for its numbers alone.

No diagnosis can reach more on average: it has the form to find as well.
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from _rows import positive
from scipy.optimize import least_squares

from tests.worlds import make_world
from tests.worlds.contact_laws import NAMES, make_law

MU_MAX, LAMBDA_M = 0.01, 0.08
"""Relative errors that the hunt allows."""
REACH = 0.7
"""Largest logarithmic deviation of a number from the true one, where the fit begins."""


def fit(path, law):
    """Law of the true form with the numbers that fit a table of points best."""
    slip, adhesion, speed, load = np.loadtxt(path, delimiter=",", skiprows=1).T
    names, true = list(law.parameters), np.array(list(law.parameters.values()))
    upper = np.full(len(true), REACH)
    if "kA" in names:  # a share, at most 1
        place = names.index("kA")
        upper[place] = max(float(np.log(1.0 / true[place])), 1e-3)

    def of(x):
        return make_law(law.form, dict(zip(names, true * np.exp(x), strict=True)))

    def residual(x):
        return of(x).adhesion(slip, speed, load) - adhesion

    found = least_squares(residual, np.zeros(len(true)), bounds=(np.full(len(true), -REACH), upper))
    return of(found.x), len(slip)


def measure(tables, seed):
    """(points, μ_max within its limit, λ_m within its; NaN on a plateau) of every table."""
    rows = []
    with TemporaryDirectory(prefix="points-") as folder:
        path = Path(folder) / "points.csv"
        for name in NAMES:
            for number in range(tables):
                truth = make_world(f"points:{name}", seed + number, path)
                law, points = fit(path, truth.effects[0])
                mu_max, lambda_m = law.peak(truth.peak.speed, truth.peak.load)
                inside = abs(mu_max / truth.peak.mu_max - 1) < MU_MAX
                place = abs(lambda_m / truth.peak.lambda_m - 1) < LAMBDA_M
                rows.append((points, inside, place if truth.peak.interior else np.nan))
    return np.array(rows, dtype=float)


def main():
    parser = argparse.ArgumentParser(prog="tools/bench points", description=__doc__)
    parser.add_argument("--tables", type=positive(int), default=30, metavar="N", help="of each law")
    parser.add_argument("--seed", type=int, default=900, metavar="N", help="of the first table")
    options = parser.parse_args()
    rows = measure(options.tables, options.seed)
    print("| points | tables | μ_max within 1 % | λ_m within 8 % |")
    print("|---|---|---|---|")
    for count in (*np.unique(rows[:, 0]), None):
        some = rows if count is None else rows[rows[:, 0] == count]
        label = "all" if count is None else f"{count:.0f}"
        shares = f"{100 * some[:, 1].mean():.0f} % | {100 * np.nanmean(some[:, 2]):.0f} %"
        print(f"| {label} | {len(some)} | {shares} |")


if __name__ == "__main__":
    main()
