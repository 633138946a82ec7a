"""Estimator whose samples carry the noise that they show, in place of the configured one."""

from adhesion_can.estimation.estimator import Estimator
from adhesion_can.estimation.noise.noise_factors import RunningNoise
from adhesion_can.estimation.noise.settings import NoiseSettings
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples
from adhesion_can.values import Stateful


class NoiseScaledEstimator(Stateful):
    """Stage in front of an estimator that scales the variances of the samples.

    Args:
        inner: Estimator that weighs samples by their variances.
        settings: Weight of the configured noise, memory, and limits of the factors.

    """

    def __init__(self, inner: Estimator, settings: NoiseSettings) -> None:
        self._inner = inner
        self._noise = RunningNoise(settings)

    def update(self, samples: Samples, now_us: int) -> Estimate | None:
        """Process samples, as `Estimator.update` defines it."""
        self._noise.add(samples)
        return self._inner.update(self._noise.factors.scale(samples), now_us)
