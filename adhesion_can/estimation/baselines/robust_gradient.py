"""Robust stochastic gradient with adaptive step: what the paper's outlook asks for.

Each small batch of samples moves x = ln(c1, c2, c3) against the gradient of Huber's loss (Ann.
Math. Statist. 35 (1964) 73-101), so that outliers pull no harder than k standard deviations. The
gradient is scaled by an exponentially forgetting information matrix: the stochastic Newton method,
or recursive prediction error method, of Ljung and Söderström, Theory and Practice of Recursive
Identification, 1983. Where the bounded innovations stay large the rail has changed: the information
is discounted, and the steps become long again.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from adhesion_can.arrays import Array
from adhesion_can.estimation.baselines.log_parameters import LogParameterEstimator
from adhesion_can.estimation.baselines.settings import EvolutionSettings
from adhesion_can.estimation.identifiability import IdentifiabilitySettings
from adhesion_can.estimation.likelihood import innovation, sensitivity
from adhesion_can.physics.burckhardt import CurveParameters, adhesion_slope
from adhesion_can.physics.samples import Samples


@dataclass(frozen=True, slots=True, kw_only=True)
class GradientSettings:
    """Tuning of the gradient method.

    Attributes:
        start: Parameters (c1, c2, c3) at the start, those of a wet rail.
        start_std: Standard deviations of ln (c1, c2, c3) at the start and after a change, 1.
        noise_std: Standard deviation of the adhesion noise at the start, 1; it is then estimated
            from the bounded innovations.
        batch: Largest number of samples of one step. Larger: less CPU, slower after a change.
        memory: Largest length of the exponential window of the information, samples. Larger: less
            noise, slow changes are followed later.
        growth: Growth of that window by each sample, samples, from the second `window` after a
            change on: information from before the curve was found is forgotten. Larger: less noise,
            and more of the error of the first steps.
        noise_memory: Length of the exponential window of the noise estimate, samples.
        huber: Innovation beyond which the loss is linear, in standard deviations. Larger: closer to
            least squares, less robust.
        window: Length of the exponential average of the bounded squares, samples. Larger: fewer
            false changes, later ones.
        change: Mean bounded square, over what noise explains, from which the rail has changed. An
            outlier counts as 2.5 at most.
        change_noise: Factor of the noise's standard deviation at a change, from which it falls to
            that of the data again. Larger: less error of the first steps, later at the curve.
        longest: Largest change of ln (c1, c2, c3) in one step, 1.

    """

    start: CurveParameters = (0.27, 45.0, 0.22)
    start_std: tuple[float, float, float] = (0.5, 0.5, 1.0)
    noise_std: float = 0.05
    batch: int = 25
    memory: float = 20_000.0
    growth: float = 10.0
    noise_memory: float = 500.0
    huber: float = 1.345
    change_noise: float = 10.0
    window: float = 100.0
    change: float = 1.5
    longest: float = 0.5

    def __post_init__(self) -> None:
        if not min(*self.start, *self.start_std, self.noise_std, self.huber, self.longest) > 0:
            raise ValueError("start, standard deviations, huber and longest must be positive")
        if not (self.batch >= 1 and self.growth > 0 and self.change_noise >= 1):
            raise ValueError("batch and change_noise must be at least 1, growth positive")
        if not min(self.memory, self.noise_memory, self.window, self.change) > 1:
            raise ValueError("memory, noise_memory, window and change must be above 1")


class GradientEstimator(LogParameterEstimator):
    """Robust stochastic gradient as an estimator.

    Args:
        evolution: Settings with the range of (c1, c2, c3).
        identifiability: Limits from which the peak counts as identifiable, and range of slip.
        settings: Tuning of the method.

    """

    def __init__(
        self,
        evolution: EvolutionSettings | None = None,
        identifiability: IdentifiabilitySettings | None = None,
        settings: GradientSettings | None = None,
    ) -> None:
        self._settings = settings = settings or GradientSettings()
        memory = settings.memory
        super().__init__(settings.start, settings.noise_std, memory, evolution, identifiability)
        self._first = np.diag(1.0 / np.square(settings.start_std))
        self._information = self._first
        self._ratio = 1.0  # mean bounded square over what noise explains
        self._since_change = 0  # samples
        self._bounded_noise = _mean_bounded_square(settings.huber)

    def _log_covariance(self) -> Array:
        return np.asarray(np.linalg.inv(self._information))

    def _process(self, samples: Samples) -> bool:
        """Process samples batch by batch; whether the rail has changed at one."""
        changed = False
        size = self._settings.batch
        for begin in range(0, len(samples), size):
            part = samples.select(slice(begin, begin + size))
            if self._step(part):
                changed = True
                self._window.restart()
            self._window.add(part)
        return changed

    def _step(self, samples: Samples) -> bool:
        """One step along the scaled gradient; whether the rail has changed at these samples."""
        settings, n = self._settings, len(samples)
        h, z = samples.folded()
        theta = np.exp(self._x)
        slip_noise = adhesion_slope(h, *theta) ** 2 * samples.slip_total_var
        std = np.sqrt(self._noise_var + slip_noise)
        scaled = innovation(theta, h, z) / std
        bounded = np.clip(scaled, -settings.huber, settings.huber)
        square = float(np.mean(bounded**2)) / self._bounded_noise
        # Before that the steps are long anyway, and the noise is not known yet.
        if self._since_change >= settings.window:
            self._ratio += (1.0 - (1.0 - 1.0 / settings.window) ** n) * (square - self._ratio)
        changed = self._ratio > settings.change
        if changed:
            self._information, self._ratio, self._since_change = self._first, 1.0, 0
            # The first steps are taken far from the curve: what they see counts for little later.
            self._noise_var *= settings.change_noise**2
            std = std * settings.change_noise
            scaled = scaled / settings.change_noise
            bounded = np.clip(scaled, -settings.huber, settings.huber)
        gradient = sensitivity(theta, h) * theta / std[:, None]
        weight = bounded / np.where(scaled == 0.0, 1.0, scaled)
        weight[scaled == 0.0] = 1.0
        settled = max(self._since_change - 2.0 * settings.window, 0.0)
        memory = min(settings.memory, settings.window + settings.growth * settled)
        forgetting = (1.0 - 1.0 / memory) ** n
        # What is forgotten is never less than what was known at the start.
        self._information = (
            forgetting * self._information
            + (1.0 - forgetting) * self._first
            + (gradient * weight[:, None]).T @ gradient
        )
        step = np.linalg.solve(self._information, gradient.T @ bounded)
        longest = float(np.abs(step).max())
        if longest > settings.longest:
            step *= settings.longest / longest
        self._x = np.clip(self._x + step, self._lower, self._upper)
        self._since_change += n
        # Fast at first, then the mean over the window; above 0, as nothing could raise 0.
        share = 2.0 * n / (min(self._since_change + 20.0, settings.noise_memory) + 2.0 * n)
        self._noise_var = max(self._noise_var * (1.0 + share * (square - 1.0)), 1e-10)
        return changed


def _mean_bounded_square(limit: float) -> float:
    """Mean of min(u², limit²) of a standard normal u (Huber's proposal 2)."""
    inside = float(scipy.special.ndtr(limit) - scipy.special.ndtr(-limit))
    density = float(np.exp(-0.5 * limit**2) / np.sqrt(2.0 * np.pi))
    return inside - 2.0 * limit * density + limit**2 * (1.0 - inside)
