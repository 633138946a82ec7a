"""Later axles find a rail that the ones in front have cleaned."""

from dataclasses import dataclass

from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
    Separation,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class RailCleaning:
    """Factor 1 + gain (k − 1) for the k-th axle in the direction of travel."""

    id: str = "rail_cleaning"
    form: str = ""
    title: str = "each axle runs on a rail cleaned by the axles in front"
    parameters: tuple[Parameter, ...] = (
        Parameter("gain", "1", 0.02, -0.1, 0.2, "share of adhesion gained from axle to axle"),
    )
    literature: str = "Voltr and Lata, Vehicle System Dynamics 53 (2015) 605-618"
    requires: Requirements = Requirements(several_axles=True)
    observability: Observability = Observability(
        channel="axle",
        excitation="which axle leads",
        separations=(
            Separation(
                "load_dependence",
                "a drive in reverse, where another axle leads but the loads are the same",
            ),
            Separation("wheel_radius", "a drive in reverse, and coasting of every axle"),
        ),
    )

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, 1.0 + values[0] * (contact.place - 1.0))
