"""The wheelset's inertia is not the configured one."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Observability, Requirements
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter, Wheelset
from adhesion_can.physics.vehicle import GRAVITY

ROTATING_SHARE = 0.4
"""Largest share of a wheelset's load whose mass turns with it, as J / r² of the mass. Of a
locomotive with geared motors it is 0.15 to 0.3 (Wende, Fahrdynamik des Schienenverkehrs, 2003)."""


def _plausible(wheelset: Wheelset) -> tuple[float, float]:
    """Errors with which the true inertia is neither below 0 nor beyond `ROTATING_SHARE`."""
    largest = ROTATING_SHARE * wheelset.load / GRAVITY * wheelset.radius**2
    return -wheelset.inertia, largest - wheelset.inertia


@dataclass(frozen=True, slots=True)
class WheelsetInertia:
    """J = configured J + error: what accelerates the wheelset does not reach the rail."""

    id: str = "wheelset_inertia"
    form: str = ""
    title: str = "the wheelset's inertia differs from the configured one"
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "error",
            "kg m^2",
            400.0,
            -2000.0,
            5000.0,
            "true minus configured inertia",
            plausible=_plausible,
        ),
    )
    literature: str = "Eq. 3 of He et al. 2018"
    requires: Requirements = Requirements(wheel_speed=True)
    observability: Observability = Observability(
        channel="slip_rate", excitation="the acceleration of spinning wheels"
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return replace(instruments, inertia_error=instruments.inertia_error + values[0])
