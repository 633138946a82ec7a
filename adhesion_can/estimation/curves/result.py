"""Result of a comparison of curve families: fits with their scores, and the pooled peak."""

from dataclasses import dataclass
from math import hypot, isfinite
from typing import Any

from adhesion_can.estimation.curves.fit import FittedCurve
from adhesion_can.result_text import HELD_OUT_RMSE, html_table, plus_minus

COMMON_SLIP = 0.004
"""Standard deviation of the error that all slip ratios share: vehicle speed 0.3 %, wheel radius
0.25 %. No fit sees it, and it belongs to the peak of the rail; likewise that of the adhesion."""
COMMON_ADHESION = 0.02
"""Relative standard deviation of the error that all adhesion coefficients share: effort from motor
current and load of the axle."""


@dataclass(frozen=True, slots=True)
class ScoredFit:
    """Fit of one family with its held-out score.

    Attributes:
        fit: Fit to all samples.
        held_out_rmse: RMSE of the whitened residuals of held-out samples, in standard deviations of
            the best family's noise; smaller is better.
        log_density: Mean log density of a held-out sample, from which the weights follow.
        behind: Difference of the best family's log density to this one's, per sample; 0 for the
            best.
        behind_std: Standard error of that difference.
        plausible: Whether the data cannot separate the family from the best one.
        weight: Weight of its peak in the pooled one; 0 where not plausible.

    """

    fit: FittedCurve
    held_out_rmse: float
    log_density: float
    behind: float
    behind_std: float
    plausible: bool
    weight: float

    def to_dict(self) -> dict[str, Any]:
        """Fit and score as JSON has them."""
        return {
            "curve": self.fit.family.name,
            "held_out_rmse": self.held_out_rmse,
            "held_out_score": self.log_density,
            "behind": {"value": self.behind, "std": self.behind_std},
            "plausible": self.plausible,
            "weight": self.weight,
            **self.fit.to_dict(),
        }


@dataclass(frozen=True, slots=True)
class CurveComparison:
    """Families of curves compared on the same samples.

    Attributes:
        families: Fits with their scores, the best first.
        mu_max: Pooled adhesion at the peak.
        mu_max_std: Standard deviation of the pooled μ_max from the samples and the families.
        lambda_m: Pooled slip ratio of the peak.
        lambda_m_std: Standard deviation of the pooled λ_m from the samples and the families.
        samples: Number of samples.
        speed: Vehicle speed at which the peaks are given, m/s.
        held_out: What was held out.

    """

    families: tuple[ScoredFit, ...]
    mu_max: float
    mu_max_std: float
    lambda_m: float
    lambda_m_std: float
    samples: int
    speed: float
    held_out: str

    @property
    def rail_std(self) -> tuple[float, float]:
        """Standard deviations of μ_max and λ_m of the rail: the common errors included."""
        return (
            hypot(self.mu_max_std, COMMON_ADHESION * self.mu_max),
            hypot(self.lambda_m_std, COMMON_SLIP),
        )

    @property
    def plausible(self) -> tuple[str, ...]:
        """Names of the families that the data cannot separate, the best first."""
        return tuple(s.fit.family.name for s in self.families if s.plausible)

    def to_dict(self) -> dict[str, Any]:
        """Comparison as JSON has it."""

        def number(value: float, std: float, of_samples: float) -> dict[str, float | None]:
            return {
                "value": value,
                "std": std if isfinite(std) else None,
                "std_of_samples": of_samples if isfinite(of_samples) else None,
            }

        mu_std, lambda_std = self.rail_std
        return {
            "families": [s.to_dict() for s in self.families],
            "plausible": list(self.plausible),
            "pooled": {
                "mu_max": number(self.mu_max, mu_std, self.mu_max_std),
                "lambda_m": number(self.lambda_m, lambda_std, self.lambda_m_std),
                "speed_mps": self.speed,
            },
            "common_errors": {"slip": COMMON_SLIP, "adhesion": COMMON_ADHESION},
            "held_out": self.held_out,
            "samples": self.samples,
        }

    def _repr_html_(self) -> str:
        return html_table(f"Curve families, {self.samples} samples", COLUMNS, self.rows())

    def rows(self) -> list[tuple[str, ...]]:
        """Cells of a table under `COLUMNS`, a row for each family and one for the pooled peak."""
        cells: list[tuple[str, ...]] = [
            (
                s.fit.family.name,
                f"{s.held_out_rmse:.3f}",
                f"{s.behind:.4f} ± {s.behind_std:.4f}" if s.behind else "best",
                f"{s.fit.rmse:.5f}",
                _plus_minus(s.fit.mu_max, s.fit.mu_max_std),
                _plus_minus(s.fit.lambda_m, s.fit.lambda_m_std),
                f"{s.weight:.2f}" if s.plausible else "",
                ", ".join(
                    f"{p.name} {value:.4g}"
                    for p, value in zip(s.fit.family.parameters, s.fit.values, strict=True)
                ),
            )
            for s in self.families
        ]
        for name, mu_std, lambda_std in (
            ("pooled", self.mu_max_std, self.lambda_m_std),
            ("of the surface", *self.rail_std),
        ):
            peak = (_plus_minus(self.mu_max, mu_std), _plus_minus(self.lambda_m, lambda_std))
            cells.append((name, "", "", "", *peak, "", ""))
        return cells


COLUMNS = (
    "curve",
    HELD_OUT_RMSE,
    "behind in log density",
    "RMSE",
    "mu_max",
    "lambda_m",
    "weight",
    "parameters",
)
"""Heads of the columns of `CurveComparison.rows`."""


def _plus_minus(value: float, std: float) -> str:
    return plus_minus(value, std if isfinite(std) else None)
