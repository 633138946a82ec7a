"""Extended Kalman filter on the curve's parameters, with a reset where its innovations grow.

The state x = ln(c1, c2, c3) follows a random walk; each sample is a measurement μ = curve(λ; x).
The logarithms keep all three positive, and make one walk fit surfaces that differ tenfold. A walk
slow enough to average noise cannot follow a sudden change. So the normalised innovations are
monitored as in Gustafsson's friction estimator (Automatica 33(6), 1997), in the simplest form:
where their mean square grows, the covariance is set back to that of the start. The filter is in
Jazwinski, "Stochastic Processes and Filtering Theory", 1970.
"""

from dataclasses import dataclass, replace
from math import exp, sqrt

import numpy as np

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


@dataclass(frozen=True, slots=True, kw_only=True)
class EkfSettings:
    """Tuning of the filter.

    Attributes:
        start: Parameters (c1, c2, c3) at the start, those of a wet rail.
        start_std: Standard deviations of ln (c1, c2, c3) at the start and after a reset, 1.
        walk_std: Standard deviations of the random walk of ln (c1, c2, c3), per sample. Larger:
            slow changes are followed faster, with more noise.
        noise_std: Standard deviation of the adhesion noise at the start, 1; it is then estimated
            from the innovations.
        noise_memory: Length of the window for the noise estimate and for the slips, samples.
        window: Length of the exponential average of the squared innovations, samples. Larger:
            fewer false resets, later ones.
        reset: Mean normalised squared innovation from which the filter is reset. Larger: fewer
            false resets, and small changes are missed.
        gate: Innovation from which a sample is left out, in standard deviations. It counts as no
            more than that towards a reset, so that one outlier causes none.

    """

    start: CurveParameters = (0.27, 45.0, 0.22)
    start_std: tuple[float, float, float] = (0.5, 0.5, 1.0)
    walk_std: tuple[float, float, float] = (0.0003, 0.0003, 0.002)
    noise_std: float = 0.05
    noise_memory: float = 1000.0
    window: float = 100.0
    reset: float = 1.6
    gate: float = 5.0

    def __post_init__(self) -> None:
        if not min(*self.start, *self.start_std, self.noise_std, self.gate) > 0:
            raise ValueError("start, standard deviations and gate must be positive")
        if not (min(self.walk_std) >= 0 and self.reset > 1):
            raise ValueError("walk_std must not be negative, reset above 1")
        if not min(self.noise_memory, self.window) > 1:
            raise ValueError("noise_memory and window must be above 1")


class EkfEstimator:
    """Extended Kalman filter as an estimator.

    Args:
        settings: Tuning of the filter.
        evolution: Settings with the range of (c1, c2, c3).
        identifiability: Limits from which the peak counts as identifiable, and range of slip.

    """

    def __init__(
        self,
        settings: EkfSettings | None = None,
        evolution: EvolutionSettings | None = None,
        identifiability: IdentifiabilitySettings | None = None,
    ) -> None:
        self._settings = settings = settings or EkfSettings()
        limits = identifiability or IdentifiabilitySettings()
        self._slip_max = limits.slip_max
        bounds = evolution or EvolutionSettings()
        # A bound of 0 has no logarithm; below this no curve differs from none.
        self._lower, self._upper = np.log(np.maximum(bounds.lower, 1e-6)), np.log(bounds.upper)
        self._first = np.diag(np.square(settings.start_std))
        self._walk = np.diag(np.square(settings.walk_std))
        self._x = np.clip(np.log(settings.start), self._lower, self._upper)
        self._covariance = self._first
        self._noise_var = settings.noise_std**2
        self._ratio = 1.0  # mean normalised innovation squared
        self._since_reset = 0  # samples
        self._window = ForgettingWindow(1.0 - 1.0 / settings.noise_memory, limits)
        self._current: Estimate | None = None

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        del now_us  # the walk goes by samples, not by time
        new = select_usable(samples, self._slip_max)
        if not len(new):
            if self._current is not None:
                self._current = replace(self._current, change_probability=0.0)
            return self._current
        h, z = new.folded()
        points = zip(h.tolist(), z.tolist(), new.slip_total_var.tolist(), strict=True)
        resets = [k for k, point in enumerate(points) if self._is_reset_by(*point)]
        if resets:
            self._window.restart()
            new = new.select(slice(resets[-1], None))
        self._window.add(new)
        theta = np.exp(self._x)
        covariance = self._covariance * np.outer(theta, theta)
        errors = peak_errors(theta, covariance, self._slip_max)
        self._current = self._window.estimate(
            theta, covariance, errors, sqrt(self._noise_var), 1.0 if resets else 0.0
        )
        return self._current

    def _is_reset_by(self, h: float, z: float, slip_var: float) -> bool:
        """Process one sample; whether the filter was reset at it."""
        settings = self._settings
        c1, c2, c3 = np.exp(self._x).tolist()
        e = exp(-c2 * h)
        gradient = np.array([c1 * (1.0 - e), c1 * c2 * h * e, -c3 * h])  # by the logarithms
        innovation = z - (c1 * (1.0 - e) - c3 * h)
        predicted = self._covariance + self._walk
        gain = predicted @ gradient
        slope = c1 * c2 * e - c3
        noise_var = self._noise_var + slope * slope * slip_var
        variance = float(gradient @ gain) + noise_var
        squared = innovation * innovation / variance
        counted = min(squared, settings.gate**2)
        self._ratio += (counted - self._ratio) / settings.window
        if self._ratio > settings.reset:
            self._covariance, self._ratio, self._since_reset = self._first, 1.0, 0
            return True
        if squared > settings.gate**2:
            return False
        gain /= variance
        self._x = np.clip(self._x + gain * innovation, self._lower, self._upper)
        # Joseph's form: the covariance stays positive definite under rounding.
        rest = np.eye(3) - np.outer(gain, gradient)
        self._covariance = rest @ predicted @ rest.T + noise_var * np.outer(gain, gain)
        self._since_reset += 1
        # Fast at first, then the mean over the window. It is kept above 0: no sample could raise 0.
        share = 1.0 / min(self._since_reset + 20.0, settings.noise_memory)
        self._noise_var = max(self._noise_var * (1.0 + share * (squared - 1.0)), 1e-10)
        return False


def ekf_estimator(evolution: EvolutionSettings, limits: IdentifiabilitySettings) -> EkfEstimator:
    """EkfEstimator with the default tuning."""
    return EkfEstimator(None, evolution, limits)
