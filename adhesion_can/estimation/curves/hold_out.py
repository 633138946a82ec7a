"""Comparison of curve families by held-out score, and the peak pooled over those that hold.

A family is judged by the mean log density of samples that had no part in its fit. Families whose
difference to the best is within its chance error cannot be separated by the data. Its score for a
reader is the RMSE of the whitened residuals of these samples. The peak is the
mixture of theirs, with weights by pseudo-Bayesian model averaging with the Bayesian bootstrap
(Yao, Vehtari, Simpson & Gelman, "Using stacking to average Bayesian predictive distributions",
Bayesian Analysis 13 (2018) 917), so its standard deviation holds their spread.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.curves.fit import (
    FittedCurve,
    effective_variance,
    fit_family,
    fit_values,
    log_density,
    mean_square_residual,
    standardised_residual,
)
from adhesion_can.estimation.curves.points import CurvePoints, correlation_factor
from adhesion_can.estimation.curves.result import CurveComparison, ScoredFit
from adhesion_can.physics.burckhardt import SLIP_MAX
from adhesion_can.physics.curves import FAMILIES, CurveFamily
from adhesion_can.physics.samples import Samples

LEAST_SAMPLES = 30
"""Number of samples below which no families are compared."""
TICK_US = 10
"""Mean distance of stamps, µs, below which points have no time: they are independent."""
CHANCE = 2.0
"""Standard errors of a difference of scores within which two families are not separated."""
SMALL = 4.0
"""Difference of the log density of all data below which its standard error cannot be trusted
(Sivula, Magnusson & Vehtari, arXiv 2008.10296)."""
BOOTSTRAPS = 2000
"""Draws of the Bayesian bootstrap over blocks."""
FOLDS = 5
"""Parts of a recording of which each is predicted from the others."""
BLOCKS, SHORTEST_BLOCK_S = 40, 1.0
"""Number of blocks in time, and their shortest duration, s."""
REPEATS, REPEATED_FOLDS = 2, 10
"""Repetitions and parts of the hold-out of independent points."""


@dataclass(frozen=True, slots=True)
class HoldOutPlan:
    """Parts of the data that are predicted from the rest.

    Attributes:
        folds: Number of the fold of each sample, a row for each repetition, shape (r, n).
        block: Number of the block of each sample, shape (n,): blocks are taken as independent.
        text: What is held out, for reports.

    """

    folds: NDArray[np.int64]
    block: NDArray[np.int64]
    text: str


def number_time_blocks(samples: Samples) -> tuple[NDArray[np.int64], float]:
    """Number of the block in time of each sample, shape (n,), and a block's length, s."""
    since = (samples.t_us - samples.t_us.min()) * 1e-6
    length = max(float(since.max()) / BLOCKS, SHORTEST_BLOCK_S)
    return (since // length).astype(np.int64), length


def plan_hold_out(samples: Samples, *, independent: bool) -> HoldOutPlan:
    """Hold-out of blocks in time, or of single points where they are independent.

    Args:
        samples: Samples in the order of their stamps.
        independent: Whether the errors of the samples are independent of each other.

    """
    n = len(samples)
    if independent:
        # Neighbours in slip go to different folds, so that each fold covers the whole curve.
        rng = np.random.default_rng(0)
        order = np.argsort(np.abs(samples.slip), kind="stable")
        parts = min(REPEATED_FOLDS, n)
        folds = np.empty((REPEATS, n), dtype=np.int64)
        for row in folds:
            dealt = [rng.permutation(parts) for _ in range(-(-n // parts))]
            row[order] = np.concatenate(dealt)[:n]
        text = f"{n} points, each predicted from nine tenths of the others, {REPEATS} times"
        return HoldOutPlan(folds, np.arange(n), text)
    block, length = number_time_blocks(samples)
    if block.max() + 1 < FOLDS:  # too short for blocks of their own
        block = np.minimum(np.arange(n) * FOLDS // max(n, 1), FOLDS - 1)
    text = f"blocks of {length:.1f} s in five groups, each predicted from the other four"
    return HoldOutPlan((block % FOLDS)[None], block, text)


def compare_families(
    samples: Samples,
    families: Sequence[CurveFamily] = tuple(FAMILIES.values()),
    *,
    slip_max: float = SLIP_MAX,
) -> CurveComparison | None:
    """Fit families to samples of one surface and compare them by held-out score.

    Args:
        samples: Samples in the order of their stamps, finite.
        families: Families to compare, at least one.
        slip_max: End of the range in which peaks are looked for, slip ratio.

    Returns:
        Comparison; None for fewer samples than `LEAST_SAMPLES`.

    """
    if len(samples) < LEAST_SAMPLES:
        return None
    independent = are_independent(samples)
    plan = plan_hold_out(samples, independent=independent)
    fits = [
        fit_family(samples, family, slip_max=slip_max, independent=independent)
        for family in families
    ]
    held_out = [_HeldOut.build(samples, fit, plan) for fit in fits]
    densities = np.stack([score.log_density for score in held_out])
    best = int(np.argmax(densities.mean(axis=1)))
    factor = 1.0
    if not independent:
        points = CurvePoints.from_samples(samples)
        values = np.array(fits[best].values)
        residual = standardised_residual(
            points, fits[best].family, values, fits[best].noise_std ** 2
        )
        factor = correlation_factor(residual, samples)
    blocks = np.stack([np.bincount(plan.block, row) for row in densities]) / factor
    behind = blocks[best] - blocks
    error = np.sqrt(blocks.shape[1]) * behind.std(axis=1)
    total = behind.sum(axis=1)
    plausible = total <= np.maximum(CHANCE * error, SMALL)
    weights = _bootstrap_weights(blocks[plausible])
    scale = factor / len(samples)
    every = np.zeros(len(fits))
    every[plausible] = weights
    scored = [
        ScoredFit(
            fit=fits[i],
            held_out_rmse=float(np.sqrt(np.mean(held_out[i].square / held_out[best].variance))),
            log_density=float(densities[i].mean()),
            behind=float(total[i] * scale),
            behind_std=float(error[i] * scale),
            plausible=bool(plausible[i]),
            weight=float(every[i]),
        )
        for i in np.argsort(total, kind="stable")
    ]
    held = [s for s in scored if s.plausible]
    mu = _pool([(s.weight, s.fit.mu_max, s.fit.mu_max_std) for s in held])
    lam = _pool([(s.weight, s.fit.lambda_m, s.fit.lambda_m_std) for s in held])
    return CurveComparison(
        families=tuple(scored),
        mu_max=mu[0],
        mu_max_std=mu[1],
        lambda_m=lam[0],
        lambda_m_std=lam[1],
        samples=len(samples),
        speed=float(np.mean(samples.speed)),
        held_out=plan.text,
    )


def are_independent(samples: Samples) -> bool:
    """Whether samples are points without a time, such as rows of a table without `time_s`."""
    return int(np.ptp(samples.t_us)) <= TICK_US * len(samples)


@dataclass(frozen=True, slots=True)
class _HeldOut:
    """Each sample under fits to the other folds, mean of the repetitions; shape (n,) each.

    Attributes:
        log_density: Log density of the adhesion.
        square: Square of the residual.
        variance: Effective variance of the adhesion.

    """

    log_density: Array
    square: Array
    variance: Array

    @classmethod
    def build(cls, samples: Samples, fit: FittedCurve, plan: HoldOutPlan) -> "_HeldOut":
        """Hold out fold by fold, fitted from the fit to all samples."""
        points = CurvePoints.from_samples(samples)
        sums = np.zeros((3, len(samples)))
        for folds in plan.folds:
            numbers = np.unique(folds)
            cells = [points.select(folds == number).compressed() for number in numbers]
            for i, number in enumerate(numbers):
                rest = CurvePoints.concatenate([c for j, c in enumerate(cells) if j != i])
                values, noise_var = fit_values(rest, fit.family, [fit.values])
                held = folds == number
                part = points.select(held)
                sums[0, held] += log_density(part, fit.family, values, noise_var)
                sums[1, held] += mean_square_residual(part, fit.family, values)
                sums[2, held] += effective_variance(part, fit.family, values, noise_var)
        return cls(*(sums / len(plan.folds)))


def _bootstrap_weights(blocks: NDArray[np.float64]) -> Array:
    """Weights of families from the log densities of independent blocks, shape (families, blocks).

    Mean of the normalised likelihoods under Dirichlet weights of the blocks.
    """
    rng = np.random.default_rng(0)
    count = blocks.shape[1]
    shares = rng.dirichlet(np.ones(count), BOOTSTRAPS)
    logs = count * shares @ blocks.T
    likelihood = np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray((likelihood / likelihood.sum(axis=1, keepdims=True)).mean(axis=0))


def _pool(parts: Sequence[tuple[float, float, float]]) -> tuple[float, float]:
    """Mean and standard deviation of a mixture of (weight, mean, standard deviation)."""
    weights, means, stds = np.array(parts).T
    known = np.isfinite(stds)
    if not known.any() or weights[known].sum() < 0.5:
        return float(weights @ means), float("inf")
    weights = np.where(known, weights, 0.0) / weights[known].sum()
    stds = np.where(known, stds, 0.0)
    mean = float(weights @ means)
    return mean, float(np.sqrt(weights @ (stds**2 + (means - mean) ** 2)))
