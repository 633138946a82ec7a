"""Braking finds another adhesion than traction."""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class TractionBrakingAsymmetry:
    """Factor 1 + gain where the slip is negative."""

    id: str = "traction_braking_asymmetry"
    form: str = ""
    title: str = "adhesion differs between braking and traction"
    parameters: tuple[Parameter, ...] = (
        Parameter("gain", "1", -0.1, -0.6, 1.0, "share by which adhesion in braking is higher"),
    )
    literature: str = "Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, 1990, ch. 5"
    requires: Requirements = Requirements()
    observability: Observability = Observability(
        channel="signed_slip", excitation="traction and braking at the same creep"
    )

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, np.where(contact.slip < 0, 1.0 + values[0], 1.0))
