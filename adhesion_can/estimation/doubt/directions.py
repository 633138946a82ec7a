"""Directions in which the residual may lie: what each adds to the adhesion, linear in its size.

Two kinds of them. Errors of the instruments move the slip or the effort, whatever the rail. What
the adhesion depends on multiplies the curve. Sizes are in units in which 1 is large, named with
each direction.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.readings import Role
from adhesion_can.values import Value

# What the library has as an effect is called by its id.
SPEED_SCALE, EFFORT_BIAS = "speed_scale", "effort_bias"
SPEED_DELAY, EFFORT_DELAY = "speed_delay", "effort_delay"
INERTIA, RELAXATION = "wheelset_inertia", "creep_relaxation"
LOAD, SPEED, CREEP_SPEED, TRACTION = (
    "load_dependence",
    "speed_dependence",
    "falling_friction",
    "traction_braking_asymmetry",
)
TIME = "slow_drift"
RADIUS, LEVEL = "wheel_radius", "axle_level"
BIAS_UNIT = 1e3
"""Unit of the effort's bias, N."""
INERTIA_UNIT = 1e4
"""Unit of the inertia over the radius, kg·m."""
WORK_S: Mapping[str, float] = {"slip work, 1.5 s": 1.5, "slip work, 8 s": 8.0}
"""Time constant by which the slip work of an axle is forgotten, s, by direction."""
SPEED_UNIT = 10.0
"""Unit of the vehicle speed, m/s."""
LOAD_UNIT = 2e5
"""Load at which the logarithm of the load is 0, N."""
TIME_UNIT = 100.0
"""Unit of the time since the surface changed, s."""


@dataclass(frozen=True, slots=True)
class ResidualDirection(Value):
    """Direction in which the residual may lie.

    Attributes:
        name: Name of the direction, unique.
        doubt: Condition that it means.
        prior_std: Plausible size, for a prior that is hardly informative.
        group: Directions that are estimated together with this one, by the name of their group.

    """

    name: str
    doubt: Doubt
    prior_std: float
    group: str


@dataclass(frozen=True, slots=True)
class CovariateScale:
    """Scale of a covariate: value = (covariate − shift)/unit.

    Attributes:
        shift: Covariate at which the value is 0.
        unit: Change of the covariate by which the value rises by 1.
        absolute: Whether its sign is ignored.

    """

    shift: float
    unit: float
    absolute: bool = False


SURROUNDINGS: Mapping[str, CovariateScale] = {
    COVARIATES[Role.SANDING]: CovariateScale(0.0, 1.0),
    COVARIATES[Role.HUMIDITY]: CovariateScale(60.0, 30.0),
    COVARIATES[Role.RAIL_TEMPERATURE]: CovariateScale(20.0, 10.0),
    COVARIATES[Role.CURVATURE]: CovariateScale(0.0, 1e-3, absolute=True),
}
"""Covariates of the samples that are directions of their own, by name."""


def build_directions(axles: int) -> tuple[ResidualDirection, ...]:
    """Directions for a vehicle with so many axles."""

    def single(name: str, doubt: Doubt, prior_std: float) -> ResidualDirection:
        return ResidualDirection(name, doubt, prior_std, name)

    return (
        single(SPEED_SCALE, Doubt.DIRECTION, 0.02),
        single(EFFORT_BIAS, Doubt.DIRECTION, 20.0),
        single(SPEED_DELAY, Doubt.RATE_OF_SLIP, 0.5),
        single(EFFORT_DELAY, Doubt.RATE_OF_SLIP, 0.3),
        single(INERTIA, Doubt.RATE_OF_SLIP, 1.0),
        single(RELAXATION, Doubt.RATE_OF_SLIP, 5.0),
        single(LOAD, Doubt.AXLE_LOAD, 4.0),
        single(SPEED, Doubt.SPEED, 0.5),
        single(CREEP_SPEED, Doubt.SPEED, 2.0),
        single(TRACTION, Doubt.DIRECTION, 0.3),
        single(TIME, Doubt.TIME, 0.3),
        *(single(name, Doubt.TIME, 0.5) for name in WORK_S),
        *(single(name, Doubt.SURROUNDINGS, 0.3) for name in SURROUNDINGS),
        *(
            ResidualDirection(f"{name} {axle}", Doubt.AXLE, prior_std, name)
            for name, prior_std in ((RADIUS, 0.02), (LEVEL, 0.3))
            for axle in range(1, axles + 1)
        ),
    )
