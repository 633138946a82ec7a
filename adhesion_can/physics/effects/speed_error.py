"""The vehicle speed has an error that depends on something: time, effort, curves, its own rate.

v measured = (1 + error) v. A constant error is `speed_scale`, a late speed `speed_delay`.
"""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.effects.rows import LawEffect
from adhesion_can.physics.instrument_laws import Need, Quantity, ReadingError, Situation
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter, SearchStart
from adhesion_can.physics.readings import Role

CURVATURE = COVARIATES[Role.CURVATURE]
RATE_WINDOW_S = 1.0
"""Time over which the acceleration is found from speeds that come one by one, s."""
SPEED_ERROR = "speed_error"
_NONE: frozenset[Need] = frozenset()


@dataclass(frozen=True, slots=True)
class SpeedStep:
    """Relative error from a time on."""

    share: float
    time: float
    quantity: Quantity = Quantity.SPEED
    needs: frozenset[Need] = frozenset({Need.SEQUENCE})
    covariates: tuple[str, ...] = ()

    def error(self, situation: Situation, _lags: LagStates) -> ReadingError:
        """Error of the readings."""
        return ReadingError(np.where(situation.time_s >= self.time, self.share, 0.0))


@dataclass(frozen=True, slots=True)
class SpeedGrowth:
    """Relative error that grows to a final share, as the radii of wheels do that warm up."""

    share: float
    time: float
    quantity: Quantity = Quantity.SPEED
    needs: frozenset[Need] = frozenset({Need.SEQUENCE})
    covariates: tuple[str, ...] = ()

    def error(self, situation: Situation, _lags: LagStates) -> ReadingError:
        """Error of the readings."""
        return ReadingError(-self.share * np.expm1(-situation.time_s / self.time))


@dataclass(frozen=True, slots=True)
class SpeedPitch:
    """Relative error in proportion to the effort of all axles over their static load."""

    share: float
    quantity: Quantity = Quantity.SPEED
    needs: frozenset[Need] = frozenset({Need.EFFORTS})
    covariates: tuple[str, ...] = ()

    def error(self, situation: Situation, _lags: LagStates) -> ReadingError:
        """Error of the readings."""
        if situation.vehicle is None:
            return ReadingError(np.full(len(situation.axle), np.nan))
        share = situation.total_effort / sum(situation.vehicle.axle_load)
        return ReadingError(self.share * share * situation.travel)


@dataclass(frozen=True, slots=True)
class SpeedInCurves:
    """Relative error in proportion to the curvature, with its sign or without."""

    offset: float
    signed: bool = True
    quantity: Quantity = Quantity.SPEED
    needs: frozenset[Need] = _NONE
    covariates: tuple[str, ...] = (CURVATURE,)

    def error(self, situation: Situation, _lags: LagStates) -> ReadingError:
        """Error of the readings."""
        curvature = situation.channel(CURVATURE)
        return ReadingError(self.offset * (curvature if self.signed else np.abs(curvature)))


@dataclass(frozen=True, slots=True)
class SpeedLowPass:
    """First-order lag of the instrument: the reading misses its own rate of change times a time."""

    time: float
    quantity: Quantity = Quantity.SPEED
    needs: frozenset[Need] = frozenset({Need.SEQUENCE})
    covariates: tuple[str, ...] = ()

    def error(self, situation: Situation, lags: LagStates) -> ReadingError:
        """Error of the readings.

        A lag of the speed is a lag of its rate. Where the rate is not known it is that of a lead
        and a lag, so that the noise of the speed is not differentiated.
        """
        axle, t = situation.axle, situation.lag_time_s
        rate = situation.acceleration
        if situation.is_true and rate is not None:
            rate = lags.follow(
                f"{SPEED_ERROR} {self.time!r}", axle, t, rate, 1.0 / max(self.time, 1e-3)
            )
        elif rate is None:
            window = 1.0 / RATE_WINDOW_S
            late = lags.follow(f"{SPEED_ERROR} rate", axle, t, situation.speed, window)
            rate = (situation.speed - late) * window
        return ReadingError(absolute=-self.time * rate)


def _in_curves_to_either_side(offset: float) -> SpeedInCurves:
    return SpeedInCurves(offset, signed=False)


_LITERATURE = "Malvezzi et al., Proc. IMechE F 228 (2014), on odometry"


STEPPED_SPEED_ERROR = LawEffect(
    id=SPEED_ERROR,
    form="step",
    title="the vehicle speed reads too high or too low by a percentage from a certain time on",
    parameters=(
        Parameter("error", "1", 0.01, -0.05, 0.05, "share by which it reads high afterwards"),
        Parameter(
            "time",
            "s",
            60.0,
            0.0,
            1e5,
            "time of the step since the recording began",
            search=SearchStart.STEP_TIME,
            step=2.0,
        ),
    ),
    literature=_LITERATURE,
    requires=Requirements(one_recording=True),
    observability=Observability(
        channel="time",
        excitation="coasting before and after the step",
        separations=(
            Separation("speed_scale", "coasting at the start and at the end of the drive"),
            Separation("slow_drift", "coasting, where adhesion has no effect"),
        ),
    ),
    law=SpeedStep,
)
"""v measured = (1 + error) v from a time on."""


GROWING_SPEED_ERROR = LawEffect(
    id=SPEED_ERROR,
    form="growth",
    title="the vehicle speed reads too high or too low by a growing percentage",
    parameters=(
        Parameter("error", "1", 0.005, -0.05, 0.05, "share by which it reads high at the end"),
        Parameter("time", "s", 50.0, 5.0, 500.0, "time constant", step=2.0),
    ),
    literature=_LITERATURE,
    requires=Requirements(one_recording=True),
    observability=Observability(channel="time", excitation="coasting throughout the drive"),
    law=SpeedGrowth,
)
"""v measured = (1 + error (1 − e^(−t/T))) v. No candidate: the radii of all wheels, which grow with
the heat of brakes and slip, show the same. An error that it explains better has no name."""


PITCH_SPEED_ERROR = LawEffect(
    id=SPEED_ERROR,
    form="pitch",
    title="the vehicle speed reads too high or too low as the effort pitches the body",
    parameters=(
        Parameter(
            "error", "1", 0.05, -0.15, 0.15, "relative error at an effort equal to the weight"
        ),
    ),
    literature="Skolnik, Introduction to Radar Systems, 3rd ed. 2001, on Doppler's cosine",
    requires=Requirements(all_efforts=True),
    observability=Observability(
        channel="tractive_effort",
        excitation="single axles that spin or coast while the others pull",
        separations=(
            Separation(
                "speed_scale", "traction and braking: the pitch changes sign with the effort"
            ),
        ),
    ),
    law=SpeedPitch,
)
"""v measured = (1 + error · ΣF/ΣN) v: the body pitches, and a radar with it.

A radar at an angle α to the rail reads by tan(α) δ less where it pitches by δ: 0.03 for 2
degrees at 40 degrees, at an effort of 0.3 of the weight.
"""


_IN_CURVES = Observability(
    channel="curvature_per_m",
    excitation="coasting in curves to either side and on straight track",
    separations=(
        Separation("curve_creep", "coasting in curves, and creep beyond the peak in curves"),
    ),
)


OFFSET_SPEED_ERROR = LawEffect(
    id=SPEED_ERROR,
    form="offset",
    title="the vehicle speed is measured off the track's centre line, which is wrong in curves",
    parameters=(
        Parameter(
            "offset",
            "m",
            1.0,
            -3.0,
            3.0,
            "distance of the sensor from the centre line, to the outer side",
        ),
    ),
    literature=_LITERATURE,
    requires=Requirements(covariates=(CURVATURE,)),
    observability=_IN_CURVES,
    law=SpeedInCurves,
)
"""v measured = (1 + offset · κ) v: the sensor is beside the middle of the track."""


CURVATURE_SPEED_ERROR = LawEffect(
    id=SPEED_ERROR,
    form="curvature",
    title="the vehicle speed reads too high or too low by a percentage in curves",
    parameters=(Parameter("offset", "m", 1.0, -6.0, 6.0, "relative error over the curvature"),),
    literature=_LITERATURE,
    requires=Requirements(covariates=(CURVATURE,)),
    observability=_IN_CURVES,
    law=_in_curves_to_either_side,
)
"""v measured = (1 + offset · |κ|) v: an error in curves to either side alike."""


LOW_PASS_SPEED_ERROR = LawEffect(
    id=SPEED_ERROR,
    form="low_pass",
    title="the vehicle speed is smoothed by its instrument",
    parameters=(Parameter("time", "s", 0.5, 0.0, 3.0, "time constant of the instrument"),),
    literature="Ljung, System Identification, 2nd ed. 1999, sec. 2.2",
    requires=Requirements(speed=True, wheel_speed=True),
    observability=Observability(
        channel="slip_rate",
        excitation="steps of the effort of all axles",
        separations=(
            Separation(
                "speed_delay",
                "steps of the effort of all axles: a late speed bends a moment later, a smoothed "
                "one bends at once and less sharply",
            ),
        ),
    ),
    law=SpeedLowPass,
)
"""v measured follows v by a first-order lag."""
