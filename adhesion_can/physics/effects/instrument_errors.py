"""Errors of the instruments and of the vehicle's data that are one number each.

Each effect is a row of `INSTRUMENT_ERRORS` with its formula. Errors that depend on the situation
are laws, in files of their own.
"""

from dataclasses import replace

from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.effects.rows import ErrorEffect
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter, Wheelset
from adhesion_can.physics.vehicle import GRAVITY

WHEEL_RADIUS, SPEED_SCALE = "wheel_radius", "speed_scale"
"""Ids of effects that others ask for."""
ROTATING_SHARE = 0.4
"""Largest share of a wheelset's load whose mass turns with it, as J / r² of the mass. Of a
locomotive with geared motors it is 0.15 to 0.3 (Wende, Fahrdynamik des Schienenverkehrs, 2003)."""
LARGEST_BIAS = 0.1
"""Largest bias of the effort as a share of the load: an inverter's torque is off by a few per cent
of the rated one, which is worth a third of the load (see `estimation/doubt/settings.py`)."""

_LJUNG = "Ljung, System Identification, 2nd ed. 1999, sec. 14.3"
_ODOMETRY = "Malvezzi et al., Proc. IMechE F 228 (2014), on odometry"
_SWEEPS = (
    "the same creep sweep at a third and at three times the speed: a delay is constant in seconds, "
    "a relaxation length in metres"
)


def _plausible_inertia(wheelset: Wheelset) -> tuple[float, float]:
    """Errors with which the true inertia is neither below 0 nor beyond `ROTATING_SHARE`."""
    largest = ROTATING_SHARE * wheelset.load / GRAVITY * wheelset.radius**2
    return -wheelset.inertia, largest - wheelset.inertia


def _plausible_bias(wheelset: Wheelset) -> tuple[float, float]:
    largest = LARGEST_BIAS * wheelset.load
    return -largest, largest


def _add_radius_error(given: Instruments, error: float, number: float) -> Instruments:
    """True radius = configured radius · (1 + error), at one axle."""
    axle = round(number)
    before = given.radius_error.get(axle, 0.0)
    return replace(given, radius_error={**given.radius_error, axle: before + error})


INSTRUMENT_ERRORS: tuple[ErrorEffect, ...] = (
    # J = configured J + error: what accelerates the wheelset does not reach the rail.
    ErrorEffect(
        id="wheelset_inertia",
        title="the wheelset's inertia differs from the configured one",
        parameters=(
            Parameter(
                "error",
                "kg m^2",
                400.0,
                -2000.0,
                5000.0,
                "true minus configured inertia",
                plausible=_plausible_inertia,
            ),
        ),
        literature="Eq. 3 of He et al. 2018",
        requires=Requirements(wheel_speed=True),
        observability=Observability(
            channel="slip_rate", excitation="the acceleration of spinning wheels"
        ),
        add=lambda given, error: replace(given, inertia_error=given.inertia_error + error),
    ),
    ErrorEffect(
        id=WHEEL_RADIUS,
        title="the wheel radius of one axle differs from the configured one",
        parameters=(
            Parameter("error", "1", 0.01, -0.05, 0.05, "share by which its wheels are larger"),
            Parameter("axle", "1", 1.0, 1.0, 999.0, "number of the axle", axle=True),
        ),
        literature=_ODOMETRY,
        requires=Requirements(several_axles=True),
        observability=Observability(
            channel="axle", excitation="coasting of the axle together with others"
        ),
        add=_add_radius_error,
    ),
    # v measured = (1 + error) v.
    ErrorEffect(
        id=SPEED_SCALE,
        title="the vehicle speed reads too high or too low by a percentage",
        parameters=(Parameter("error", "1", 0.01, -0.05, 0.05, "share by which it reads high"),),
        literature=_ODOMETRY,
        observability=Observability(
            channel="signed_slip",
            excitation="coasting at several speeds",
            separations=(
                Separation(
                    "traction_braking_asymmetry",
                    "coasting, and braking beyond the peak, where a small error of the slip has no "
                    "effect",
                ),
            ),
        ),
        add=lambda given, error: replace(given, speed_error=given.speed_error + error),
    ),
    # What is measured at t is the value at t − delay; early where the delay is below 0.
    ErrorEffect(
        id="speed_delay",
        title="the vehicle speed comes late",
        parameters=(Parameter("delay", "s", 0.2, -0.5, 1.0, "age of the speed at its stamp"),),
        literature=_LJUNG,
        requires=Requirements(speed=True),
        observability=Observability(
            channel="slip_rate",
            below="the vehicle speed comes early: wheel speeds and effort are late",
            excitation="acceleration of the vehicle",
        ),
        add=lambda given, delay: replace(given, speed_delay=given.speed_delay + delay),
    ),
    ErrorEffect(
        id="effort_delay",
        title="the tractive effort comes late",
        parameters=(Parameter("delay", "s", 0.05, -0.4, 0.5, "age of the effort at its stamp"),),
        literature=_LJUNG,
        observability=Observability(
            channel="slip_rate",
            below="the tractive effort comes early: wheel and vehicle speeds are late",
            excitation="quick changes of effort at a steady creep",
            separations=(Separation("creep_relaxation", _SWEEPS, one_speed_signs=(1,)),),
        ),
        add=lambda given, delay: replace(given, effort_delay=given.effort_delay + delay),
    ),
    ErrorEffect(
        id="wheel_speed_delay",
        title="the wheel speeds come late",
        parameters=(
            Parameter("delay", "s", 0.1, -0.5, 0.5, "age of the wheel speeds at their stamps"),
        ),
        literature=_LJUNG,
        requires=Requirements(speed=True),
        observability=Observability(
            channel="slip_rate",
            below="the wheel speeds come early: vehicle speed and effort are late",
            excitation="quick changes of creep at a changing speed",
            separations=(
                Separation(
                    "effort_delay",
                    "quick changes of the vehicle speed at a steady effort, as over a crest: only "
                    "the wheel speeds' delay shows there",
                    one_speed_signs=(-1, 1),
                ),
                Separation("creep_relaxation", _SWEEPS, one_speed_signs=(-1,)),
            ),
        ),
        add=lambda given, delay: replace(given, wheel_speed_delay=given.wheel_speed_delay + delay),
    ),
    # F measured = F + bias at every axle.
    ErrorEffect(
        id="effort_bias",
        title="the tractive effort has a zero error",
        parameters=(
            Parameter(
                "bias",
                "N",
                3000.0,
                -50e3,
                50e3,
                "by how much it reads high",
                plausible=_plausible_bias,
            ),
        ),
        literature="Kiencke and Nielsen, Automotive Control Systems, 2nd ed. 2005",
        observability=Observability(
            channel="signed_slip",
            excitation="coasting and braking",
            separations=(
                Separation(
                    "traction_braking_asymmetry",
                    "coasting, where a bias remains and an asymmetry has no effect; braking and "
                    "traction at small and at large creep",
                ),
                Separation(
                    "speed_scale",
                    "coasting at several speeds: a bias is a force, a scale error a share of the "
                    "speed",
                ),
            ),
        ),
        add=lambda given, bias: replace(given, effort_bias=given.effort_bias + bias),
    ),
)
"""The effects, in the order in which they act."""
