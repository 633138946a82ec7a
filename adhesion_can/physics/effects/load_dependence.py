"""Adhesion changes with wheelset load: Burckhardt's c5, and a power law."""

from dataclasses import dataclass

from adhesion_can.physics.burckhardt import load_factor
from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
)
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter

LOAD_DEPENDENCE, _TITLE = "load_dependence", "adhesion changes with wheel load"
_REQUIRES = Requirements(load=True)
_OBSERVABILITY = Observability(channel="axle_load", excitation="the axle load")
REFERENCE = 100e3
"""Load at which the power law changes nothing, N."""


@dataclass(frozen=True, slots=True)
class LoadDependence:
    """Factor 1 − c5 F_Z²."""

    id: str = LOAD_DEPENDENCE
    form: str = "burckhardt"
    title: str = _TITLE
    parameters: tuple[Parameter, ...] = (
        # 4e-12 takes a quarter off at 245 kN. The bound is for road tyres' loads of a few kN.
        Parameter("c5", "1/N^2", 4e-12, 0.0, 1e-6, "share of adhesion lost per squared load"),
    )
    literature: str = "Burckhardt 1993, eq. 4 of He et al. 2018"
    requires: Requirements = _REQUIRES
    observability: Observability = _OBSERVABILITY

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, load_factor(contact.load, values[0]))


@dataclass(frozen=True, slots=True)
class LoadPower:
    """Factor (N / 100 kN)^(−p): Hertzian contact has p = 1/3 at constant friction of its area."""

    id: str = LOAD_DEPENDENCE
    form: str = "power"
    title: str = _TITLE
    parameters: tuple[Parameter, ...] = (
        Parameter("exponent", "1", 0.5, -3.0, 3.0, "adhesion falls with this power of the load"),
    )
    literature: str = "Popov, Contact Mechanics and Friction, 2nd ed. 2017, on the load's power law"
    requires: Requirements = _REQUIRES
    observability: Observability = _OBSERVABILITY

    def change(self, contact: Contact, values: tuple[float, ...], _lags: LagStates) -> Change:
        """Change of the contacts."""
        return Change(contact.slip, (contact.load / REFERENCE) ** -values[0])
