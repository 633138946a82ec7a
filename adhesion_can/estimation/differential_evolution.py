"""The paper's modified differential evolution, eq. 16 and 17, in matrix form.

He et al. change two things in ordinary differential evolution (Storn & Price 1997): the first
population is around the last estimate (eq. 16), and the variation factor follows the innovation
(eq. 17). What the paper leaves open is a field of `EvolutionSettings`.

R. Storn, K. Price, "Differential evolution", Journal of Global Optimization 11, 1997.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.likelihood import innovation

BINS = 1000
"""Number of bins of slip in which all data are summed. With slips up to 0.2 the paper's first curve
departs from a straight line by 2e-6 within one."""


def variation_factor(size: ArrayLike) -> Array:
    """Variation factor F(k) = 0.3 + 0.8/(1 + e^(−10 |z̃(k)| + 2)), eq. 17, from the innovation."""
    return np.asarray(0.3 + 0.8 / (1.0 + np.exp(-10.0 * np.abs(np.asarray(size)) + 2.0)))


def first_population(
    theta: ArrayLike, settings: EvolutionSettings, rng: np.random.Generator
) -> Array:
    """First population: θ(k−1) + N(0, σ), eq. 16, or uniform; shape (population, 3).

    θ(k−1) itself is its first individual, so that a search never ends worse than it began. Values
    outside the bounds are mirrored back, so that they do not pile up on the bounds.
    """
    lower, upper = np.array(settings.lower), np.array(settings.upper)
    shape = (settings.population, 3)
    if settings.start == "uniform":
        return np.asarray(lower + (upper - lower) * rng.random(shape))
    individuals = np.asarray(theta) + np.array(settings.population_std) * rng.standard_normal(shape)
    individuals[0] = theta
    individuals = np.where(individuals < lower, 2 * lower - individuals, individuals)
    individuals = np.where(individuals > upper, 2 * upper - individuals, individuals)
    return np.asarray(np.clip(individuals, lower, upper))


class Objective:
    """J of eq. 13 for a whole population at once, with one exponential per point and individual.

    Expanded, J(θ) needs of the data only Σ1, Σz, Σz², Σh, Σh², Σhz, and of each c2 the sums of
    e, e², e·z, e·h with e = e^(−c2 h): four products instead of a residual matrix.

    Args:
        h: Slip ratios, shape (n,).
        z: Adhesion coefficients, shape (n,).
        weight: Weight of each point, shape (n,); None: 1.

    """

    def __init__(self, h: Array, z: Array, weight: Array | None = None) -> None:
        w = np.ones_like(h) if weight is None else weight
        self._minus_h = -h
        self._weight = weight
        self._basis = np.column_stack([w, w * z, w * h])
        self._n = w.sum()
        self._z, self._zz = (w * z).sum(), (w * z) @ z
        self._h, self._hh, self._hz = (w * h).sum(), (w * h) @ h, (w * h) @ z

    def __call__(self, individuals: Array) -> Array:
        """J of each row (c1, c2, c3) of `individuals`, shape (population,)."""
        c1, c2, c3 = individuals.T
        e = np.exp(np.multiply.outer(c2, self._minus_h))
        e1, ez, eh = (e @ self._basis).T
        ee = np.einsum("ij,ij->i", e, e) if self._weight is None else (e * e) @ self._weight
        return np.asarray(
            self._zz
            + c1 * (c1 * (self._n - 2 * e1 + ee) + 2 * (ez - self._z) + 2 * c3 * (eh - self._h))
            + c3 * (c3 * self._hh + 2 * self._hz)
        )


class Search(NamedTuple):
    """Result of one search.

    Attributes:
        theta: Best parameters (c1, c2, c3), shape (3,).
        cost: Sum of squares J of the best parameters, eq. 13.

    """

    theta: Array
    cost: float


def search(
    h: Array,
    z: Array,
    theta: ArrayLike,
    settings: EvolutionSettings,
    rng: np.random.Generator,
    weight: Array | None = None,
) -> Search:
    """One run of the modified differential evolution (DE/rand/1/bin) over one set of data.

    Args:
        h: Slip ratios, ≥ 0, shape (n,).
        z: Adhesion coefficients, shape (n,).
        theta: Estimate θ̂(k−1) before these data, shape (3,).
        settings: Settings of the search.
        rng: Generator of the random numbers.
        weight: Weight of each point, shape (n,); None: 1.

    """
    objective = Objective(h, z, weight)
    lower, upper = np.array(settings.lower), np.array(settings.upper)
    individuals = first_population(theta, settings, rng)
    costs = objective(individuals)
    factor = settings.factor if settings.factor is not None else _factor(theta, h, z, settings)
    # All random numbers of the run at once: drawn by generation they cost more than the rest.
    partners = _three_others(settings.generations, settings.population, rng)
    # Genes are taken from the mutant, at least one by each individual.
    shape = (settings.generations, settings.population, 3)
    forced = rng.integers(0, 3, shape[:2])[..., None] == np.arange(3)
    crossed = (rng.random(shape) < settings.crossover) | forced
    for (a, b, c), gene in zip(partners, crossed, strict=True):
        mutant = individuals[a] + factor * (individuals[b] - individuals[c])
        trial = np.where(gene, mutant, individuals)
        # Halfway to the bound that was passed.
        trial = np.where(trial < lower, (individuals + lower) / 2, trial)
        trial = np.where(trial > upper, (individuals + upper) / 2, trial)
        trial_costs = objective(trial)
        better = trial_costs <= costs
        individuals[better] = trial[better]
        costs[better] = trial_costs[better]
    best = int(costs.argmin())
    return Search(individuals[best].copy(), float(costs[best]))


def _factor(theta: ArrayLike, h: Array, z: Array, settings: EvolutionSettings) -> float:
    size = np.abs(innovation(theta, h, z))
    return float(variation_factor(size.mean() if settings.innovation == "mean" else size.sum()))


def _three_others(generations: int, population: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices of three distinct partners of each individual; shape (generations, 3, population).

    Drawn without repetition as offsets 1..population−1 from the individual: the second skips the
    first, the third skips both in ascending order.
    """
    shape = (generations, population)
    a = rng.integers(1, population, shape)
    b = rng.integers(1, population - 1, shape)
    b += b >= a
    c = rng.integers(1, population - 2, shape)
    c += c >= np.minimum(a, b)
    c += c >= np.maximum(a, b)
    offsets = np.stack([a, b, c], axis=1)
    return np.asarray((np.arange(population) + offsets) % population)


def first_theta(settings: EvolutionSettings, rng: np.random.Generator) -> Array:
    """First estimate θ̂(0): the one that is set, else drawn from the bounds; shape (3,)."""
    if settings.theta0 is not None:
        return np.array(settings.theta0, dtype=np.float64)
    lower, upper = np.array(settings.lower), np.array(settings.upper)
    return np.asarray(lower + (upper - lower) * rng.random(3))


def identify_sequence(h: Array, z: Array, settings: EvolutionSettings) -> Array:
    """Sequence processing: θ̂(k) from all data up to k, with the innovation of sample k alone.

    Args:
        h: Slip ratios in the order of their arrival, shape (n,).
        z: Adhesion coefficients, shape (n,).
        settings: Settings of the search.

    Returns:
        Estimates θ̂(1..n), shape (n, 3).

    """

    def advance(k: int, theta: Array, rng: np.random.Generator) -> Search:
        step = _with_factor_of(h[k], z[k], theta, settings)
        return search(h[: k + 1], z[: k + 1], theta, step, rng)

    return _trace(len(h), settings, advance)


def _trace(
    count: int,
    settings: EvolutionSettings,
    advance: Callable[[int, Array, np.random.Generator], Search],
) -> Array:
    """Estimates θ̂(1..count), each from a search that starts at the one before; shape (count, 3).

    Args:
        count: Number of searches.
        settings: Settings with the first estimate and the seed.
        advance: Function that makes the search of a number, from 0, given the estimate before it.

    """
    rng = np.random.default_rng(settings.seed)
    theta = first_theta(settings, rng)
    path = np.empty((count, 3))
    for k in range(count):
        theta = advance(k, theta, rng).theta
        path[k] = theta
    return path


def _with_factor_of(
    h: float, z: float, theta: Array, settings: EvolutionSettings
) -> EvolutionSettings:
    """Settings with the variation factor, eq. 17, of one sample, where none is fixed."""
    if settings.factor is not None:
        return settings
    size = innovation(theta, np.array([h]), np.array([z]))[0]
    return replace(settings, factor=float(variation_factor(size)))


def identify_all_data(h: Array, z: Array, settings: EvolutionSettings) -> Array:
    """Sequence processing of the samples of blocks: θ̂(k) from all data up to the end of block k.

    The samples are summed in `BINS` bins of slip, each at the means of its slips and adhesions, so
    that a search does not take longer as the data grow. The innovation is that of the block's last
    sample.

    Args:
        h: Slip ratios, shape (n,); a last, incomplete block is left out.
        z: Adhesion coefficients, shape (n,).
        settings: Settings of the search.

    Returns:
        Estimates θ̂ after each block, shape (n // block, 3).

    """
    width = max(float(h.max(initial=0.0)), 1e-12) / (BINS - 1)
    sums = np.zeros((3, BINS))  # of 1, of the slips, of the adhesions

    def advance(k: int, theta: Array, rng: np.random.Generator) -> Search:
        block = slice(k * settings.block, (k + 1) * settings.block)
        place = (h[block] / width).astype(np.int64)
        sums[0] += np.bincount(place, minlength=BINS)
        sums[1] += np.bincount(place, h[block], minlength=BINS)
        sums[2] += np.bincount(place, z[block], minlength=BINS)
        weight, sum_h, sum_z = sums[:, sums[0] > 0]
        last = block.stop - 1
        step = _with_factor_of(h[last], z[last], theta, settings)
        return search(sum_h / weight, sum_z / weight, theta, step, rng, weight)

    return _trace(len(h) // settings.block, settings, advance)


def identify_blocks(h: Array, z: Array, settings: EvolutionSettings) -> Array:
    """Block processing: θ̂(k) from block k alone, of `settings.block` samples each.

    Args:
        h: Slip ratios, shape (n,); a last, incomplete block is left out.
        z: Adhesion coefficients, shape (n,).
        settings: Settings of the search.

    Returns:
        Estimates θ̂ after each block, shape (n // block, 3).

    """

    def advance(k: int, theta: Array, rng: np.random.Generator) -> Search:
        block = slice(k * settings.block, (k + 1) * settings.block)
        return search(h[block], z[block], theta, settings, rng)

    return _trace(len(h) // settings.block, settings, advance)
