"""Adhesion changes with the state of the contact: speed, load, creep, place and slip work.

Each effect, and each form of one, is a row of `CONTACT_FACTORS` with its formula.
"""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import falling_factor, load_factor
from adhesion_can.physics.effects.base import Contact, Observability, Requirements, Separation
from adhesion_can.physics.effects.rows import FactorEffect
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter, Wheelset

FALLING_FRICTION, LOAD_DEPENDENCE = "falling_friction", "load_dependence"
"""Ids of effects that others ask for, in all their forms."""
LARGEST_RISE = 0.25
"""Largest rise with the speed that is allowed, as a share of Curtius and Kniffler's fall, for
errors of the estimate."""
POWER_LOAD = 100e3
"""Load at which the power law changes nothing, N."""

_LOAD_SHOWS = Observability(channel="axle_load", excitation="the axle load")
_FALL_SHOWS = Observability(channel="creep_speed", excitation="creep speed beyond the peak")


def _curtius_kniffler(speed: Array) -> Array:
    """Adhesion over that at standstill, 7.5/(V + 44) + 0.161 with V in km/h, of a speed in m/s."""
    return (7.5 / (3.6 * speed + 44.0) + 0.161) / (7.5 / 44.0 + 0.161)


def _plausible_fall(_wheelset: Wheelset) -> tuple[float, float]:
    """No measurement in the literature has adhesion rise with the speed at the same slip."""
    return -LARGEST_RISE, 3.0


def _slip_work(name: str, contact: Contact, time: float, lags: LagStates) -> Array:
    """Slip work W of the last seconds, dW/dt = |F v_s| − W/T, J, shape (n,); 0 at the start.

    Args:
        name: Name of the lag in the lag states.
        contact: State of the contacts; rows of one axle in the order of time.
        time: Memory T, s.
        lags: Lagging states, carried from call to call.

    """
    power = np.abs(contact.adhesion * contact.load * contact.creep_speed)
    return lags.follow(name, contact.axle, contact.lag_time_s, power * time, 1.0 / time, 0.0)


CONTACT_FACTORS: tuple[FactorEffect, ...] = (
    FactorEffect(
        id="speed_dependence",
        title="adhesion at the same slip falls with vehicle speed",
        parameters=(
            Parameter(
                "share",
                "1",
                1.0,
                -1.0,
                3.0,
                "fall with speed; 1 is Curtius and Kniffler's",
                plausible=_plausible_fall,
            ),
        ),
        literature="Curtius and Kniffler, Elektrische Bahnen 21 (1950) 201-210",
        requires=Requirements(speed=True),
        observability=Observability(
            channel="speed",
            excitation="the speed",
            separations=(
                Separation(
                    "falling_friction",
                    "creep swept beyond the peak at low and at high speed: one effect falls with "
                    "speed at the same slip, the other with creep speed only",
                ),
            ),
        ),
        factor=lambda at, _, share: 1.0 + share * (_curtius_kniffler(at.speed) - 1.0),
    ),
    FactorEffect(
        id=LOAD_DEPENDENCE,
        form="burckhardt",
        title="adhesion changes with wheel load",
        parameters=(
            # 4e-12 takes a quarter off at 245 kN. The bound is for road tyres' loads of a few kN.
            Parameter("c5", "1/N^2", 4e-12, 0.0, 1e-6, "share of adhesion lost per squared load"),
        ),
        literature="Burckhardt 1993, eq. 4 of He et al. 2018",
        requires=Requirements(load=True),
        observability=_LOAD_SHOWS,
        factor=lambda at, _, c5: load_factor(at.load, c5),
    ),
    # Hertzian contact has the exponent 1/3 at constant friction of its area.
    FactorEffect(
        id=LOAD_DEPENDENCE,
        form="power",
        title="adhesion changes with wheel load",
        parameters=(
            Parameter(
                "exponent", "1", 0.5, -3.0, 3.0, "adhesion falls with this power of the load"
            ),
        ),
        literature="Popov, Contact Mechanics and Friction, 2nd ed. 2017, on the load's power law",
        requires=Requirements(load=True),
        observability=_LOAD_SHOWS,
        factor=lambda at, _, exponent: (at.load / POWER_LOAD) ** -exponent,
    ),
    # The rubbed film warms up and carries less.
    FactorEffect(
        id=FALLING_FRICTION,
        form="burckhardt",
        title="adhesion falls with creep speed",
        parameters=(
            Parameter(
                "c4", "s/m", 0.1, 0.0, 2.0, "fall of adhesion per m/s of creep, for small creep"
            ),
        ),
        literature="Burckhardt 1993, eq. 4 of He et al. 2018",
        requires=Requirements(speed=True),
        observability=_FALL_SHOWS,
        factor=lambda at, _, c4: falling_factor(at.creep_speed, c4),
    ),
    # (1 − A) e^(−B |v_s|) + A: adhesion falls to a share A of its height and no further.
    FactorEffect(
        id=FALLING_FRICTION,
        form="polach",
        title="adhesion falls with creep speed",
        parameters=(
            Parameter("B", "s/m", 0.3, 0.0, 3.0, "how fast adhesion falls with creep speed"),
            Parameter("A", "1", 0.4, 0.0, 0.95, "share of it that is left at high creep speed"),
        ),
        literature="Polach, Wear 258 (2005) 992-1000",
        requires=Requirements(speed=True),
        observability=_FALL_SHOWS,
        factor=lambda at, _, b, a: 1.0 + (1.0 - a) * np.expm1(-b * np.abs(at.creep_speed)),
    ),
    # The place counts from the leading axle in the direction of travel.
    FactorEffect(
        id="rail_cleaning",
        title="each axle runs on a rail cleaned by the axles in front",
        parameters=(
            Parameter("gain", "1", 0.02, -0.1, 0.2, "share of adhesion gained from axle to axle"),
        ),
        literature="Voltr and Lata, Vehicle System Dynamics 53 (2015) 605-618",
        requires=Requirements(several_axles=True),
        observability=Observability(
            channel="axle",
            excitation="which axle leads",
            separations=(
                Separation(
                    "load_dependence",
                    "a drive in reverse, where another axle leads but the loads are the same",
                ),
                Separation("wheel_radius", "a drive in reverse, and coasting of every axle"),
            ),
        ),
        factor=lambda at, _, gain: 1.0 + gain * (at.place - 1.0),
    ),
    FactorEffect(
        id="adhesion_recovery",
        title="slip work cleans the contact, and adhesion recovers",
        parameters=(
            Parameter("gain", "1/J", 4e-7, 0.0, 1e-5, "share of adhesion gained per slip work"),
            Parameter("time", "s", 3.0, 0.3, 30.0, "time constant after which it is lost again"),
        ),
        literature="Meierhofer et al., Proc. IMechE F 228 (2014); Voltr and Lata 2015",
        requires=Requirements(speed=True),
        observability=Observability(
            channel="slip",
            excitation="the time for which a creep is held",
            separations=(
                Separation(
                    "falling_friction",
                    "the same creep held for seconds and passed quickly: recovery needs time",
                ),
            ),
        ),
        factor=lambda at, lags, gain, time: (
            1.0 + gain * _slip_work("adhesion_recovery", at, time, lags)
        ),
    ),
    # The memory of `adhesion_recovery` with the opposite sign. The two are different mechanisms
    # with limits of their own: the sign of what slip work does names the one that prevails, and
    # where both act, the one with the shorter memory shows first. In 2 s heat enters about 5 mm of
    # steel (√(a T), a = 1.2e-5 m²/s).
    FactorEffect(
        id="contact_heating",
        title="slip work heats the contact, and friction falls",
        parameters=(
            Parameter(
                "loss", "1/J", 1e-6, 0.0, 2e-5, "share of adhesion lost per slip work, at first"
            ),
            Parameter(
                "time",
                "s",
                2.0,
                0.2,
                30.0,
                "time constant after which the contact has cooled",
                starts=(0.5, 2.0),
            ),
        ),
        literature="Ertz and Knothe, Wear 253 (2002) 498-508; Tomberger et al., Wear 271 (2011)",
        requires=Requirements(speed=True),
        observability=Observability(
            channel="creep_speed",
            excitation="the time for which slip work heats the contact",
            separations=(
                Separation(
                    "falling_friction",
                    "the same creep held for seconds and passed quickly: heating needs time",
                ),
            ),
        ),
        factor=lambda at, lags, loss, time: (
            1.0 / (1.0 + loss * _slip_work("contact_heating", at, time, lags))
        ),
    ),
)
"""The effects, in the order in which they act."""
