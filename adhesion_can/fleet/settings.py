"""Settings of the fleet-level diagnosis."""

from dataclasses import dataclass

LEAST_WEAR = 0.003
"""Share by which a wheel's radius must differ from the configured one to matter."""


@dataclass(frozen=True, slots=True)
class FleetSettings:
    """Rates of false findings, and sizes from which a finding matters.

    Attributes:
        false_discovery_rate: Expected share of wrong vehicles among those with a finding.
        alpha: Probability of any wrong finding of the fleet, of the lines, and of the days, each.
        least_gain: Share of the whitened sum of squares that an effect must take away.
        least_wear: Share by which a wheel's radius must differ from the configured one.
        seed: Seed of the random exchanges of lines and days.

    """

    false_discovery_rate: float = 0.05
    alpha: float = 0.01
    least_gain: float = 0.005
    least_wear: float = LEAST_WEAR
    seed: int = 1
