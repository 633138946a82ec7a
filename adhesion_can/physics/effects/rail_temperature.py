"""Adhesion changes with the temperature of the rail."""

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

CHANNEL = "rail_temperature_degC"
REFERENCE = 20.0
"""Temperature at which nothing changes, degC."""


@dataclass(frozen=True, slots=True)
class RailTemperature:
    """Factor 1 + slope (T − 20 degC)."""

    id: str = "rail_temperature"
    form: str = ""
    title: str = "adhesion changes with the temperature of the rail"
    parameters: tuple[Parameter, ...] = (
        Parameter("slope", "1/K", 0.005, -0.02, 0.02, "share of adhesion per K"),
    )
    literature: str = "Lyu et al., Tribology International 90 (2015) 1-8"
    requires: Requirements = Requirements(covariates=(CHANNEL,))
    observability: Observability = Observability(
        channel=CHANNEL,
        excitation="the rail's temperature",
        separations=(
            Separation(
                "slow_drift",
                "a longer drive, in which the rail's temperature returns to an earlier value",
            ),
        ),
    )

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, 1.0 + values[0] * (contact.covariates[CHANNEL] - REFERENCE))
