"""Extended Kalman filter on the curve's parameters, with a reset where its innovations grow.

The state x = ln(c1, c2, c3) follows a random walk; each sample is a measurement μ = curve(λ; x). A
walk slow enough to average noise cannot follow a sudden change. So the normalised innovations are
monitored as in Gustafsson's friction estimator (Automatica 33(6), 1997), in the simplest form:
where their mean square grows, the covariance is set back to that of the start. The filter is in
Jazwinski, "Stochastic Processes and Filtering Theory", 1970.
"""

from dataclasses import dataclass
from math import exp

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.log_parameters import LogParameterEstimator
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.physics.burckhardt import CurveParameters
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


class EkfEstimator(LogParameterEstimator):
    """Extended Kalman filter as an estimator.

    Args:
        evolution: Settings with the range of (c1, c2, c3).
        identifiability: Limits from which the peak counts as identifiable, and range of slip.
        settings: Tuning of the filter.

    """

    def __init__(
        self,
        evolution: EvolutionSettings | None = None,
        identifiability: IdentifiabilitySettings | None = None,
        settings: EkfSettings | None = None,
    ) -> None:
        self._settings = settings = settings or EkfSettings()
        memory = settings.noise_memory
        super().__init__(settings.start, settings.noise_std, memory, evolution, identifiability)
        self._first = np.diag(np.square(settings.start_std))
        self._walk = np.diag(np.square(settings.walk_std))
        self._covariance = self._first
        self._ratio = 1.0  # mean normalised innovation squared
        self._since_reset = 0  # samples

    def _log_covariance(self) -> Array:
        return self._covariance

    def _process(self, samples: Samples) -> bool:
        """Process samples one by one; whether the filter was reset at one."""
        h, z = samples.folded()
        points = zip(h.tolist(), z.tolist(), samples.slip_total_var.tolist(), strict=True)
        resets = [k for k, point in enumerate(points) if self._is_reset_by(*point)]
        if resets:
            self._window.restart()
            samples = samples.select(slice(resets[-1], None))
        self._window.add(samples)
        return bool(resets)

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
