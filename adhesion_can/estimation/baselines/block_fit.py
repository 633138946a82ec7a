"""One fit per block: ordinary differential evolution, SciPy's, and bounded least squares.

Blocks are independent, as in the paper's block processing: nothing is kept between them but a
start, and changes of the surface are not detected. A block that spans a change gives a mixture.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.forgetting import select_usable
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.batch_fit import fit
from adhesion_can.estimation.curves.gauss_newton import NormalEquations, minimise, normal_equations
from adhesion_can.estimation.differential_evolution import (
    Objective,
    first_theta,
    search,
)
from adhesion_can.estimation.identifiability import IdentifiabilitySettings, assess
from adhesion_can.estimation.likelihood import innovation, sensitivity, sum_of_squares
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

BlockFit = Callable[[Samples, Estimate | None, np.random.Generator], Estimate]
"""Fit of one block, given the estimate of the block before and the estimator's random numbers."""

REFIT_RATIO = 1.2
"""Residual, over that of the last fit, from which a refinement is repeated from a scan.

The residual of 500 samples scatters by 3 %; the paper's surfaces differ by much more than noise.
"""


class BlockEstimator:
    """Collects samples into blocks and gives the fit of the latest full one.

    Args:
        block: Number of samples of a block.
        identifiability: Settings with the range of slip.
        fit_block: Fit of one block.
        rng: Generator of the fit's random numbers, the estimator's own: a copy of the estimator
            draws as it would have drawn. None for a fit that draws none.

    """

    def __init__(
        self,
        block: int,
        identifiability: IdentifiabilitySettings,
        fit_block: BlockFit,
        rng: np.random.Generator | None = None,
    ) -> None:
        self._block = block
        self._rng = np.random.default_rng(0) if rng is None else rng
        self._slip_max = identifiability.slip_max
        self._fit = fit_block
        self._waiting: deque[Samples] = deque()
        self._current: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it; a new estimate once per block."""
        del now_us  # a block is a number of samples, not a time
        new = select_usable(samples, self._slip_max)
        if len(new):
            self._waiting.append(new)
        while sum(map(len, self._waiting)) >= self._block:
            joined = Samples.concatenate(list(self._waiting))
            self._waiting.clear()
            if len(joined) > self._block:
                self._waiting.append(joined.select(slice(self._block, None)))
            self._add(joined.select(slice(self._block)))
        return self._current

    def _add(self, block: Samples) -> None:
        fresh, current = self._fit(block, self._current, self._rng), self._current
        self._current = (
            fresh if current is None else replace(fresh, surface_since_us=current.surface_since_us)
        )


def evolution_estimator(
    settings: EvolutionSettings, identifiability: IdentifiabilitySettings
) -> BlockEstimator:
    """Ordinary differential evolution (Storn & Price 1997), DE/rand/1/bin with F = 0.5.

    Population, generations, crossover and range are those of `settings`: the paper's algorithm
    without its two changes, every block searched again from a population uniform over the range.

    Args:
        settings: Settings of the search; `start`, `factor` and `innovation` are not used.
        identifiability: Limits from which the peak counts as identifiable, and range of slip.

    """
    ordinary = replace(settings, start="uniform", factor=0.5)
    rng = np.random.default_rng(settings.seed)
    unused = first_theta(settings, rng)

    def fit_block(block: Samples, last: Estimate | None, rng: np.random.Generator) -> Estimate:
        del last
        optimum = search(*block.folded(), unused, ordinary, rng)
        return assess(optimum.theta, optimum.cost, block, identifiability)

    return BlockEstimator(settings.block, identifiability, fit_block, rng)


def scipy_evolution_estimator(
    settings: EvolutionSettings, identifiability: IdentifiabilitySettings
) -> BlockEstimator:
    """`scipy.optimize.differential_evolution` on each block.

    SciPy's own strategy ('best1bin', F drawn from 0.5..1 again for each generation, crossover 0.7,
    Latin hypercube) with the range, population and generations of `settings`. Two defaults of
    SciPy are not used: its stop at a 1 % spread of J, since J has a floor of noise of which 1 % is
    a coarse answer; and its polishing, which is another method (`least-squares`).

    Args:
        settings: Settings of the search; `crossover`, `start`, `factor` and `innovation` are not
            used.
        identifiability: Limits from which the peak counts as identifiable, and range of slip.

    """
    bounds = list(zip(settings.lower, settings.upper, strict=True))

    def fit_block(block: Samples, last: Estimate | None, rng: np.random.Generator) -> Estimate:
        del last
        h, z = block.folded()
        objective = Objective(h, z)
        optimum = scipy.optimize.differential_evolution(
            lambda columns: objective(columns.T),
            bounds,
            # SciPy's population is a multiple of the three parameters.
            popsize=max(settings.population // len(bounds), 2),
            maxiter=settings.generations,
            tol=0.0,
            polish=False,
            updating="deferred",
            vectorized=True,
            # `rng` since SciPy 1.15; later versions still accept the older name.
            seed=rng,
        )
        return assess(optimum.x, sum_of_squares(optimum.x, h, z), block, identifiability)

    rng = np.random.default_rng(settings.seed)
    return BlockEstimator(settings.block, identifiability, fit_block, rng)


def least_squares_estimator(
    settings: EvolutionSettings, identifiability: IdentifiabilitySettings
) -> BlockEstimator:
    """Bounded nonlinear least squares on each block, started from the last estimate.

    Args:
        settings: Settings of the search; only `block`, `lower` and `upper` are used.
        identifiability: Limits from which the peak counts as identifiable, and range of slip.

    """

    def fit_block(block: Samples, last: Estimate | None, rng: np.random.Generator) -> Estimate:
        del rng
        return fit_from(last, block, settings, identifiability)

    return BlockEstimator(settings.block, identifiability, fit_block)


def fit_from(
    last: Estimate | None,
    samples: Samples,
    settings: EvolutionSettings,
    identifiability: IdentifiabilitySettings,
) -> Estimate:
    """Least squares from the last estimate, or from a scan if the residual has grown.

    Args:
        last: Last estimate, the start; None at the first fit.
        samples: Samples, at least one, finite and in the range of slip.
        settings: Settings with the search range `lower` to `upper`.
        identifiability: Limits from which the peak counts as identifiable, and range of slip.

    """
    if last is not None:
        near = _refined(last, samples, settings, identifiability)
        if near.noise_std <= REFIT_RATIO * last.noise_std:
            return near
    return _refined(fit(samples, identifiability), samples, settings, identifiability)


def _refined(
    start: Estimate,
    samples: Samples,
    settings: EvolutionSettings,
    identifiability: IdentifiabilitySettings,
) -> Estimate:
    """Least squares within the search range, by damped Gauss-Newton steps."""
    h, z = samples.folded()
    weight = np.ones(len(h))

    def evaluate(theta: Array) -> NormalEquations:
        return normal_equations(innovation(theta, h, z), sensitivity(theta, h).T, weight)

    bounds = np.array(settings.lower), np.array(settings.upper)
    theta, best = minimise(evaluate, np.array(start.theta), bounds, steps=200, converged=1e-10)
    return assess(theta, best.cost, samples, identifiability)
