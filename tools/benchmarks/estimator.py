"""The paper's estimator on a block of 500 samples, against SciPy's with the same effort."""

import time
from statistics import median

import numpy as np
from scipy.optimize import differential_evolution, least_squares

from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.differential_evolution import search
from adhesion_can.estimation.likelihood import innovation, sum_of_squares
from adhesion_can.physics.burckhardt import adhesion

# Our experiment surfaces; the rail switches from one to the next.
SURFACES = ((0.5, 30.0, 0.08), (0.25, 20.0, 0.10), (0.4, 40.0, 0.06))
NOISE = (0.01, 0.1)
BLOCKS = 30
RUNS = 4
SPEED_TARGET, ACCURACY_TARGET = 8.0, 0.01


def best_cost(h, z, settings, truth):
    """J_min: least squares from several starts."""
    starts = [truth, (0.3, 100.0, 0.3), (0.3, 10.0, 0.2), (1.0, 50.0, 0.5)]
    bounds = (settings.lower, settings.upper)
    return min(
        2
        * least_squares(
            lambda t: innovation(t, h, z), start, bounds=bounds, x_scale=(1, 30, 1),
            xtol=1e-14, ftol=1e-14, gtol=1e-14,
        ).cost
        for start in starts
    )  # fmt: skip


def scipy_search(h, z, settings, seed):
    return differential_evolution(
        lambda t: sum_of_squares(t, h, z),
        list(zip(settings.lower, settings.upper, strict=True)),
        popsize=settings.population // 3,
        maxiter=settings.generations,
        recombination=settings.crossover,
        polish=False,
        tol=0,
        rng=seed,
    )


def main():
    settings = EvolutionSettings()
    print(
        f"blocks of {settings.block} samples, slip uniform in 0..0.2, the rail switches every "
        f"{BLOCKS // 3} blocks; {settings.population} individuals, "
        f"{settings.generations} generations"
    )
    for noise in NOISE:
        ratios, ours, theirs, excess, excess_scipy = [], [], [], [], []
        rng = np.random.default_rng(7)
        for run in range(RUNS):
            theta = np.array(SURFACES[0])
            for k in range(BLOCKS):
                truth = SURFACES[3 * k // BLOCKS]
                h = rng.uniform(0, 0.2, settings.block)
                z = adhesion(h, *truth) + noise * rng.standard_normal(settings.block)
                began = time.perf_counter()
                found = search(h, z, theta, settings, rng)
                middle = time.perf_counter()
                peer = scipy_search(h, z, settings, run * BLOCKS + k)
                ended = time.perf_counter()
                theta = found.theta
                ours.append(middle - began)
                theirs.append(ended - middle)
                ratios.append((ended - middle) / (middle - began))
                lowest = best_cost(h, z, settings, truth)
                excess.append((sum_of_squares(theta, h, z) - lowest) / noise**2)
                excess_scipy.append((peer.fun - lowest) / noise**2)
        met = "met" if median(ratios) >= SPEED_TARGET else "MISSED"
        print(f"\nnoise sd {noise}: {RUNS * BLOCKS} blocks")
        print(
            f"  time a block, median: {1e3 * median(ours):.2f} ms, "
            f"SciPy {1e3 * median(theirs):.2f} ms; "
            f"ratio {median(ratios):.1f} (target {SPEED_TARGET:.0f}: {met})"
        )
        met = "met" if median(excess) <= ACCURACY_TARGET else "MISSED"
        print(
            f"  (J - J_min)/noise², median: {median(excess):.1e} "
            f"(target {ACCURACY_TARGET}: {met}), "
            f"95 %: {np.quantile(excess, 0.95):.1e}, within target in "
            f"{100 * np.mean(np.array(excess) <= ACCURACY_TARGET):.0f} % of the blocks; "
            f"SciPy median {median(excess_scipy):.1e}"
        )


if __name__ == "__main__":
    main()
