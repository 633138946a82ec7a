"""Settings of the plausibility watch."""

from dataclasses import dataclass
from math import inf
from typing import Annotated

from adhesion_can.ranges import Within, require_ranges
from adhesion_can.values import Value


@dataclass(frozen=True, slots=True, kw_only=True)
class PlausibilitySettings(Value):
    """Limits beyond which readings are not believed, whatever curve fits them.

    Attributes:
        enabled: Whether the readings are watched; False: what fits a curve is believed.
        mu_ceiling: Largest μ_max that is believed, 1. Dry rail in the sun has 0.6 to 0.7 (Olofsson
            and Lewis, in Iwnicki, Handbook of Railway Vehicle Dynamics, 2006); a road tyre reaches
            1.2. It bounds what an error of the efforts' gain can do, which no curve shows.
        least_load: Least sum of the measured axle loads that is believed, as a share of the static
            ones.
        most_load: Largest sum of the measured axle loads that is believed, as a share of the static
            ones.
        alarm: Deviation of a signal from its course that is no chance, in standard deviations of
            such deviations as the drive shows them, 1. Smaller: faults are seen sooner and smaller
            ones, and sound drives are objected to.

    """

    enabled: bool = True
    mu_ceiling: Annotated[float, Within(0.05, 3)] = 0.75
    least_load: Annotated[float, Within(0, 1)] = 0.6
    most_load: Annotated[float, Within(1, 100)] = 1.6
    alarm: Annotated[float, Within(3, 1000)] = 8.0

    @property
    def largest_mu(self) -> float:
        """Largest μ_max that is believed; inf where any is."""
        return self.mu_ceiling if self.enabled else inf

    def __post_init__(self) -> None:
        require_ranges(self)
