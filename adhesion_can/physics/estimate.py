"""Estimates of the adhesion curve: parameters, peak, standard deviations and identifiability."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf

from adhesion_can.arrays import Array


@dataclass(frozen=True, slots=True)
class Identifiable:
    """Whether the data seen so far can tell the peak's height and its place."""

    mu_max: bool
    lambda_m: bool

    @property
    def both(self) -> bool:
        """Both of them."""
        return self.mu_max and self.lambda_m


CHANGED = 0.5
"""Probability of a change of the rail from which it is declared."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """What an estimator believes of the rail, with how far it can be believed.

    Attributes:
        c1: Burckhardt's parameters, eq. 5.
        c2: likewise.
        c3: likewise.
        covariance: of (c1, c2, c3), shape (3, 3), inf on the diagonal where the data say nothing.
        mu_max: peak adhesion, eq. 6.
        mu_max_std: its standard deviation; inf where unknown.
        lambda_m: optimal slip ratio, eq. 6.
        lambda_m_std: its standard deviation; inf where unknown.
        noise_std: of adhesion around the curve.
        samples: number that the estimate rests on.
        identifiable: whether the peak can be told from them.
        surface_since_us: when the present surface was first seen, µs.
        change_probability: that the surface changed within the last update, 0..1.
        per_axle: (μ_max, λ_m) of single axles where an estimator tells them apart.
        mu_max_interval: 90 % interval of μ_max; unbounded where an estimator states none.
        lambda_m_interval: likewise of λ_m.

    """

    c1: float
    c2: float
    c3: float
    covariance: Array
    mu_max: float
    mu_max_std: float
    lambda_m: float
    lambda_m_std: float
    noise_std: float
    samples: int
    identifiable: Identifiable
    surface_since_us: int
    change_probability: float = 0.0
    per_axle: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    mu_max_interval: tuple[float, float] = (-inf, inf)
    lambda_m_interval: tuple[float, float] = (-inf, inf)

    @property
    def theta(self) -> tuple[float, float, float]:
        """(c1, c2, c3)."""
        return (self.c1, self.c2, self.c3)
