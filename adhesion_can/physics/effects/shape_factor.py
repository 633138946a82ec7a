"""The base curve is of another family than Burckhardt's: a factor over slip, speed and load.

It is no member of the library: the diagnosis names it by a comparison of families, and an extended
model has it where its base curve is of another family.
"""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.burckhardt import CurveParameters, adhesion
from adhesion_can.physics.curves import Conditions, CurveFamily
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
    Separation,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

CURVE_SHAPE = "curve_shape"
CURVE_SHAPE_TITLE = "the contact follows another curve than Burckhardt's"
SMALLEST_SLIP = 1e-5
"""Slip ratio below which the factor is the ratio of the initial slopes."""
LEAST, MOST = 0.2, 5.0
"""Least and largest factor: farther apart the two curves have nothing in common."""
_SIGNED = "braking and traction, with coasting in between: a curve is the same on both sides"
OBSERVABILITY = Observability(
    channel="slip",
    excitation="slip on both sides of the peak",
    separations=(
        Separation(
            "falling_friction",
            "slip beyond the peak at several speeds: a fall with creep speed moves to smaller "
            "slip as the speed grows",
        ),
        *(Separation(rival, _SIGNED) for rival in ("effort_bias", "speed_scale")),
    ),
)


@dataclass(frozen=True, slots=True)
class CurveShape:
    """Factor by which a curve of another family exceeds a Burckhardt curve near it.

    The estimator goes on with (c1, c2, c3) for the level and the place of the curve.

    Attributes:
        family: Family of the base curve.
        base: Parameters (c1, c2, c3) of the Burckhardt curve nearest to it.

    """

    family: CurveFamily
    base: CurveParameters
    id: str = CURVE_SHAPE
    title: str = CURVE_SHAPE_TITLE
    requires: Requirements = Requirements()
    observability: Observability = OBSERVABILITY

    @property
    def form(self) -> str:
        """Name of the family."""
        return self.family.name

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the family."""
        return self.family.parameters

    @property
    def literature(self) -> str:
        """Reference of the family."""
        return self.family.literature

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        size = np.maximum(np.abs(contact.slip), SMALLEST_SLIP)
        # Samples without a load have 1 N.
        conditions = Conditions(contact.speed, np.where(contact.load > 1.0, contact.load, np.nan))
        curve = self.family.adhesion(size, values, conditions)
        below = np.maximum(adhesion(size, *self.base), 1e-9)
        return Change(contact.slip, np.clip(curve / below, LEAST, MOST))
