"""Adhesion drifts with time: the rail dries, or a film builds up."""

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

MIN_FACTOR = 0.1
"""Smallest factor of a drift, a share of the adhesion."""


@dataclass(frozen=True, slots=True)
class SlowDrift:
    """Factor 1 + rate t, t since the recording began."""

    id: str = "slow_drift"
    form: str = ""
    title: str = "adhesion drifts with time"
    parameters: tuple[Parameter, ...] = (
        Parameter("rate", "1/s", -5e-4, -0.01, 0.01, "share of adhesion per second"),
    )
    literature: str = "Beagley and Pritchard, Wear 35 (1975) 299-313, on drying rails"
    requires: Requirements = Requirements()
    observability: Observability = Observability(channel="time", excitation="time", drift=True)

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, np.maximum(1.0 + values[0] * contact.time_s, MIN_FACTOR))
