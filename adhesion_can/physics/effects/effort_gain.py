"""The tractive effort is read too large or too small by a share.

F measured = (1 + gain) F. At one axle alone the others show it. A gain of all axles alike scales
the curve, and shows where it changes: in time, or with the heat of the motors.
"""

from dataclasses import dataclass

from adhesion_can.arrays import Array
from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.effects.rows import LawEffect
from adhesion_can.physics.instrument_laws import Need, Quantity, ReadingError, Situation
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

CONTINUOUS_ADHESION = 0.2
"""Adhesion at which a motor has its continuous rating, about: heat 1 is reached there."""
ITERATIONS = 3
"""Fixed-point iterations from the efforts as read to the heat of the true ones."""
EFFORT_GAIN = "effort_gain"
EFFORT_GAIN_TITLE = "the tractive effort reads too high or too low by a percentage"
"""Title of all forms."""
_LITERATURE = (
    "Kiencke and Nielsen, Automotive Control Systems, 2nd ed. 2005, on estimated torque; Krishnan, "
    "Electric Motor Drives, 2001, on rotor resistance and flux over temperature"
)
# A torque that is estimated from currents is right within 5 % where motor parameters are known, and
# within 20 % where they are not.
_MOST = 0.2


@dataclass(frozen=True, slots=True)
class EffortGainLaw:
    """Gain of the effort at one axle, or at all of them where the axle is 0."""

    gain: float
    axle: float = 0.0
    quantity: Quantity = Quantity.EFFORT
    covariates: tuple[str, ...] = ()

    @property
    def needs(self) -> frozenset[Need]:
        """The axle where the gain is that of one."""
        return frozenset({Need.AXLE} if self.axle else ())

    def error(self, situation: Situation, _lags: LagStates) -> ReadingError:
        """Error of the readings."""
        affected = situation.axle == round(self.axle) if self.axle else 1.0
        return ReadingError(self.gain * affected)


@dataclass(frozen=True, slots=True)
class TimeGainLaw:
    """Gain of the effort at all axles, in proportion to time."""

    rate: float
    quantity: Quantity = Quantity.EFFORT
    needs: frozenset[Need] = frozenset({Need.SEQUENCE})
    covariates: tuple[str, ...] = ()

    def error(self, situation: Situation, _lags: LagStates) -> ReadingError:
        """Error of the readings."""
        return ReadingError(self.rate * situation.time_s)


@dataclass(frozen=True, slots=True)
class HeatGainLaw:
    """Gain of the effort with the heat of the motor: its effort squared with a memory."""

    gain: float
    time: float
    quantity: Quantity = Quantity.EFFORT
    needs: frozenset[Need] = frozenset({Need.SEQUENCE})
    covariates: tuple[str, ...] = ()

    def error(self, situation: Situation, lags: LagStates) -> ReadingError:
        """Error of the readings; a recording starts with cold motors.

        Efforts as read are too large themselves, by what the heat of the true ones makes them.
        """
        load = situation.effort / (CONTINUOUS_ADHESION * situation.load)
        heat = self._heat(situation, load, lags, 0)
        for number in range(1, 1 if situation.is_true else ITERATIONS):
            heat = self._heat(situation, load / (1.0 + self.gain * heat), lags, number)
        return ReadingError(self.gain * heat)

    def _heat(self, situation: Situation, load: Array, lags: LagStates, number: int) -> Array:
        """Square of efforts relative to the continuous one, lagging."""
        name = f"{EFFORT_GAIN} {self.time!r} {number}"
        rate = 1.0 / self.time
        return lags.follow(name, situation.axle, situation.lag_time_s, load * load, rate, 0.0)


AXLE_EFFORT_GAIN = LawEffect(
    id=EFFORT_GAIN,
    form="axle",
    title="the tractive effort of one axle reads too high or too low by a percentage",
    parameters=(
        Parameter("gain", "1", 0.05, -_MOST, _MOST, "share by which it reads high"),
        Parameter("axle", "1", 1.0, 1.0, 999.0, "number of the axle", axle=True),
    ),
    literature=_LITERATURE,
    requires=Requirements(several_axles=True),
    observability=Observability(
        channel="axle",
        excitation="creep of the axle beyond the peak, compared with the others",
        separations=(
            Separation(
                "wheel_radius",
                "coasting, where a gain has no effect, and creep beyond the peak, where an "
                "error of the radius has none",
            ),
            Separation("rail_cleaning", "travel in the other direction, where another axle leads"),
        ),
    ),
    law=EffortGainLaw,
)
"""F measured = (1 + gain) F at one axle."""


HEAT_EFFORT_GAIN = LawEffect(
    id=EFFORT_GAIN,
    form="heat",
    title="the tractive effort reads too high or too low by a percentage as the motors heat up",
    parameters=(
        Parameter("gain", "1", 0.08, -_MOST, _MOST, "gain of a motor at its rating for long"),
        Parameter("time", "s", 60.0, 30.0, 900.0, "time constant of the heat", starts=(1.0,)),
    ),
    literature=_LITERATURE,
    requires=Requirements(wheel_speed=True),
    observability=Observability(
        channel="time",
        excitation="minutes of large effort, and minutes of coasting after them",
        separations=(
            Separation("slow_drift", "coasting for some minutes, in which motors cool down"),
            Separation(
                "adhesion_recovery",
                "large effort at small creep, which heats the motor but does not change the rail",
            ),
            Separation(
                "contact_heating",
                "large effort at small creep, which heats the motor but not the contact",
            ),
        ),
    ),
    law=HeatGainLaw,
)
"""F measured = (1 + gain h) F, h = (F / 0.2 N)² lagging by a time."""


TIME_EFFORT_GAIN = LawEffect(
    id=EFFORT_GAIN,
    form="time",
    title="the reading of the tractive effort drifts up or down by a percentage over time",
    parameters=(
        Parameter("rate", "1/s", 3e-4, -2e-3, 2e-3, "growth of the share by which it reads high"),
    ),
    literature=_LITERATURE,
    requires=Requirements(wheel_speed=True),
    observability=Observability(
        channel="time",
        excitation="a long drive on one rail",
        drift=True,
        separations=(
            Separation(
                "slow_drift",
                "acceleration and braking of the train of known mass: a change of the rail does "
                "not change the reading of the force",
            ),
        ),
    ),
    law=TimeGainLaw,
)
"""F measured = (1 + rate t) F at every axle."""


COMMON_EFFORT_GAIN = LawEffect(
    id=EFFORT_GAIN,
    form="all",
    title="the tractive effort of all axles reads too high or too low by a percentage",
    parameters=(Parameter("gain", "1", 0.05, -_MOST, _MOST, "share by which it reads high"),),
    literature=_LITERATURE,
    observability=Observability(
        channel="tractive_effort",
        excitation=(
            "nothing in slip and adhesion, since the curve of every rail is larger by the same "
            "share; the train's mass and acceleration show it"
        ),
    ),
    law=EffortGainLaw,
)
"""F measured = (1 + gain) F at every axle."""
