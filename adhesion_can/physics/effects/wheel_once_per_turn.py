"""One axle's wheel speed swings once a turn: its pole wheel is eccentric."""

from dataclasses import dataclass
from math import pi

import numpy as np

from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.effects.rows import LawEffect
from adhesion_can.physics.instrument_laws import Need, Quantity, ReadingError, Situation
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter, SearchStart


@dataclass(frozen=True, slots=True)
class OncePerTurnLaw:
    """Relative error of one wheel's speed, a sine of the angle that it has turned."""

    amplitude: float
    phase: float
    axle: float
    quantity: Quantity = Quantity.WHEEL_SPEED
    needs: frozenset[Need] = frozenset({Need.WHEEL_ANGLE, Need.SEQUENCE, Need.AXLE})
    covariates: tuple[str, ...] = ()

    def error(self, situation: Situation, _lags: LagStates) -> ReadingError:
        """Error of the readings."""
        angle = situation.wheel_angle
        if angle is None:
            return ReadingError(np.full(len(situation.axle), np.nan))
        size = self.amplitude * (situation.axle == round(self.axle))
        turned = angle + self.phase
        rate = size * np.cos(turned) * situation.wheel_speed
        return ReadingError(size * np.sin(turned), relative_rate=rate)


WHEEL_ONCE_PER_TURN = LawEffect(
    id="wheel_once_per_turn",
    title="one axle's wheel speed oscillates once per turn, as with an eccentric pole wheel",
    parameters=(
        # 2 mm over the radius of a pole wheel, 0.15 to 0.6 m.
        Parameter("amplitude", "1", 0.004, -0.02, 0.02, "relative amplitude of the wheel speed"),
        Parameter(
            "phase",
            "rad",
            1.0,
            -2.0 * pi,
            2.0 * pi,
            "phase at the start of the recording",
            search=SearchStart.WHEEL_PHASE,
        ),
        Parameter("axle", "1", 1.0, 1.0, 999.0, "number of the axle", axle=True),
    ),
    literature="Isermann, Fault-Diagnosis Applications, 2011, on speed sensors",
    requires=Requirements(wheel_speed=True, one_recording=True),
    observability=Observability(
        channel="axle",
        excitation="small creep of the axle at a speed at which it turns a few times a second",
        separations=(
            Separation("wheel_radius", "coasting for some turns of the wheel"),
            Separation("wheelset_inertia", "coasting: an oscillation of the sensor moves no load"),
        ),
    ),
    law=OncePerTurnLaw,
)
"""ω measured = (1 + amplitude · sin(θ + phase)) ω at one axle, θ the angle turned.

The angle is counted from the start of the recording, so the phase belongs to it alone.
"""
