"""The vehicle speed has an error that depends on something: time, effort, curves, its own rate.

v measured = (1 + error) v. A constant error is `speed_scale`, a late speed `speed_delay`.
"""

from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.effects.lag_states import LagStates
from adhesion_can.physics.instrument_laws import Need, Quantity, ReadingError, Situation
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter, SearchStart
from adhesion_can.physics.readings import Role

CURVATURE = COVARIATES[Role.CURVATURE]
RATE_WINDOW_S = 1.0
"""Time over which the acceleration is found from speeds that come one by one, s."""
_ID = "speed_error"
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
    signed: bool
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
            rate = lags.follow(f"{_ID} {self.time!r}", axle, t, rate, 1.0 / max(self.time, 1e-3))
        elif rate is None:
            window = 1.0 / RATE_WINDOW_S
            late = lags.follow(f"{_ID} rate", axle, t, situation.speed, window)
            rate = (situation.speed - late) * window
        return ReadingError(absolute=-self.time * rate)


_LITERATURE = "Malvezzi et al., Proc. IMechE F 228 (2014), on odometry and radar"


@dataclass(frozen=True, slots=True)
class SteppedSpeedError:
    """v measured = (1 + error) v from a time on."""

    id: str = _ID
    form: str = "step"
    title: str = "the vehicle speed is measured too high or too low by a share from a time on"
    parameters: tuple[Parameter, ...] = (
        Parameter("error", "1", 0.01, -0.05, 0.05, "share by which it reads high afterwards"),
        Parameter(
            "time", "s", 60.0, 0.0, 1e5, "time of the step since the recording began",
            search=SearchStart.STEP_TIME, step=2.0,
        ),
    )  # fmt: skip
    literature: str = _LITERATURE
    requires: Requirements = Requirements(one_recording=True)
    observability: Observability = Observability(
        channel="time",
        excitation="coasting before and after the step",
        separations=(
            Separation("speed_scale", "coasting at the begin and at the end of the drive"),
            Separation("slow_drift", "coasting, where adhesion has nothing to act on"),
        ),
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return instruments.with_law(SpeedStep(values[0], values[1]), values[0])


@dataclass(frozen=True, slots=True)
class PitchSpeedError:
    """v measured = (1 + error · ΣF/ΣN) v: the body pitches, and a radar with it.

    A radar at an angle α to the rail reads by tan(α) δ less where it pitches by δ: 0.03 for 2
    degrees at 40 degrees, at an effort of 0.3 of the weight.
    """

    id: str = _ID
    form: str = "pitch"
    title: str = "the vehicle speed is measured too high or too low as the effort pitches the body"
    parameters: tuple[Parameter, ...] = (
        Parameter("error", "1", 0.05, -0.15, 0.15, "relative error at an effort of all the weight"),
    )
    literature: str = "Skolnik, Introduction to Radar Systems, 3rd ed. 2001, on Doppler's cosine"
    requires: Requirements = Requirements(all_efforts=True)
    observability: Observability = Observability(
        channel="tractive_effort",
        excitation="single axles that spin or coast while the others pull",
        separations=(
            Separation(
                "speed_scale", "traction and braking: a pitch changes its sign with the effort"
            ),
        ),
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return instruments.with_law(SpeedPitch(values[0]), values[0])


_IN_CURVES = Observability(
    channel="curvature_per_m",
    excitation="coasting in curves to either side and on straight track",
    separations=(
        Separation("curve_creep", "coasting in curves, and creep beyond the peak in curves"),
    ),
)


@dataclass(frozen=True, slots=True)
class OffsetSpeedError:
    """v measured = (1 + offset · κ) v: the sensor is beside the middle of the track."""

    id: str = _ID
    form: str = "offset"
    title: str = "the vehicle speed is measured beside the middle of the track, and errs in curves"
    parameters: tuple[Parameter, ...] = (
        Parameter("offset", "m", 1.0, -3.0, 3.0, "distance of the sensor to the outer side"),
    )
    literature: str = _LITERATURE
    requires: Requirements = Requirements(covariates=(CURVATURE,))
    observability: Observability = _IN_CURVES

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return instruments.with_law(SpeedInCurves(values[0], signed=True), values[0])


@dataclass(frozen=True, slots=True)
class CurvatureSpeedError:
    """v measured = (1 + offset · |κ|) v: an error in curves to either side alike."""

    id: str = _ID
    form: str = "curvature"
    title: str = "the vehicle speed is measured too high or too low by a share in curves"
    parameters: tuple[Parameter, ...] = (
        Parameter("offset", "m", 1.0, -6.0, 6.0, "relative error over the curvature"),
    )
    literature: str = _LITERATURE
    requires: Requirements = Requirements(covariates=(CURVATURE,))
    observability: Observability = _IN_CURVES

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return instruments.with_law(SpeedInCurves(values[0], signed=False), values[0])


@dataclass(frozen=True, slots=True)
class LowPassSpeedError:
    """v measured follows v by a first-order lag."""

    id: str = _ID
    form: str = "low_pass"
    title: str = "the vehicle speed is smoothed by its instrument"
    parameters: tuple[Parameter, ...] = (
        Parameter("time", "s", 0.5, 0.0, 3.0, "time constant of the instrument"),
    )
    literature: str = "Ljung, System Identification, 2nd ed. 1999, sec. 2.2"
    requires: Requirements = Requirements(speed=True, wheel_speed=True)
    observability: Observability = Observability(
        channel="slip_rate",
        excitation="steps of the effort of all axles",
        separations=(
            Separation(
                "speed_delay",
                "steps of the effort of all axles: a late speed bends a moment later, a smoothed "
                "one bends at once and less sharply",
            ),
        ),
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return instruments.with_law(SpeedLowPass(values[0]), values[0])
