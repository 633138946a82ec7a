"""The vehicle speed comes late."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Parameter
from adhesion_can.physics.instruments import Instruments


@dataclass(frozen=True, slots=True)
class SpeedDelay:
    """v measured at t is v at t − delay."""

    id: str = "speed_delay"
    form: str = ""
    title: str = "the vehicle speed comes late"
    parameters: tuple[Parameter, ...] = (
        Parameter("delay", "s", 0.2, 0.0, 1.0, "age of the speed at its stamp"),
    )
    literature: str = "Ljung, System Identification, 2nd ed. 1999, sec. 14.3"
    needs: tuple[str, ...] = ()

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """See `InstrumentEffect.amend`."""
        return replace(instruments, speed_delay=instruments.speed_delay + values[0])
