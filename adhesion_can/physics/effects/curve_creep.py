"""Lateral creep in curves takes part of the adhesion."""

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

CURVATURE, ANGLE = "curvature_per_m", "slip_angle_deg"


def lateral_channel(contact: Contact) -> Array:
    """Values proportional to lateral creep: tangent of a slip angle, else curvature, 1/m."""
    if ANGLE in contact.covariates:
        return np.tan(np.radians(contact.covariates[ANGLE]))
    return contact.covariates[CURVATURE]


@dataclass(frozen=True, slots=True)
class CurveCreep:
    """μ = curve(λ_c) λ/λ_c with λ_c² = λ² + λ_y²: adhesion points against the whole creep."""

    id: str = "curve_creep"
    form: str = ""
    title: str = "lateral creep takes part of the adhesion"
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "lever",
            "m",
            6.0,
            0.0,
            30.0,
            "lateral creep per curvature, or per slip angle",
        ),
    )
    literature: str = "Kalker 1990; Burckhardt 1993 on combined slip"
    requires: Requirements = Requirements(covariates=(CURVATURE, ANGLE))
    observability: Observability = Observability(channel=CURVATURE, excitation="lateral creep")

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        if values[0] == 0.0:
            return Change(contact.slip)
        lateral = values[0] * lateral_channel(contact)
        whole = np.hypot(contact.slip, lateral)
        share = np.divide(np.abs(contact.slip), whole, out=np.ones_like(whole), where=whole > 0.0)
        return Change(np.copysign(whole, contact.slip), share)
