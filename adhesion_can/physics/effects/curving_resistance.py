"""A part of the effort is spent on the resistance of curves."""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.effects.rows import LawEffect
from adhesion_can.physics.instrument_laws import Need, Quantity, ReadingError, Situation
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter
from adhesion_can.physics.readings import Role

CURVATURE = COVARIATES[Role.CURVATURE]
ROECKL_M, SHORTER_M = 0.65, 55.0
"""Resistance over load 0.65 / (R − 55) by Roeckl's formula, m and m, for standard gauge."""
TIGHTEST_M = 100.0
"""Radius below which the resistance does not grow, m."""


@dataclass(frozen=True, slots=True)
class CurveResistanceLaw:
    """The effort holds what flanges and creep take in curves: always against the motion."""

    size: float
    quantity: Quantity = Quantity.EFFORT
    needs: frozenset[Need] = frozenset()
    covariates: tuple[str, ...] = (CURVATURE,)

    def error(self, situation: Situation, _lags: LagStates) -> ReadingError:
        """Error of the readings."""
        curvature = np.minimum(np.abs(situation.channel(CURVATURE)), 1.0 / TIGHTEST_M)
        share = ROECKL_M * curvature / (1.0 - SHORTER_M * curvature)
        return ReadingError(absolute=self.size * share * situation.load)


CURVING_RESISTANCE = LawEffect(
    id="curving_resistance",
    title="curves resist the motion and take part of the effort",
    parameters=(Parameter("size", "1", 1.0, -1.0, 5.0, "resistance relative to Roeckl's formula"),),
    literature=(
        "Roeckl's formula, as in Wende, Fahrdynamik des Schienenverkehrs, 2003; locomotives with "
        "stiff bogies take a multiple of it"
    ),
    requires=Requirements(covariates=(CURVATURE,)),
    observability=Observability(
        channel="curvature_per_m",
        excitation="traction, coasting and braking in curves",
        separations=(
            Separation(
                "curve_creep",
                "coasting in curves, where a resistance remains, and braking, where it helps",
            ),
            Separation("effort_bias", "curves of several radii, and straight track"),
            Separation("speed_error", "curves at several speeds, and creep beyond the peak"),
        ),
    ),
    law=CurveResistanceLaw,
)
"""F measured = F + size · w(R) N with Roeckl's w(R) = 0.65 m / (R − 55 m)."""
