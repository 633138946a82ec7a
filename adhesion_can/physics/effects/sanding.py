"""Sand raises adhesion while it is strewn."""

from dataclasses import dataclass

from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
)
from adhesion_can.physics.effects.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

CHANNEL = "sanding_active"


@dataclass(frozen=True, slots=True)
class Sanding:
    """Factor 1 + gain while sanding is active."""

    id: str = "sanding"
    form: str = ""
    title: str = "sand changes adhesion while it is strewn"
    parameters: tuple[Parameter, ...] = (
        Parameter("gain", "1", 0.2, -0.5, 2.0, "share of adhesion gained under sand"),
    )
    literature: str = "Arias-Cuevas et al., Wear 268 (2010) 543-551"
    requires: Requirements = Requirements(covariates=(CHANNEL,))
    observability: Observability = Observability(channel=CHANNEL, excitation="sanding")

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, 1.0 + values[0] * contact.covariates[CHANNEL])
