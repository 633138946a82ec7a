"""Peak of the rail, and the curve families that it comes from: a result."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from adhesion_can.estimation.curves.result import COMMON_ADHESION, COMMON_SLIP
from adhesion_can.physics.estimate import Estimate, Identifiable, PeakEstimate
from adhesion_can.result_text import plus_minus

BURCKHARDT = "burckhardt"


@dataclass(frozen=True, slots=True, kw_only=True)
class RailPeak:
    """Peak of the rail, and the curve families that it comes from.

    Attributes:
        plausible: Names of the families that the data cannot separate, the best first.
        burckhardt_holds: Whether the data contradict neither Burckhardt's curve nor its peak; where
            it is plausible and others that fit better have another peak, theirs counts too.
        misfit: Root mean square of what the best family leaves of the samples beyond their noise,
            as a share of μ_max; 0 where it is within chance or small.
        peak: Peak pooled over the plausible families; its standard deviations contain the spread
            between them, the misfit and the common errors.
        identifiable: Whether the samples suffice to identify that peak.
        noise_std: Standard deviation of the measured adhesion about the best family's curve.
        speed: Vehicle speed at which the peak is given, m/s.
        plain: Estimate with Burckhardt's curve.

    """

    plausible: tuple[str, ...]
    burckhardt_holds: bool
    misfit: float
    peak: PeakEstimate
    identifiable: Identifiable
    noise_std: float
    speed: float
    plain: Estimate

    @property
    def name(self) -> str | None:
        """Name of the family that holds, the best of several; None where none does."""
        if self.burckhardt_holds:
            return BURCKHARDT
        return None if self.misfit else self.plausible[0]

    @property
    def estimate(self) -> Estimate:
        """Burckhardt's estimate where it holds, else with peak and noise of the best families."""
        if self.burckhardt_holds:
            return self.plain
        mu_max, lambda_m, mu_max_std, lambda_m_std = self.peak
        return replace(
            self.plain,
            mu_max=mu_max,
            lambda_m=lambda_m,
            mu_max_std=mu_max_std,
            lambda_m_std=lambda_m_std,
            noise_std=self.noise_std,
            identifiable=self.identifiable,
            family=self.plausible[0],
        )

    @property
    def sentence(self) -> str:
        """What holds, in one line."""
        if self.burckhardt_holds:
            return "Burckhardt's peak holds: no other curve family contradicts it."
        mu_max, lambda_m, mu_max_std, lambda_m_std = self.peak
        known = self.identifiable
        several = " (the data cannot distinguish them)" if len(self.plausible) > 1 else ""
        peak = (
            f"the peak is {plus_minus(mu_max, mu_max_std if known.mu_max else None)} at a slip "
            f"of {plus_minus(lambda_m, lambda_m_std if known.lambda_m else None)} with "
            f"{_enumerate(self.plausible)}{several}, at {self.speed:.1f} m/s; the errors include "
            f"{COMMON_SLIP:g} of slip and {100 * COMMON_ADHESION:g} % of adhesion that all "
            "samples share"
        )
        if self.misfit:
            return (
                f"No curve family fits: the best, {self.plausible[0]}, leaves a misfit of "
                f"{100 * self.misfit:.1f} % of mu_max beyond the noise; {peak}, and this misfit."
            )
        certain = BURCKHARDT not in self.plausible
        form = "Burckhardt's form does not fit" if certain else "The form of the curve is uncertain"
        plain = f"{self.plain.mu_max:.4f} at {self.plain.lambda_m:.4f}"
        return f"{form} (Burckhardt's curve gives {plain}): {peak}."

    def to_dict(self) -> dict[str, Any]:
        """Families, and the peak of Burckhardt's own curve, as JSON has them."""
        plain = self.plain.to_dict()
        return {
            "name": self.name,
            "plausible": list(self.plausible),
            "burckhardt_holds": self.burckhardt_holds,
            "misfit": self.misfit,
            "speed_mps": self.speed,
            "burckhardt": {
                name: plain[name] for name in ("mu_max", "lambda_m", "noise_std", "identifiable")
            },
            "sentence": self.sentence,
        }


def _enumerate(names: Sequence[str]) -> str:
    """Names as in a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
