"""The tractive effort has a zero error."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter, Wheelset

LARGEST_SHARE = 0.1
"""Largest bias as a share of the load: an inverter's torque is off by a few per cent of the rated
one, which is worth a third of the load (see `estimation/doubt/settings.py`)."""


def _plausible(wheelset: Wheelset) -> tuple[float, float]:
    largest = LARGEST_SHARE * wheelset.load
    return -largest, largest


@dataclass(frozen=True, slots=True)
class EffortBias:
    """F measured = F + bias at every axle."""

    id: str = "effort_bias"
    form: str = ""
    title: str = "the tractive effort has a zero error"
    parameters: tuple[Parameter, ...] = (
        Parameter(
            "bias", "N", 3000.0, -50e3, 50e3, "by how much it reads high", plausible=_plausible
        ),
    )
    literature: str = "Kiencke and Nielsen, Automotive Control Systems, 2nd ed. 2005"
    requires: Requirements = Requirements()
    observability: Observability = Observability(
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
                "coasting at several speeds: a bias is a force, a scale error a share of the speed",
            ),
        ),
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return replace(instruments, effort_bias=instruments.effort_bias + values[0])
