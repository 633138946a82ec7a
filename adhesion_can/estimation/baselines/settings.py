"""Settings of the baselines, apart from the estimators: a configuration needs these alone."""

from dataclasses import dataclass
from typing import Annotated, Literal

from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.ranges import Within, require_ranges


@dataclass(frozen=True, slots=True, kw_only=True)
class EvolutionSettings:
    """Settings of the search; the paper's Table 2 is not available, so defaults are our choice.

    Attributes:
        population: Number of individuals; a mutation takes three others. Larger: surer to find the
            minimum, slower.
        generations: Number of generations of one search. Larger: closer to the minimum, slower.
        crossover: Crossover probability CR that a parameter comes from the mutant.
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

    population: Annotated[int, Within(4, 20000)] = 30
    generations: Annotated[int, Within(1, 10000)] = 50
    crossover: Annotated[float, Within(0, 1)] = 0.9
    lower: Annotated[tuple[float, float, float], Within(0, 10), Within(0, 1e5), Within(0, 1000)] = (
        0.01,
        2.0,
        1e-4,
    )
    upper: Annotated[
        tuple[float, float, float], Within(1e-6, 10), Within(1e-6, 1e5), Within(1e-6, 1000)
    ] = (1.5, 400.0, 1.0)
    population_std: Annotated[tuple[float, float, float], Within(0, 1e5)] = (0.1, 40.0, 0.2)
    innovation: Literal["mean", "sum"] = "mean"
    start: Literal["previous", "uniform"] = "previous"
    factor: Annotated[float | None, Within(0.001, 10)] = None
    theta0: Annotated[CurveParameters | None, Within(0, 10), Within(0, 1e5), Within(0, 1000)] = None
    block: Annotated[int, Within(1, 10000)] = 500
    seed: Annotated[int, Within(0, 2**32 - 1)] = 1

    def __post_init__(self) -> None:
        require_ranges(self)
        if not all(lo < up for lo, up in zip(self.lower, self.upper, strict=True)):
            raise ValueError("each lower bound must be below its upper bound")
        if self.innovation not in ("mean", "sum") or self.start not in ("previous", "uniform"):
            raise ValueError("innovation is 'mean' or 'sum', start 'previous' or 'uniform'")
        if self.theta0 is not None and not all(
            lo <= x <= up for lo, x, up in zip(self.lower, self.theta0, self.upper, strict=True)
        ):
            raise ValueError("theta0 must lie within lower and upper")


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

    window: Annotated[int, Within(1, 100000)] = 120
    ratio: Annotated[float, Within(0.001, 1e6)] = 2.0
    floor: Annotated[float, Within(1e-9, 1)] = 0.003
    structure: Annotated[float, Within(0, 1e9)] = 25.0

    def __post_init__(self) -> None:
        require_ranges(self)
