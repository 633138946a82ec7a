"""Adhesion changes with the humidity of the air."""

from dataclasses import dataclass

from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
    Separation,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

CHANNEL = "relative_humidity_percent"
REFERENCE = 60.0
"""Humidity at which nothing changes, %."""


@dataclass(frozen=True, slots=True)
class Humidity:
    """Factor 1 + slope (RH − 60 %)."""

    id: str = "humidity"
    form: str = ""
    title: str = "adhesion changes with the humidity of the air"
    parameters: tuple[Parameter, ...] = (
        Parameter("slope", "1/%", -0.003, -0.01, 0.01, "share of adhesion per % of humidity"),
    )
    literature: str = "Olofsson and Sundvall, Proc. IMechE F 218 (2004) 301-310"
    requires: Requirements = Requirements(covariates=(CHANNEL,))
    observability: Observability = Observability(
        channel=CHANNEL,
        excitation="the humidity",
        separations=(
            Separation(
                "slow_drift", "a longer drive, in which humidity returns to an earlier value"
            ),
        ),
    )

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, 1.0 + values[0] * (contact.covariates[CHANNEL] - REFERENCE))
