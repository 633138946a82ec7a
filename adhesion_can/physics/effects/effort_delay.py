"""The tractive effort comes late."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Parameter
from adhesion_can.physics.instruments import Instruments


@dataclass(frozen=True, slots=True)
class EffortDelay:
    """F measured at t is F at t − delay."""

    id: str = "effort_delay"
    form: str = ""
    title: str = "the tractive effort comes late"
    parameters: tuple[Parameter, ...] = (
        Parameter("delay", "s", 0.05, 0.0, 0.5, "age of the effort at its stamp"),
    )
    literature: str = "Ljung, System Identification, 2nd ed. 1999, sec. 14.3"
    needs: tuple[str, ...] = ()

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """See `InstrumentEffect.amend`."""
        return replace(instruments, effort_delay=instruments.effort_delay + values[0])
