"""Adhesion changes with the surroundings: humidity, rail temperature, rain, sand; and with time.

Each effect, and each form of one, is a row of `COVARIATE_FACTORS` with its formula.
"""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.effects.base import Contact, Observability, Requirements, Separation
from adhesion_can.physics.effects.rows import FactorEffect
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

HUMIDITY, RAIL_TEMPERATURE = "relative_humidity_percent", "rail_temperature_degC"
RAIN, SAND = "rain", "sanding_active"
"""Channels of the covariates."""
LIGHT, HEAVY = 1.0, 2.0
"""Levels of rain."""
LEAST_IN_RAIN, LEAST_IN_DRIFT = 0.05, 0.1
"""Least factor in the heaviest rain, and of a drift in time."""
SAND_RISE_S = 0.05
"""Time constant with which sand reaches the contact, s."""

_RAIN_SHOWS = Observability(
    channel=RAIN,
    excitation="the rain",
    separations=(
        Separation("slow_drift", "a longer drive, in which the rain ends and the rail dries"),
    ),
)
# Light rain may leave less adhesion than heavy rain does, which washes the rail.
_RAIN_READING = (
    "Beagley and Pritchard, Wear 35 (1975) 299-313; He et al. 2018: about -40 % by water"
)
_SAND_SHOWS = Observability(channel=SAND, excitation="sanding")
_SAND_READING = "Arias-Cuevas et al., Wear 268 (2010) 543-551"
_SAND_GAIN = Parameter("gain", "1", 0.2, -0.5, 2.0, "share of adhesion gained under sand")


def _rain_by_steps(contact: Contact, _lags: LagStates, gain: float, ratio: float) -> Array:
    """1 + gain in light rain, and 1 + ratio · gain in heavy rain."""
    size = np.interp(contact.covariates[RAIN], (0.0, LIGHT, HEAVY), (0.0, 1.0, ratio))
    factor: Array = np.maximum(1.0 + gain * size, LEAST_IN_RAIN)
    return factor


def _sand_at_axles(
    contact: Contact, lags: LagStates, gain: float, time: float, axle: float
) -> Array:
    """1 + gain x at the leading axle and at one more: x is 1 under sand, then e^(−t/T).

    Sanders stand in front of the leading axle and often of the leading one of the next bogie (axle
    4 of a Co-Co, 3 of a Bo-Bo). Axles are counted in the direction of travel.
    """
    strewn = contact.covariates[SAND]
    rate = np.where(strewn > 0.0, 1.0 / SAND_RISE_S, 1.0 / time)
    sand = lags.follow("sanding", contact.axle, contact.lag_time_s, strewn, rate, 0.0)
    sanded = (contact.place == 1.0) | (contact.place == round(axle))
    factor: Array = 1.0 + gain * sanded * sand
    return factor


COVARIATE_FACTORS: tuple[FactorEffect, ...] = (
    FactorEffect(
        id="humidity",
        title="adhesion changes with the humidity of the air",
        parameters=(
            Parameter("slope", "1/%", -0.003, -0.01, 0.01, "share of adhesion per % of humidity"),
        ),
        literature="Olofsson and Sundvall, Proc. IMechE F 218 (2004) 301-310",
        requires=Requirements(covariates=(HUMIDITY,)),
        observability=Observability(
            channel=HUMIDITY,
            excitation="the humidity",
            separations=(
                Separation(
                    "slow_drift", "a longer drive, in which humidity returns to an earlier value"
                ),
            ),
        ),
        factor=lambda at, _, slope: 1.0 + slope * (at.covariates[HUMIDITY] - 60.0),
    ),
    FactorEffect(
        id="rail_temperature",
        title="adhesion changes with the temperature of the rail",
        parameters=(Parameter("slope", "1/K", 0.005, -0.02, 0.02, "share of adhesion per K"),),
        literature="Lyu et al., Tribology International 90 (2015) 1-8",
        requires=Requirements(covariates=(RAIL_TEMPERATURE,)),
        observability=Observability(
            channel=RAIL_TEMPERATURE,
            excitation="the rail's temperature",
            separations=(
                Separation(
                    "slow_drift",
                    "a longer drive, in which the rail's temperature returns to an earlier value",
                ),
            ),
        ),
        factor=lambda at, _, slope: 1.0 + slope * (at.covariates[RAIL_TEMPERATURE] - 20.0),
    ),
    FactorEffect(
        id="rain",
        form="level",
        title="adhesion changes with the rain",
        parameters=(
            Parameter("gain", "1", -0.2, -0.45, 0.5, "share of adhesion gained per level of rain"),
        ),
        literature=_RAIN_READING,
        requires=Requirements(covariates=(RAIN,)),
        observability=_RAIN_SHOWS,
        factor=lambda at, _, gain: np.maximum(1.0 + gain * at.covariates[RAIN], LEAST_IN_RAIN),
    ),
    FactorEffect(
        id="rain",
        form="steps",
        title="adhesion changes with the rain",
        parameters=(
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
        ),
        literature=_RAIN_READING,
        requires=Requirements(covariates=(RAIN,)),
        observability=_RAIN_SHOWS,
        factor=_rain_by_steps,
    ),
    # All axles have sand as long as it is strewn.
    FactorEffect(
        id="sanding",
        title="sand changes adhesion while it is applied",
        parameters=(_SAND_GAIN,),
        literature=_SAND_READING,
        requires=Requirements(covariates=(SAND,)),
        observability=_SAND_SHOWS,
        factor=lambda at, _, gain: 1.0 + gain * at.covariates[SAND],
    ),
    # Sand lies on the wheels of two axles and under them until it has been worn off.
    FactorEffect(
        id="sanding",
        form="axles",
        title="sand changes adhesion while it is applied",
        parameters=(
            _SAND_GAIN,
            Parameter(
                "time",
                "s",
                2.0,
                0.1,
                60.0,
                "time constant after which the sand is worn off",
                starts=(1.0,),
            ),
            Parameter(
                "axle",
                "1",
                4.0,
                1.0,
                999.0,
                "second sanded axle, besides the leading one; 1: none",
                axle=True,
            ),
        ),
        literature=(
            f"{_SAND_READING}; Lewis and Dwyer-Joyce, Proc. IMechE F 220 (2006), on sanders"
        ),
        requires=Requirements(covariates=(SAND,)),
        observability=_SAND_SHOWS,
        factor=_sand_at_axles,
    ),
    # The rail dries, or a film builds up.
    FactorEffect(
        id="slow_drift",
        title="adhesion drifts with time",
        parameters=(Parameter("rate", "1/s", -5e-4, -0.01, 0.01, "share of adhesion per second"),),
        literature="Beagley and Pritchard, Wear 35 (1975) 299-313, on drying rails",
        observability=Observability(channel="time", excitation="time", drift=True),
        factor=lambda at, _, rate: np.maximum(1.0 + rate * at.time_s, LEAST_IN_DRIFT),
    ),
    FactorEffect(
        id="traction_braking_asymmetry",
        title="adhesion differs between braking and traction",
        parameters=(
            Parameter("gain", "1", -0.1, -0.6, 1.0, "share by which adhesion in braking is higher"),
        ),
        literature="Kalker, Three-Dimensional Elastic Bodies in Rolling Contact, 1990, ch. 5",
        observability=Observability(
            channel="signed_slip", excitation="traction and braking at the same creep"
        ),
        factor=lambda at, _, gain: np.where(at.slip < 0, 1.0 + gain, 1.0),
    ),
)
"""The effects, in the order in which they act."""
