"""Slip work heats the contact, and friction falls with its temperature.

It has the memory of `adhesion_recovery` and the opposite sign. The two are different mechanisms
with limits of their own: the sign of what slip work does names the one that prevails, and where
both act, the one with the shorter memory shows first.
"""

from dataclasses import dataclass

from adhesion_can.physics.effects.base import (
    Change,
    Contact,
    Observability,
    Requirements,
    Separation,
)
from adhesion_can.physics.effects.slip_work import follow_slip_work
from adhesion_can.physics.lag_states import LagStates
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class ContactHeating:
    """Factor 1/(1 + loss W), with dW/dt = |F v_s| − W/T: the slip work of the last T seconds.

    In 2 s heat enters about 5 mm of steel (√(a T), a = 1.2e-5 m²/s).
    """

    id: str = "contact_heating"
    form: str = ""
    title: str = "slip work heats the contact, and friction falls"
    parameters: tuple[Parameter, ...] = (
        Parameter("loss", "1/J", 1e-6, 0.0, 2e-5, "share of adhesion lost per slip work, at first"),
        Parameter(
            "time",
            "s",
            2.0,
            0.2,
            30.0,
            "time constant after which the contact has cooled",
            starts=(0.5, 2.0),
        ),
    )
    literature: str = "Ertz and Knothe, Wear 253 (2002) 498-508; Tomberger et al., Wear 271 (2011)"
    requires: Requirements = Requirements(speed=True)
    observability: Observability = Observability(
        channel="creep_speed",
        excitation="the time for which slip work heats the contact",
        separations=(
            Separation(
                "falling_friction",
                "the same creep held for seconds and passed quickly: heating needs time",
            ),
        ),
    )

    def change(self, contact: Contact, values: tuple[float, ...], lags: LagStates) -> Change:
        """Change of the contacts."""
        loss, time = values
        work = follow_slip_work(self.id, contact, time, lags)
        return Change(contact.slip, 1.0 / (1.0 + loss * work))
