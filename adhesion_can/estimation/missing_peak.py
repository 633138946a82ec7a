"""Why samples do not show the peak of their curve, in words."""

from math import isfinite
from typing import NamedTuple

import numpy as np

from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.physics.burckhardt import adhesion
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

LEAST_EFFORT = 0.02
"""Adhesion at the largest slips below which the vehicle coasts."""
MOST_OPPOSITE = 0.8
"""Share of the samples with an adhesion opposite to their slip from which a sign is wrong."""
LARGE_SLIP, MIDDLE_SLIP = 0.7, 0.4
"""Slips, as shares of the largest ones, whose adhesions are compared."""
CERTAIN = 3.0
"""Difference of their means in its standard errors from which the adhesion rises."""


class MissingPeak(NamedTuple):
    """What of a peak some samples do not show.

    Attributes:
        clause: What is missing, and why; '' where nothing is.
        by_noise: Whether noise hides it, or an error that looks like noise, and no lack of slip.

    """

    clause: str
    by_noise: bool = False


def find_missing_peak(
    estimate: Estimate, samples: Samples, settings: IdentifiabilitySettings
) -> MissingPeak:
    """What of the peak the samples do not show, and why.

    Args:
        estimate: Estimate from these samples.
        samples: Usable samples, at least one.
        settings: Limits by which the peak was judged.

    """
    known = estimate.identifiable
    if known.both:
        return MissingPeak("")
    what = "the peak is"
    if known.mu_max or known.lambda_m:
        what = "lambda_m is" if known.mu_max else "mu_max is"
    reason = _lack_of_slip(estimate, samples, settings)
    if reason:
        return MissingPeak(f"{what} not in the data: {reason}")
    reached = _reached(samples, settings)
    return MissingPeak(
        f"{what} not in the data: the slips reach {reached:.4f}, but a noise of "
        f"{estimate.noise_std:.2g} in the adhesion leaves open where it is largest; an error of an "
        "instrument looks the same",
        by_noise=True,
    )


def _reached(samples: Samples, settings: IdentifiabilitySettings) -> float:
    return float(np.quantile(np.abs(samples.slip), 1.0 - settings.reach))


def _lack_of_slip(estimate: Estimate, samples: Samples, settings: IdentifiabilitySettings) -> str:
    """Clause on samples that are few or of small slips; '' where they are neither."""
    if len(samples) < settings.samples:
        return f"{len(samples)} samples, fewer than {settings.samples}"
    share = f"{100 * (1 - settings.reach):.3g} %"
    reached = _reached(samples, settings)
    used = float(adhesion(np.array(reached), *estimate.theta))
    size, along = np.abs(samples.adhesion), samples.adhesion * np.sign(samples.slip)
    if float(np.mean(along < -LEAST_EFFORT)) > MOST_OPPOSITE:
        return (
            f"the adhesion is opposite to the slip, {along.mean():.2f} on average; check the "
            "signs of effort and speeds"
        )
    if used < LEAST_EFFORT and float(np.median(size)) < LEAST_EFFORT:
        return (
            f"{share} of the slips stay below {reached:.4f}, and the adhesion below "
            f"{LEAST_EFFORT:g}: the vehicle coasts"
        )
    below = f"{share} of the slips stay below {reached:.4f}"
    slip, slip_std = estimate.lambda_m, estimate.lambda_m_std
    if reached >= settings.mu_max_reach * slip:
        if isfinite(slip_std) and reached < slip + 3 * slip_std:
            return f"{below}, not far enough beyond the largest adhesion; drive to larger slips"
    elif _rises(samples, reached):
        return f"{below}, where the adhesion is {used:.2f} and still rises; drive to larger slips"
    return ""


def _rises(samples: Samples, reached: float) -> bool:
    """Whether the adhesion at the largest slips is certainly above that at half of them."""
    slip, mu = np.abs(samples.slip), samples.adhesion * np.sign(samples.slip)
    large, middle = LARGE_SLIP * reached, MIDDLE_SLIP * reached
    at_large, at_middle = mu[slip > large], mu[(slip > middle) & (slip <= large)]
    if min(len(at_large), len(at_middle)) < 2:
        return True
    errors = [part.std() / len(part) ** 0.5 for part in (at_large, at_middle)]
    return float(at_large.mean() - at_middle.mean()) > CERTAIN * float(np.hypot(*errors))
