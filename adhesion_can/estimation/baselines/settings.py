"""Settings of the baselines, apart from the estimators: a configuration needs these alone."""

from dataclasses import dataclass
from math import inf, isfinite
from typing import Literal

from adhesion_can.physics.burckhardt import CurveParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class EvolutionSettings:
    """Settings of the search; the paper's Table 2 is not available, so defaults are our choice.

    Attributes:
        population: Number of individuals, at least 4. Larger: surer to find the minimum, slower.
        generations: Number of generations of one search. Larger: closer to the minimum, slower.
        crossover: Crossover probability CR that a parameter comes from the mutant, in 0..1.
        lower: Lower bounds of (c1, c2, c3), 1.
        upper: Upper bounds of (c1, c2, c3), 1.
        population_std: Standard deviations σ of the first population around the last estimate, of
            (c1, c2, c3), eq. 16, 1. Larger: wider search, slower convergence.
        innovation: Size of a block's innovation in eq. 17: 'mean' of |z̃|, or 'sum', as the paper
            puts it, which for 500 samples saturates F at 1.1.
        start: First population: 'previous' around the last estimate, eq. 16, or 'uniform' over the
            bounds, as in the ordinary algorithm.
        factor: Fixed variation factor F; None for eq. 17.
        theta0: First estimate of (c1, c2, c3), 1; None draws it from the bounds, as in the paper's
            experiment 1.
        block: Number of samples of a block. Larger: less noise, later estimates.
        seed: Seed of the random numbers.

    """

    population: int = 30
    generations: int = 50
    crossover: float = 0.9
    lower: tuple[float, float, float] = (0.01, 2.0, 1e-4)
    upper: tuple[float, float, float] = (1.5, 400.0, 1.0)
    population_std: tuple[float, float, float] = (0.1, 40.0, 0.2)
    innovation: Literal["mean", "sum"] = "mean"
    start: Literal["previous", "uniform"] = "previous"
    factor: float | None = None
    theta0: CurveParameters | None = None
    block: int = 500
    seed: int = 1

    def __post_init__(self) -> None:
        if self.population < 4:
            raise ValueError("a mutation takes three others: population must be at least 4")
        if self.generations < 1 or self.block < 1:
            raise ValueError("generations and block must be at least 1")
        if not all(0 <= lo < up < inf for lo, up in zip(self.lower, self.upper, strict=True)):
            raise ValueError("each lower bound must be below its upper bound, and not negative")
        if self.innovation not in ("mean", "sum") or self.start not in ("previous", "uniform"):
            raise ValueError("innovation is 'mean' or 'sum', start 'previous' or 'uniform'")
        if self.theta0 is not None and not all(
            lo <= x <= up for lo, x, up in zip(self.lower, self.theta0, self.upper, strict=True)
        ):
            raise ValueError("theta0 must lie within lower and upper")
        if self.factor is not None and not (isfinite(self.factor) and self.factor > 0):
            raise ValueError("factor must be positive")
        if self.seed < 0:
            raise ValueError("seed must not be negative")
        if not 0 <= self.crossover <= 1 or not all(0 <= std < inf for std in self.population_std):
            raise ValueError("crossover must be in 0..1, population_std not negative")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangeSettings:
    """Change detection of the paper's estimator: an innovation test on the latest samples.

    Attributes:
        window: Number of latest samples that are tested. Larger: smaller changes are detected,
            later.
        ratio: Root mean square of the innovations, over the one that noise explains, from which a
            change is declared, 1. Larger: fewer false alarms, and small changes are missed.
        floor: Least standard deviation of the adhesion noise in the test, 1. Larger: less
            sensitive on very quiet data.
        structure: F statistic of the innovations' means over neighbouring slips that a change
            needs, 1, so that a mere increase of the noise is no change. Larger: fewer false alarms.

    """

    window: int = 120
    ratio: float = 2.0
    floor: float = 0.003
    structure: float = 25.0

    def __post_init__(self) -> None:
        if not (self.window >= 1 and self.ratio > 0 and self.floor > 0):
            raise ValueError("window, ratio and floor must be positive")
