"""Common part of the baselines whose state is x = ln(c1, c2, c3).

The logarithms keep all three positive, and make one size of a step fit surfaces that differ
tenfold.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from math import sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.forgetting import (
    ForgettingWindow,
    peak_errors,
    select_usable,
)
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

LEAST_PARAMETER = 1e-6
"""Least value of a parameter: a bound of 0 has no logarithm, and below this no curve differs."""


class LogParameterEstimator(ABC):
    """An estimator of ln (c1, c2, c3) that is updated by samples.

    Args:
        start: Parameters (c1, c2, c3) at the start.
        noise_std: Standard deviation of the adhesion noise at the start, 1.
        memory: Length of the exponential window over the slips, samples.
        evolution: Settings with the range of (c1, c2, c3); None: the defaults.
        identifiability: Limits from which the peak counts as identifiable, and range of slip; None:
            the defaults.

    """

    def __init__(
        self,
        start: CurveParameters,
        noise_std: float,
        memory: float,
        evolution: EvolutionSettings | None,
        identifiability: IdentifiabilitySettings | None,
    ) -> None:
        limits = identifiability or IdentifiabilitySettings()
        bounds = evolution or EvolutionSettings()
        self._slip_max = limits.slip_max
        self._lower = np.log(np.maximum(bounds.lower, LEAST_PARAMETER))
        self._upper = np.log(bounds.upper)
        self._x = np.clip(np.log(start), self._lower, self._upper)
        self._noise_var = noise_std**2
        self._window = ForgettingWindow(1.0 - 1.0 / memory, limits)
        self._current: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        del now_us  # the memory is a number of samples, not a time
        new = select_usable(samples, self._slip_max)
        if not len(new):
            if self._current is not None:
                self._current = replace(self._current, change_probability=0.0)
            return self._current
        changed = self._process(new)
        theta = np.exp(self._x)
        covariance = np.asarray(self._log_covariance() * np.outer(theta, theta), dtype=np.float64)
        errors = peak_errors(theta, covariance, self._slip_max)
        self._current = self._window.estimate(
            theta, covariance, errors, sqrt(self._noise_var), 1.0 if changed else 0.0
        )
        return self._current

    @abstractmethod
    def _process(self, samples: Samples) -> bool:
        """Process usable samples, at least one, and the window; whether the surface changed."""

    @abstractmethod
    def _log_covariance(self) -> Array:
        """Covariance of ln (c1, c2, c3), shape (3, 3)."""
