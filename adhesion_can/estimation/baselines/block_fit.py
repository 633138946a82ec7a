"""One fit per block: ordinary differential evolution, SciPy's, and bounded least squares.

Each block stands alone, as in the paper's block processing: no memory between blocks but a start,
and no watch for changes of the rail. A block that spans a change gives a mixture.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy

from adhesion_can.estimation.baselines.forgetting import usable
from adhesion_can.estimation.batch_fit import fit
from adhesion_can.estimation.differential_evolution import (
    EvolutionSettings,
    Objective,
    first_theta,
    search,
)
from adhesion_can.estimation.identifiability import IdentifiabilitySettings, assess
from adhesion_can.estimation.likelihood import innovation, sensitivity, sum_of_squares
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

BlockFit = Callable[[Samples, Estimate | None], Estimate]
"""Fit of one block, given the estimate of the block before."""

POORER = 1.2
"""Residual, over that of the last fit, from which a refinement is taken to have ended badly: the
residual of 500 samples scatters by 3 %, the paper's surfaces differ by much more than noise."""


class BlockEstimator:
    """Collects samples into blocks and gives the fit of the latest full one.

    Args:
        block: samples of a block.
        identifiability: for the range of slip.
        fit_block: the fit.

    """

    def __init__(
        self, block: int, identifiability: IdentifiabilitySettings, fit_block: BlockFit
    ) -> None:
        self._block = block
        self._slip_max = identifiability.slip_max
        self._fit = fit_block
        self._waiting: deque[Samples] = deque()
        self._held: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """See `Estimator.update`; the estimate moves once per block of samples."""
        del now_us  # a block is a number of samples, not a time
        new = usable(samples, self._slip_max)
        if len(new):
            self._waiting.append(new)
        while sum(map(len, self._waiting)) >= self._block:
            joined = Samples.concatenate(list(self._waiting))
            self._waiting.clear()
            if len(joined) > self._block:
                self._waiting.append(joined.select(slice(self._block, None)))
            self._take(joined.select(slice(self._block)))
        return self._held

    def _take(self, block: Samples) -> None:
        fresh, held = self._fit(block, self._held), self._held
        self._held = (
            fresh if held is None else replace(fresh, surface_since_us=held.surface_since_us)
        )


def evolution_estimator(
    settings: EvolutionSettings, identifiability: IdentifiabilitySettings
) -> BlockEstimator:
    """Ordinary differential evolution (Storn & Price 1997), DE/rand/1/bin with F = 0.5.

    Population, generations, crossover and range are those of `settings`: the paper's algorithm
    without its two changes, every block searched anew from a population uniform over the range.

    Args:
        settings: `start`, `factor` and `innovation` are not used.
        identifiability: see there.

    """
    ordinary = replace(settings, start="uniform", factor=0.5)
    rng = np.random.default_rng(settings.seed)
    unused = first_theta(settings, rng)

    def fit_block(block: Samples, last: Estimate | None) -> Estimate:
        del last
        found = search(*block.folded(), unused, ordinary, rng)
        return assess(found.theta, found.cost, block, identifiability)

    return BlockEstimator(settings.block, identifiability, fit_block)


def scipy_evolution_estimator(
    settings: EvolutionSettings, identifiability: IdentifiabilitySettings
) -> BlockEstimator:
    """`scipy.optimize.differential_evolution` on each block.

    SciPy's own strategy ('best1bin', F drawn from 0.5..1 anew for each generation, crossover 0.7,
    Latin hypercube) with the range, population and generations of `settings`. Two defaults of
    SciPy are not taken. Its stop at a 1 % spread of J, since J has a floor of noise of which 1 %
    is a coarse answer. Its polishing, since that is another method, which `least-squares` stands
    for.

    Args:
        settings: `crossover`, `start`, `factor` and `innovation` are not used.
        identifiability: see there.

    """
    rng = np.random.default_rng(settings.seed)
    bounds = list(zip(settings.lower, settings.upper, strict=True))

    def fit_block(block: Samples, last: Estimate | None) -> Estimate:
        del last
        h, z = block.folded()
        objective = Objective(h, z)
        found = scipy.optimize.differential_evolution(
            lambda columns: objective(columns.T),
            bounds,
            # SciPy's population is a multiple of the three parameters.
            popsize=max(settings.population // len(bounds), 2),
            maxiter=settings.generations,
            tol=0.0,
            polish=False,
            updating="deferred",
            vectorized=True,
            # The name of before SciPy 1.15, which later ones take as well; `rng` they alone do.
            seed=rng,
        )
        return assess(found.x, sum_of_squares(found.x, h, z), block, identifiability)

    return BlockEstimator(settings.block, identifiability, fit_block)


def least_squares_estimator(
    settings: EvolutionSettings, identifiability: IdentifiabilitySettings
) -> BlockEstimator:
    """Bounded nonlinear least squares on each block, started from the last estimate.

    Args:
        settings: only `block`, `lower` and `upper` are used.
        identifiability: see there.

    """

    def fit_block(block: Samples, last: Estimate | None) -> Estimate:
        return fit_from(last, block, settings, identifiability)

    return BlockEstimator(settings.block, identifiability, fit_block)


def fit_from(
    last: Estimate | None,
    samples: Samples,
    settings: EvolutionSettings,
    identifiability: IdentifiabilitySettings,
) -> Estimate:
    """Least squares from the last estimate, and from `batch.fit`'s scan where that ends badly.

    Args:
        last: start; None at the first fit.
        samples: at least one, finite, in the range of slip.
        settings: for `lower` and `upper`.
        identifiability: see there.

    """
    if last is not None:
        near = _refined(last, samples, settings, identifiability)
        if near.noise_std <= POORER * last.noise_std:
            return near
    return _refined(fit(samples, identifiability), samples, settings, identifiability)


def _refined(
    start: Estimate,
    samples: Samples,
    settings: EvolutionSettings,
    identifiability: IdentifiabilitySettings,
) -> Estimate:
    """Trust-region least squares (`scipy.optimize.least_squares`) within the search range."""
    h, z = samples.folded()
    theta = np.clip(start.theta, settings.lower, settings.upper)
    found = scipy.optimize.least_squares(
        lambda theta: innovation(theta, h, z),
        theta,
        jac=lambda theta: -sensitivity(theta, h),
        bounds=(settings.lower, settings.upper),
        x_scale=np.maximum(theta, 1e-3),
        xtol=1e-10,
        ftol=1e-10,
        gtol=1e-10,
    )
    return assess(found.x, sum_of_squares(found.x, h, z), samples, identifiability)
