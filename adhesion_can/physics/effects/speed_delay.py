"""The vehicle speed comes late."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Observability, Requirements
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class SpeedDelay:
    """v measured at t is v at t − delay; early where the delay is below 0."""

    id: str = "speed_delay"
    form: str = ""
    title: str = "the vehicle speed comes late"
    parameters: tuple[Parameter, ...] = (
        Parameter("delay", "s", 0.2, -0.5, 1.0, "age of the speed at its stamp"),
    )
    literature: str = "Ljung, System Identification, 2nd ed. 1999, sec. 14.3"
    requires: Requirements = Requirements(speed=True)
    observability: Observability = Observability(
        channel="slip_rate",
        below="the vehicle speed comes early: wheel speeds and effort are late",
        excitation="acceleration of the vehicle",
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return replace(instruments, speed_delay=instruments.speed_delay + values[0])
