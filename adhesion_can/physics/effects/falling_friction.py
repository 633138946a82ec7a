"""Adhesion falls with creep speed: Burckhardt's c4, and Polach's form."""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.burckhardt import falling_factor
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

FALLING_FRICTION = "falling_friction"
"""Id of the effect in all its forms."""
_TITLE = "adhesion falls with creep speed"
_REQUIRES = Requirements(speed=True)
_OBSERVABILITY = Observability(channel="creep_speed", excitation="creep speed beyond the peak")


@dataclass(frozen=True, slots=True)
class FallingFriction:
    """Factor e^(−c4 |λ V|): the rubbed film warms up and carries less."""

    id: str = FALLING_FRICTION
    form: str = "burckhardt"
    title: str = _TITLE
    parameters: tuple[Parameter, ...] = (
        Parameter("c4", "s/m", 0.1, 0.0, 2.0, "fall of adhesion per m/s of creep, for small creep"),
    )
    literature: str = "Burckhardt 1993, eq. 4 of He et al. 2018"
    requires: Requirements = _REQUIRES
    observability: Observability = _OBSERVABILITY

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, falling_factor(contact.creep_speed, values[0]))


@dataclass(frozen=True, slots=True)
class PolachFriction:
    """Factor (1 − A) e^(−B |v_s|) + A: it falls to a share A of its height and no further."""

    id: str = FALLING_FRICTION
    form: str = "polach"
    title: str = _TITLE
    parameters: tuple[Parameter, ...] = (
        Parameter("B", "s/m", 0.3, 0.0, 3.0, "how fast adhesion falls with creep speed"),
        Parameter("A", "1", 0.4, 0.0, 0.95, "share of it that is left at high creep speed"),
    )
    literature: str = "Polach, Wear 258 (2005) 992-1000"
    requires: Requirements = _REQUIRES
    observability: Observability = _OBSERVABILITY

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        rate, left = values
        return Change(
            contact.slip, 1.0 + (1.0 - left) * np.expm1(-rate * np.abs(contact.creep_speed))
        )
