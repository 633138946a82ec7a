"""Multiple-model adaptive estimation (Magill 1965): a bank of preset surfaces with probabilities.

The surface is assumed to be one of the presets. The mean square innovation of each, with
exponential forgetting, gives its probability with the noise variance profiled out, w ∝ (mean
square)^(−n/2). Where no preset is right the nearest one becomes certain. So the means of its
innovations over bins of slip are kept as well. Noise alone would bring them to zero; what remains
of them is the model error, which adds to the standard deviation.

D. T. Magill, "Optimal adaptive estimation of sampled stochastic processes", IEEE Transactions on
Automatic Control 10(4), 1965.
"""

from dataclasses import dataclass
from math import hypot, inf, sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.forgetting import (
    ForgettingWindow,
    decay_weights,
    select_usable,
)
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.likelihood import innovation
from adhesion_can.physics.burckhardt import PUBLISHED, RAIL, Surface, peak
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

EDGES = 0.005 * 2.0 ** np.arange(7)
"""Edges of the bins of slip ratio, narrow where curves are steep."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BankSettings:
    """Presets and forgetting of the bank.

    Attributes:
        surfaces: Preset surfaces, each with a rise at slip 0.
        forgetting: Forgetting factor per sample, in 0..1; the window has about 1/(1 − forgetting)
            samples. Larger: less noise in the probabilities, slower changes between presets.
        floor: Least standard deviation of the adhesion noise, 1.

    """

    surfaces: tuple[Surface, ...] = (*PUBLISHED, *RAIL)
    forgetting: float = 0.995
    floor: float = 1e-3

    def __post_init__(self) -> None:
        if not self.surfaces or any(surface.mu_max <= 0 for surface in self.surfaces):
            raise ValueError("a bank holds at least one surface, each with a peak above 0")
        if not (0 < self.forgetting < 1 and self.floor > 0):
            raise ValueError("forgetting must be in 0..1, floor positive")


class BankEstimator:
    """Probability-weighted presets as an estimator.

    μ_max and λ_m are the weighted means of the presets'. Their standard deviations are the
    weighted spread, for μ_max together with the model error of the most probable preset; where that
    error exceeds the limit of an identifiable peak, the standard deviation of λ_m is infinite. c1,
    c2, c3 are those of the most probable preset, scaled along both axes so that its peak is at the
    means.

    Args:
        settings: Settings of the bank.
        identifiability: Limits from which the peak counts as identifiable, and range of slip.

    """

    def __init__(
        self,
        settings: BankSettings | None = None,
        identifiability: IdentifiabilitySettings | None = None,
    ) -> None:
        self._settings = settings or BankSettings()
        self._limits = identifiability or IdentifiabilitySettings()
        self._window = ForgettingWindow(self._settings.forgetting, self._limits)
        self._presets = np.array([surface.theta for surface in self._settings.surfaces])
        c1, c2, c3 = self._presets.T
        self._peaks = peak(c1, c2, c3, self._limits.slip_max)
        bins = len(EDGES) + 1
        self._counts = np.zeros(bins)
        self._sums = np.zeros((len(self._presets), bins))  # of the innovation, by preset and bin
        self._squares = np.zeros(len(self._presets))
        self._current: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        del now_us  # forgetting goes by samples, not by time
        new = select_usable(samples, self._limits.slip_max)
        if len(new):
            self._window.add(new)
            self._add(*new.folded())
            self._current = self._estimate()
        return self._current

    def _add(self, h: Array, z: Array) -> None:
        weights = decay_weights(self._settings.forgetting, len(h))
        errors = np.array([innovation(theta, h, z) for theta in self._presets])
        member = np.searchsorted(EDGES, h)[:, None] == np.arange(len(self._counts))
        kept = self._settings.forgetting ** len(h)
        self._counts = kept * self._counts + weights @ member
        self._sums = kept * self._sums + (errors * weights) @ member
        self._squares = kept * self._squares + errors**2 @ weights

    def _estimate(self) -> Estimate:
        n = self._counts.sum()
        mean_square = self._squares / n + self._settings.floor**2
        best = int(mean_square.argmin())
        weights = (mean_square[best] / mean_square) ** (n / 2)
        weights /= weights.sum()
        mu_max, mu_std = _moments(weights, self._peaks.mu_max)
        lambda_m, lambda_std = _moments(weights, self._peaks.lambda_m)
        model_error, noise = self._model_error(best)
        if model_error > self._limits.mu_max_std * mu_max:
            lambda_std = inf
        c1, c2, c3 = self._presets[best]
        up, along = mu_max / self._peaks.mu_max[best], lambda_m / self._peaks.lambda_m[best]
        theta = np.array([up * c1, c2 / along, up * c3 / along])
        offsets = self._presets - theta
        covariance = (offsets.T * weights) @ offsets
        errors = (hypot(mu_std, model_error), lambda_std)
        return self._window.estimate(theta, covariance, errors, noise)

    def _model_error(self, preset: int) -> tuple[float, float]:
        """Root mean square model error of a preset by the bins' means, and noise in the bins, 1."""
        n, filled = self._counts.sum(), self._counts >= 1.0
        between = float(np.sum(self._sums[preset, filled] ** 2 / self._counts[filled]))
        within = max(float(self._squares[preset]) - between, 0.0) / max(n - filled.sum(), 1.0)
        # Expectation by noise alone: the weights' squares sum to a share of n.
        forgetting = self._settings.forgetting
        by_noise = float(filled.sum()) * within / (1.0 + forgetting)
        if filled.sum() < 3:
            # Three parameters: fewer points than that are on many curves.
            return inf, sqrt(within)
        return sqrt(max(between - by_noise, 0.0) / n), sqrt(within)


def _moments(weights: Array, values: Array) -> tuple[float, float]:
    """Weighted mean and standard deviation."""
    mean = float(weights @ values)
    return mean, sqrt(float(weights @ (values - mean) ** 2))


def bank_estimator(_evolution: EvolutionSettings, limits: IdentifiabilitySettings) -> BankEstimator:
    """BankEstimator with the default tuning."""
    return BankEstimator(None, limits)
