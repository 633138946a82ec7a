"""The contact lags behind the slip by a relaxation length."""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter, Wheelset

_SHORTEST = 1e-6  # m; no contact is as short, and a length of 0 is a rate that is not finite

LONGEST = 3.0
"""Longest relaxation length, m. That of a wheel on a rail is some contact lengths, of centimetres;
that of a tyre up to its circumference (Pacejka, ch. 7)."""


def _plausible(_wheelset: Wheelset) -> tuple[float, float]:
    return 0.0, LONGEST


@dataclass(frozen=True, slots=True)
class CreepRelaxation:
    """(σ/v) dλ'/dt + λ' = λ: the curve is entered with λ'."""

    id: str = "creep_relaxation"
    form: str = ""
    title: str = "the contact follows the slip over a relaxation length"
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "length",
            "m",
            0.5,
            0.0,
            10.0,
            "distance over which the contact follows",
            plausible=_plausible,
        ),
    )
    literature: str = "Pacejka, Tire and Vehicle Dynamics, 3rd ed. 2012, ch. 7; Kalker 1990"
    requires: Requirements = Requirements(speed=True)
    observability: Observability = Observability(
        channel="slip_rate", excitation="quick changes of creep at low and at high speed"
    )

    def change(self, contact: Contact, values: tuple[float, ...], lags: LagStates) -> Change:
        """Change of the contacts."""
        if values[0] == 0.0:
            return Change(contact.slip)
        # A way, in either direction: a speed that an error of its sensor turned is no growth.
        rate = np.abs(contact.speed) / max(values[0], _SHORTEST)
        return Change(
            lags.follow(self.id, contact.axle, contact.lag_time_s, contact.slip, rate),
        )
