"""Flange lubrication takes adhesion in curves: an effect that is not one of adhesion-can's own."""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.effects import (
    Change,
    Contact,
    LagStates,
    Observability,
    Parameter,
    Requirements,
    Separation,
)

CURVATURE = "curvature_per_m"
SHARPEST = 1 / 300
"""Curvature from which the loss is whole, 1/m."""


@dataclass(frozen=True, slots=True)
class FlangeLubrication:
    """Factor 1 − loss · min(|κ| · 300 m, 1): grease creeps from the flange onto the rail head."""

    id: str = "flange_lubrication"
    form: str = ""
    title: str = "grease of the wheel flanges takes adhesion in curves"
    parameters: tuple[Parameter, ...] = (
        Parameter("loss", "1", 0.15, -0.2, 0.8, "share of adhesion lost in the sharpest curves"),
    )
    literature: str = "Olofsson and Lewis, Handbook of Railway Vehicle Dynamics, 2006, ch. 5"
    requires: Requirements = Requirements(covariates=(CURVATURE,))
    observability: Observability = Observability(
        channel=CURVATURE,
        excitation="the curvature",
        separations=(
            Separation(
                "curve_creep",
                "creep swept beyond the peak in curves: lateral creep takes nothing there, "
                "grease as much as anywhere",
            ),
        ),
    )

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        share = np.minimum(np.abs(contact.covariates[CURVATURE]) / SHARPEST, 1.0)
        return Change(contact.slip, 1.0 - values[0] * share)
