"""Estimate from a fit: standard errors, and whether the peak is identifiable."""

from dataclasses import dataclass, replace
from math import hypot, isfinite
from typing import Annotated

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.likelihood import UNDETERMINED, StandardErrors, standard_errors
from adhesion_can.physics.burckhardt import peak
from adhesion_can.physics.estimate import Estimate, Identifiable
from adhesion_can.physics.samples import Samples
from adhesion_can.ranges import Within, require_ranges
from adhesion_can.values import Value

FALL_SIGNIFICANCE = 4.0
"""c3 over its standard deviation from which the fall beyond the peak is significant."""


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiabilitySettings(Value):
    """Limits from which the peak counts as identifiable from a set of samples.

    Attributes:
        mu_max_std: Largest relative standard deviation of an identifiable μ_max, 1. Larger: the
            peak counts as identifiable earlier, with a larger error.
        lambda_m_std: Largest relative standard deviation of an identifiable λ_m, 1.
        reach: Share of the samples that must lie beyond λ̂_m for an identifiable λ_m, so that the
            fall of the curve is measured and not extrapolated. Larger: stricter.
        mu_max_reach: Slip ratio that as many samples must exceed for an identifiable μ_max, as a
            share of λ̂_m. Larger: stricter.
        slip_max: Largest |λ| of a usable sample, and end of the range of slip in which the peak is
            looked for, 1. Larger: samples of slides are used, which may follow no single curve.
        samples: Least number of samples; fewer do not even determine their own noise.

    """

    mu_max_std: Annotated[float, Within(1e-6, 10)] = 0.03
    lambda_m_std: Annotated[float, Within(1e-6, 10)] = 0.3
    reach: Annotated[float, Within(0, 1)] = 0.03
    mu_max_reach: Annotated[float, Within(0, 10)] = 0.85
    slip_max: Annotated[float, Within(0.001, 10)] = 0.5
    samples: Annotated[int, Within(1, 1000000)] = 20

    def __post_init__(self) -> None:
        require_ranges(self)


def assess(
    theta: Array, cost: float, samples: Samples, settings: IdentifiabilitySettings
) -> Estimate:
    """Estimate with standard errors from θ̂ and the samples that it was fitted to.

    Args:
        theta: Fitted curve parameters (c1, c2, c3).
        cost: Sum of squares J(θ̂), eq. 13.
        samples: Samples of the fit, at least one.
        settings: Limits from which the peak counts as identifiable.

    """
    h, _ = samples.folded()
    noise = float(np.sqrt(max(cost, 0.0) / max(len(h) - 3, 1)))
    errors = standard_errors(theta, h, noise, settings.slip_max)
    return build_estimate(theta, noise, errors, h, samples, settings)


def build_estimate(
    theta: Array,
    noise_std: float,
    errors: StandardErrors,
    reached: Array,
    samples: Samples,
    settings: IdentifiabilitySettings,
) -> Estimate:
    """Estimate from a fit and its standard errors.

    Args:
        theta: Fitted curve parameters (c1, c2, c3).
        noise_std: Standard deviation of the adhesion about the curve.
        errors: Standard errors of the fit.
        reached: Slips that the samples reached, ≥ 0, shape (n,).
        samples: Samples of the fit, at least one.
        settings: Limits from which the peak counts as identifiable.

    """
    if len(samples) < settings.samples:
        errors = UNDETERMINED
    c1, c2, c3 = map(float, theta)
    top = peak(c1, c2, c3, settings.slip_max)
    mu_max, lambda_m = float(top.mu_max), float(top.lambda_m)
    mu_std = hypot(errors.mu_max, mu_max * samples.load_common_std)
    farthest = float(np.quantile(reached, 1.0 - settings.reach))
    return Estimate(
        c1=c1,
        c2=c2,
        c3=c3,
        covariance=errors.covariance,
        mu_max=mu_max,
        mu_max_std=mu_std,
        lambda_m=lambda_m,
        lambda_m_std=errors.lambda_m,
        noise_std=noise_std,
        samples=len(samples),
        identifiable=assess_peak(
            (mu_max, errors.mu_max), (lambda_m, errors.lambda_m), farthest, settings
        ),
        surface_since_us=int(samples.t_us[0]),
    )


def require_fall(estimate: Estimate) -> Estimate:
    """Estimate whose λ_m is identifiable only where the fall beyond the peak is significant."""
    fall_std = float(estimate.covariance[2, 2]) ** 0.5
    known = estimate.identifiable
    if not known.lambda_m or estimate.c3 > FALL_SIGNIFICANCE * fall_std:
        return estimate
    return replace(estimate, identifiable=Identifiable(mu_max=known.mu_max, lambda_m=False))


def assess_peak(
    mu_max: tuple[float, float],
    lambda_m: tuple[float, float],
    reached: float,
    settings: IdentifiabilitySettings,
) -> Identifiable:
    """Whether μ_max and λ_m are identifiable, from their errors and the slips that were reached.

    Args:
        mu_max: Estimate of μ_max and its standard error, 1.
        lambda_m: Estimate of λ_m and its standard error, 1; inf where unknown.
        reached: Slip ratio that the share `reach` of the samples exceeds.
        settings: Limits from which the peak counts as identifiable.

    """
    (mu, mu_error), (slip, slip_error) = mu_max, lambda_m
    # The peak may lie farther out than estimated, by its standard error.
    farthest = slip + (3 * slip_error if isfinite(slip_error) else 0.0)
    return Identifiable(
        mu_max=mu > 0.0
        and mu_error <= settings.mu_max_std * mu
        and reached >= settings.mu_max_reach * farthest,
        lambda_m=slip_error <= settings.lambda_m_std * slip and reached >= farthest,
    )
