"""Slip work cleans the contact: adhesion recovers at an axle that has slipped."""

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
class AdhesionRecovery:
    """Factor 1 + gain W, with dW/dt = |F v_s| − W/T: the slip work of the last T seconds."""

    id: str = "adhesion_recovery"
    form: str = ""
    title: str = "slip work cleans the contact, and adhesion recovers"
    parameters: tuple[Parameter, ...] = (
        Parameter("gain", "1/J", 4e-7, 0.0, 1e-5, "share of adhesion gained per slip work"),
        Parameter("time", "s", 3.0, 0.3, 30.0, "time constant after which it is lost again"),
    )
    literature: str = "Meierhofer et al., Proc. IMechE F 228 (2014); Voltr and Lata 2015"
    requires: Requirements = Requirements(speed=True)
    observability: Observability = Observability(
        channel="slip",
        excitation="the time for which a creep is held",
        separations=(
            Separation(
                "falling_friction",
                "the same creep held for seconds and passed quickly: recovery needs time",
            ),
        ),
    )

    def change(self, contact: Contact, values: tuple[float, ...], lags: LagStates) -> Change:
        """Change of the contacts."""
        gain, time = values
        work = follow_slip_work(self.id, contact, time, lags)
        return Change(contact.slip, 1.0 + gain * work)
