"""Settings of the noise of the samples, apart from it: a configuration needs these alone."""

from dataclasses import dataclass
from typing import Annotated

from adhesion_can.ranges import Within, require_ranges
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
        largest: Largest factor on a configured standard deviation.
        smallest: Smallest factor on a configured standard deviation.

    """

    estimated: bool = True
    prior_s: Annotated[float, Within(0, 1e6)] = 2.0
    memory_s: Annotated[float, Within(1, 1e6)] = 30.0
    largest: Annotated[float, Within(1, 1e6)] = 10.0
    smallest: Annotated[float, Within(1e-6, 1)] = 0.2

    def __post_init__(self) -> None:
        require_ranges(self)
