"""A friction brake takes a share of the braking force that the effort does not contain."""

from dataclasses import dataclass
from math import inf

import numpy as np

from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.effects.rows import LawEffect
from adhesion_can.physics.instrument_laws import (
    LEAST_SENSOR_GAIN,
    Need,
    Quantity,
    ReadingError,
    Situation,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class BlendingLaw:
    """Share of the braking force that is missing: none from a speed on, most of it at rest.

    The vehicle brakes where the effort of all axles does, or that of the axle where not all are
    known. Below the speed the share is on a straight line. Where the motors fade out before the
    vehicle stops, the line meets a share of 1 at that speed, and is above 1 at rest.
    """

    share: float
    fade: float = inf
    quantity: Quantity = Quantity.EFFORT
    needs: frozenset[Need] = frozenset({Need.EFFORTS})
    covariates: tuple[str, ...] = ()

    def error(self, situation: Situation, _lags: LagStates) -> ReadingError:
        """Error of the readings."""
        # One axle's reading near 0 has the sign of its noise, which would be taken for a brake.
        total = situation.total_effort
        brakes = np.where(np.isfinite(total), total, situation.effort) < 0.0
        left = np.maximum(1.0 - situation.speed / max(self.fade, 1e-3), 0.0)
        missing = np.minimum(self.share * left, 1.0)
        return ReadingError(np.where(brakes, -missing, 0.0))


_ID = "brake_blending"
_TITLE = "a friction brake takes a share of the braking force, which the effort does not contain"
_LITERATURE = "Wende, Fahrdynamik des Schienenverkehrs, 2003, on blended electric and air brakes"
_REQUIRES = Requirements(braking=True)
_ASYMMETRY = Separation(
    "traction_braking_asymmetry",
    "braking with the friction brake cut out: a blended brake then gives less force, a rail the "
    "same",
)


BRAKE_BLENDING = LawEffect(
    id=_ID,
    form="constant",
    title=_TITLE,
    parameters=(
        Parameter("share", "1", 0.2, 0.0, 1.0 - LEAST_SENSOR_GAIN, "share of the friction brake"),
    ),
    literature=_LITERATURE,
    requires=_REQUIRES,
    observability=Observability(
        channel="signed_slip",
        excitation="braking and traction, with the friction brake cut out for a while",
        separations=(_ASYMMETRY,),
    ),
    law=BlendingLaw,
)
"""F measured = (1 − share) F in braking."""


FADING_BRAKE_BLENDING = LawEffect(
    id=_ID,
    form="fade",
    title=_TITLE,
    parameters=(
        Parameter("share", "1", 0.2, 0.0, 2.0, "share of the friction brake at rest"),
        Parameter(
            "fade", "m/s", 15.0, 2.0, 60.0, "speed from which the motors brake alone", starts=(1.0,)
        ),
    ),
    literature=_LITERATURE,
    requires=_REQUIRES,
    observability=Observability(
        channel="speed",
        excitation="braking from high to low speed",
        separations=(
            _ASYMMETRY,
            Separation("speed_dependence", "traction at the same speeds as braking"),
        ),
    ),
    law=BlendingLaw,
)
"""F measured = (1 − share (1 − v / fade)) F in braking below a speed: the motors fade out.

A share above 1 is that of motors that give nothing below fade (1 − 1 / share): electric brakes end
at some 3 m/s.
"""
