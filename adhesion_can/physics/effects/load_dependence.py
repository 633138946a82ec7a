"""Adhesion falls with wheelset load: Burckhardt's c5."""

from dataclasses import dataclass

from adhesion_can.physics.burckhardt import Array, load_factor
from adhesion_can.physics.effects.base import Contact, Parameter


@dataclass(frozen=True, slots=True)
class LoadDependence:
    """Factor 1 − c5 F_Z²."""

    id: str = "load_dependence"
    parameters: tuple[Parameter, ...] = (
        # 2e-12 takes 12 % off at 245 kN.
        Parameter("c5", "1/N^2", 2e-12, 0.0, 1.5e-11, "share of adhesion lost per squared load"),
    )
    literature: str = "Burckhardt 1993, eq. 4 of He et al. 2018"

    def apply(self, adhesion: Array, contact: Contact, values: tuple[float, ...]) -> Array:
        """See `Effect.apply`."""
        return adhesion * load_factor(contact.load, values[0])
