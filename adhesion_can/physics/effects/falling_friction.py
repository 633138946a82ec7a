"""Adhesion falls with creep speed: Burckhardt's c4."""

from dataclasses import dataclass

from adhesion_can.physics.burckhardt import Array, falling_factor
from adhesion_can.physics.effects.base import Contact, Parameter


@dataclass(frozen=True, slots=True)
class FallingFriction:
    """Factor e^(−c4 |λ V|): the rubbed film warms up and carries less."""

    id: str = "falling_friction"
    parameters: tuple[Parameter, ...] = (
        Parameter("c4", "s/m", 0.1, 0.0, 2.0, "fall of adhesion per m/s of creep, for small creep"),
    )
    literature: str = "Burckhardt 1993, eq. 4 of He et al. 2018; Polach, Wear 258 (2005)"

    def apply(self, adhesion: Array, contact: Contact, values: tuple[float, ...]) -> Array:
        """See `Effect.apply`."""
        return adhesion * falling_factor(contact.creep_speed, values[0])
