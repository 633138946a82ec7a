"""Adhesion at the same slip falls with vehicle speed: Curtius and Kniffler's curve."""

from dataclasses import dataclass

from adhesion_can.arrays import Array
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
    Separation,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter, Wheelset

LARGEST_RISE = 0.25
"""Largest share that is allowed for the other way round, for errors of the estimate."""


def curtius_kniffler(speed: Array) -> Array:
    """Adhesion over that at standstill, 7.5/(V + 44) + 0.161 with V in km/h, of a speed in m/s."""
    return (7.5 / (3.6 * speed + 44.0) + 0.161) / (7.5 / 44.0 + 0.161)


def _plausible(_wheelset: Wheelset) -> tuple[float, float]:
    """No measurement in the literature has adhesion rise with the speed at the same slip."""
    return -LARGEST_RISE, 3.0


@dataclass(frozen=True, slots=True)
class SpeedDependence:
    """Factor 1 + share (f(v) − 1), f by Curtius and Kniffler."""

    id: str = "speed_dependence"
    form: str = ""
    title: str = "adhesion at the same slip falls with vehicle speed"
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "share",
            "1",
            1.0,
            -1.0,
            3.0,
            "fall with speed; 1 is Curtius and Kniffler's",
            plausible=_plausible,
        ),
    )
    literature: str = "Curtius and Kniffler, Elektrische Bahnen 21 (1950) 201-210"
    requires: Requirements = Requirements(speed=True)
    observability: Observability = Observability(
        channel="speed",
        excitation="the speed",
        separations=(
            Separation(
                "falling_friction",
                "creep swept beyond the peak at low and at high speed: one effect falls with "
                "speed at the same slip, the other with creep speed only",
            ),
        ),
    )

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, 1.0 + values[0] * (curtius_kniffler(contact.speed) - 1.0))
