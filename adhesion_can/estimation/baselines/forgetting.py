"""Common parts of the baselines: usable samples, and the exponentially forgetting window."""

from dataclasses import replace
from math import hypot, inf, sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.identifiability import IdentifiabilitySettings, assess_peak
from adhesion_can.estimation.likelihood import UNDETERMINED
from adhesion_can.physics.burckhardt import peak, peak_gradient
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

BINS = 500
"""Number of bins of the histogram of slip."""
UNKNOWN = UNDETERMINED.covariance
"""Covariance of (c1, c2, c3) without any information."""


def select_usable(samples: Samples, slip_max: float) -> Samples:
    """Samples that are finite and within the model's range of slip, without covariates."""
    rows = np.isfinite(samples.slip) & np.isfinite(samples.adhesion)
    rows &= np.abs(samples.slip) <= slip_max
    return replace(samples, covariates={}).select(rows)


def decay_weights(forgetting: float, n: int) -> Array:
    """Weights β^(n−1)..β^0 of n samples, the latest last, shape (n,)."""
    return np.asarray(forgetting ** np.arange(n - 1.0, -1.0, -1.0))


def peak_errors(theta: Array, covariance: Array, slip_max: float) -> tuple[float, float]:
    """Standard deviations of μ_max and λ_m, inf where the covariance or the curve gives none.

    Args:
        theta: Curve parameters (c1, c2, c3).
        covariance: Covariance of (c1, c2, c3), shape (3, 3).
        slip_max: Largest slip ratio of the model.

    """
    c1, c2, c3 = map(float, theta)
    if not np.isfinite(covariance).all():
        return inf, inf
    mu_row, lambda_row = peak_gradient(c1, c2, c3, slip_max)
    mu_std = sqrt(max(float(mu_row @ covariance @ mu_row), 0.0))
    if not peak(c1, c2, c3, slip_max).interior:
        return mu_std, inf
    return mu_std, sqrt(max(float(lambda_row @ covariance @ lambda_row), 0.0))


class ForgettingWindow:
    """Exponentially forgetting window over the slips, from which identifiability is judged.

    It holds a histogram of slip and the mean relative variance of the loads. A sample has the
    weight β^age in samples, so that memory and cost do not grow with time.

    Args:
        forgetting: Forgetting factor β per sample, in 0..1.
        settings: Limits from which the peak counts as identifiable.

    """

    def __init__(self, forgetting: float, settings: IdentifiabilitySettings) -> None:
        self._forgetting = forgetting
        self._settings = settings
        self._counts = np.zeros(BINS)
        self._load_variance = 0.0
        self._since_us: int | None = None

    @property
    def samples(self) -> float:
        """Sum of the weights, the effective number of samples."""
        return float(self._counts.sum())

    def add(self, samples: Samples) -> None:
        """Add usable samples, at least one."""
        if self._since_us is None:
            self._since_us = int(samples.t_us[0])
        weights = decay_weights(self._forgetting, len(samples))
        bins = (np.abs(samples.slip) * (BINS / self._settings.slip_max)).astype(np.int64)
        self._counts *= self._forgetting ** len(samples)
        self._counts += np.bincount(np.minimum(bins, BINS - 1), weights, minlength=BINS)
        share = weights.sum() / self.samples
        variance = samples.load_common_std**2
        self._load_variance += share * (variance - self._load_variance)

    def restart(self) -> None:
        """Empty the window: the next samples are of another surface."""
        self._counts[:] = 0.0
        self._since_us = None

    def estimate(
        self,
        theta: Array,
        covariance: Array,
        errors: tuple[float, float],
        noise_std: float,
        change_probability: float = 0.0,
    ) -> Estimate:
        """Estimate from the window, which holds at least one sample.

        Args:
            theta: Curve parameters (c1, c2, c3).
            covariance: Covariance of (c1, c2, c3), shape (3, 3).
            errors: Standard deviations of μ_max and λ_m, 1; inf where unknown.
            noise_std: Standard deviation of the adhesion around the curve, 1.
            change_probability: Probability that the surface changed within the last update.

        """
        limits, n = self._settings, self.samples
        if n < limits.samples or not np.isfinite(covariance).all():
            covariance, errors = UNKNOWN, (inf, inf)
        mu_error, lambda_error = errors
        c1, c2, c3 = map(float, theta)
        top = peak(c1, c2, c3, limits.slip_max)
        mu_max, lambda_m = float(top.mu_max), float(top.lambda_m)
        return Estimate(
            c1=c1,
            c2=c2,
            c3=c3,
            covariance=covariance,
            mu_max=mu_max,
            mu_max_std=hypot(mu_error, mu_max * sqrt(self._load_variance)),
            lambda_m=lambda_m,
            lambda_m_std=lambda_error,
            noise_std=noise_std,
            samples=round(n),
            identifiable=assess_peak(
                (mu_max, mu_error), (lambda_m, lambda_error), self._reached(), limits
            ),
            surface_since_us=self._since_us or 0,
            change_probability=change_probability,
        )

    def _reached(self) -> float:
        """Slip ratio that the share `reach` of the window exceeds."""
        above = np.cumsum(self._counts[::-1])[::-1]
        beyond = np.flatnonzero(above >= self._settings.reach * above[0])
        # The lower edge of the bin, so that the reach is never overstated.
        return float(beyond[-1]) * self._settings.slip_max / BINS
