"""Sand raises adhesion: while it is strewn, and until it has been worn off.

In the first form all axles have sand as long as it is strewn. In the second one it falls in front
of the leading axle and of another one, and lies on their wheels and under them for a while after
the sanders have stopped.
"""

from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

CHANNEL = "sanding_active"
RISE_S = 0.05
"""Time constant with which sand reaches the contact, s."""
_TITLE = "sand changes adhesion while it is applied"
_REQUIRES = Requirements(covariates=(CHANNEL,))
_OBSERVABILITY = Observability(channel=CHANNEL, excitation="sanding")
_GAIN = Parameter("gain", "1", 0.2, -0.5, 2.0, "share of adhesion gained under sand")


@dataclass(frozen=True, slots=True)
class Sanding:
    """Factor 1 + gain while sanding is active, at all axles."""

    id: str = "sanding"
    form: str = ""
    title: str = _TITLE
    parameters: tuple[Parameter, ...] = (_GAIN,)
    literature: str = "Arias-Cuevas et al., Wear 268 (2010) 543-551"
    requires: Requirements = _REQUIRES
    observability: Observability = _OBSERVABILITY

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, 1.0 + values[0] * contact.covariates[CHANNEL])


@dataclass(frozen=True, slots=True)
class SandingAtAxles:
    """Factor 1 + gain x at the leading axle and at one more: x is 1 under sand, then e^(−t/T).

    Sanders stand in front of the leading axle and often of the leading one of the next bogie (axle
    4 of a Co-Co, 3 of a Bo-Bo). Axles are counted in the direction of travel.
    """

    id: str = "sanding"
    form: str = "axles"
    title: str = _TITLE
    parameters: tuple[Parameter, ...] = (
        _GAIN,
        Parameter(
            "time",
            "s",
            2.0,
            0.1,
            60.0,
            "time constant after which the sand is worn off",
            starts=(1.0,),
        ),
        Parameter(
            "axle",
            "1",
            4.0,
            1.0,
            999.0,
            "second sanded axle, besides the leading one; 1: none",
            axle=True,
        ),
    )
    literature: str = (
        "Arias-Cuevas et al., Wear 268 (2010) 543-551; Lewis and Dwyer-Joyce, Proc. IMechE F 220 "
        "(2006), on sanders"
    )
    requires: Requirements = _REQUIRES
    observability: Observability = _OBSERVABILITY

    def change(self, contact: Contact, values: tuple[float, ...], lags: LagStates) -> Change:
        """Change of the contacts."""
        gain, time, axle = values
        sanded = (contact.place == 1.0) | (contact.place == round(axle))
        return Change(contact.slip, 1.0 + gain * sanded * self._sand(contact, time, lags))

    def _sand(self, contact: Contact, time: float, lags: LagStates) -> Array:
        """Sand in the contact, 0 to 1, as if every axle had a sander; shape (n,)."""
        strewn = contact.covariates[CHANNEL]
        rate = np.where(strewn > 0.0, 1.0 / RISE_S, 1.0 / time)
        return lags.follow(self.id, contact.axle, contact.lag_time_s, strewn, rate, 0.0)
