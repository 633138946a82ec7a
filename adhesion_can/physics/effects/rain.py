"""Adhesion changes with the rain: in proportion to its level, or by a step at each level."""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
    Separation,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

CHANNEL = "rain"
HEAVY = 2.0
"""Level of heavy rain; that of light rain is 1."""
LEAST_FACTOR = 0.05
"""Least factor of the adhesion in the heaviest rain."""
_TITLE = "adhesion changes with the rain"
# Light rain may leave less adhesion than heavy rain does, which washes the rail.
_LITERATURE = "Beagley and Pritchard, Wear 35 (1975) 299-313; He et al. 2018: about -40 % by water"
_REQUIRES = Requirements(covariates=(CHANNEL,))
_OBSERVABILITY = Observability(
    channel=CHANNEL,
    excitation="the rain",
    separations=(
        Separation("slow_drift", "a longer drive, in which the rain ends and the rail dries"),
    ),
)


@dataclass(frozen=True, slots=True)
class RainByLevel:
    """Factor 1 + gain · level, level 1 in light and 2 in heavy rain."""

    id: str = "rain"
    form: str = "level"
    title: str = _TITLE
    parameters: tuple[Parameter, ...] = (
        Parameter("gain", "1", -0.2, -0.45, 0.5, "share of adhesion gained per level of rain"),
    )
    literature: str = _LITERATURE
    requires: Requirements = _REQUIRES
    observability: Observability = _OBSERVABILITY

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        factor = 1.0 + values[0] * contact.covariates[CHANNEL]
        return Change(contact.slip, np.maximum(factor, LEAST_FACTOR))


@dataclass(frozen=True, slots=True)
class RainBySteps:
    """Factor 1 + gain in light rain, and 1 + ratio · gain in heavy rain."""

    id: str = "rain"
    form: str = "steps"
    title: str = _TITLE
    parameters: tuple[Parameter, ...] = (
        Parameter("gain", "1", -0.25, -0.9, 1.0, "share of adhesion gained in light rain"),
        Parameter(
            "ratio",
            "1",
            1.6,
            -1.0,
            5.0,
            "share of heavy rain, relative to light rain",
            starts=(1.0,),
        ),
    )
    literature: str = _LITERATURE
    requires: Requirements = _REQUIRES
    observability: Observability = _OBSERVABILITY

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        gain, ratio = values
        size = np.interp(contact.covariates[CHANNEL], (0.0, 1.0, HEAVY), (0.0, 1.0, ratio))
        return Change(contact.slip, np.maximum(1.0 + gain * size, LEAST_FACTOR))
