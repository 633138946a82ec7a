"""Settings of the noise of the samples, apart from it: a configuration needs these alone."""

from dataclasses import dataclass

from adhesion_can.values import Value


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseSettings(Value):
    """Estimation of the noise of the samples while driving.

    Attributes:
        estimated: Whether the variances of the samples are scaled to the noise that they show;
            False takes those of `[sensors]` as they are.
        prior_s: Time for which samples must show another noise to count as much as the configured
            one, s. Larger: the configuration is believed for longer.
        memory_s: Time over which the noise is estimated, s. Larger: less scatter, and slower.
        largest: Largest factor on a configured standard deviation, at least 1.
        smallest: Smallest factor on a configured standard deviation, above 0 and at most 1.

    """

    estimated: bool = True
    prior_s: float = 2.0
    memory_s: float = 30.0
    largest: float = 10.0
    smallest: float = 0.2

    def __post_init__(self) -> None:
        if not (self.prior_s >= 0 and self.memory_s >= 1):
            raise ValueError("prior_s must be 0 or more, memory_s must be at least 1")
        if not 0 < self.smallest <= 1 <= self.largest:
            raise ValueError("smallest must be in 0..1 and not 0, largest must be at least 1")
