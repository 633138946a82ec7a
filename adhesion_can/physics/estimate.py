"""Estimates of the adhesion curve: parameters, peak, standard deviations and identifiability."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, NamedTuple

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.result_text import html_table, plus_minus
from adhesion_can.values import Value


@dataclass(frozen=True, slots=True)
class Identifiable:
    """Whether the data suffice to identify the peak of the curve.

    Attributes:
        mu_max: Whether the height μ_max of the peak is identifiable.
        lambda_m: Whether the slip ratio λ_m of the peak is identifiable.

    """

    mu_max: bool
    lambda_m: bool

    @property
    def both(self) -> bool:
        """Whether height and slip ratio of the peak are identifiable."""
        return self.mu_max and self.lambda_m


class PeakEstimate(NamedTuple):
    """Peak of a curve with its standard deviations.

    Attributes:
        mu_max: Largest adhesion coefficient, 1.
        lambda_m: Slip ratio of the largest adhesion, 1.
        mu_max_std: Standard deviation of `mu_max`, 1.
        lambda_m_std: Standard deviation of `lambda_m`, 1.

    """

    mu_max: float
    lambda_m: float
    mu_max_std: float
    lambda_m_std: float


CHANGED = 0.5
"""Probability of a change of the surface from which the change is declared."""


@dataclass(frozen=True, slots=True)
class Estimate(Value):
    """Estimated adhesion curve with its uncertainty.

    Attributes:
        c1: Level of the Burckhardt curve (eq. 5).
        c2: Steepness of the Burckhardt curve (eq. 5).
        c3: Fall of the Burckhardt curve beyond its peak (eq. 5).
        covariance: Covariance of (c1, c2, c3), shape (3, 3); inf on the diagonal where unknown.
        mu_max: Largest adhesion coefficient μ_max (eq. 6).
        mu_max_std: Standard deviation of μ_max; inf where unknown.
        lambda_m: Slip ratio λ_m at μ_max (eq. 6).
        lambda_m_std: Standard deviation of λ_m; inf where unknown.
        noise_std: Standard deviation of the measured adhesion about the curve.
        samples: Number of samples that the estimate rests on.
        identifiable: Whether the data suffice to identify the peak.
        surface_since_us: Stamp of the first sample of the current surface, µs.
        change_probability: Probability that the surface changed within the last update, 0..1.
        per_axle: (μ_max, λ_m) by axle number, where an estimator follows single axles.
        mu_max_interval: 90 % interval of μ_max; unbounded where an estimator gives none.
        lambda_m_interval: 90 % interval of λ_m; unbounded where an estimator gives none.
        doubt: Condition that the residual depends on, where the model cannot explain it;
            NOT_AVAILABLE where an estimator does not look for any.
        family: Name of the curve family that is the most probable one; c1, c2 and c3 are those of
            the nearest Burckhardt curve. None where an estimator has Burckhardt's alone.
        objection: Why nobody vouches for the estimate, where that is so.
        observed_speed: Vehicle speed that wheels and efforts show, m/s; None where it is measured.

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
    doubt: Doubt = Doubt.NOT_AVAILABLE
    family: str | None = None
    objection: Objection = Objection.NONE
    observed_speed: float | None = None

    @property
    def theta(self) -> CurveParameters:
        """(c1, c2, c3)."""
        return (self.c1, self.c2, self.c3)

    def objected(self, objection: Objection) -> "Estimate":
        """The estimate with an objection to it: nothing of its peak is known."""
        return replace(
            self,
            objection=objection,
            mu_max_std=inf,
            lambda_m_std=inf,
            identifiable=Identifiable(mu_max=False, lambda_m=False),
            mu_max_interval=(-inf, inf),
            lambda_m_interval=(-inf, inf),
        )

    def to_dict(self) -> dict[str, Any]:
        """Values and standard deviations as JSON has them.

        The standard deviation of what is not identifiable is None. `doubt` and `family` are
        there only where the estimator looks for any.
        """
        known = self.identifiable
        variances = self.covariance.diagonal()
        doubt = self.doubt.json_name

        def number(value: float, std: float, identifiable: bool) -> dict[str, float | None]:
            return {"value": value, "std": std if identifiable and std < inf else None}

        curve = {
            name: number(value, float(max(variance, 0.0)) ** 0.5, known.both)
            for name, value, variance in zip(("c1", "c2", "c3"), self.theta, variances, strict=True)
        }
        return {
            **curve,
            "mu_max": number(self.mu_max, self.mu_max_std, known.mu_max),
            "lambda_m": number(self.lambda_m, self.lambda_m_std, known.lambda_m),
            "noise_std": self.noise_std,
            "samples": self.samples,
            "identifiable": {"mu_max": known.mu_max, "lambda_m": known.lambda_m},
            **({} if doubt is None else {"doubt": doubt}),
            **({} if self.family is None else {"family": self.family}),
        }

    def _repr_html_(self) -> str:
        document = self.to_dict()
        rows = [
            (name, plus_minus(document[name]["value"], document[name]["std"]))
            for name in ("mu_max", "lambda_m", "c1", "c2", "c3")
        ]
        title = f"Adhesion curve from {self.samples} samples, ± standard deviation"
        return html_table(title, ("quantity", "estimate"), rows)


def has_peak(estimate: Estimate | PeakEstimate) -> bool:
    """Whether a curve has a peak: a flat one, as where all efforts read 0, has none."""
    return estimate.mu_max > 0.0 and estimate.lambda_m > 0.0
