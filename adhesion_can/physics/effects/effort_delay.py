"""The tractive effort comes late."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class EffortDelay:
    """F measured at t is F at t − delay; early where the delay is below 0."""

    id: str = "effort_delay"
    form: str = ""
    title: str = "the tractive effort comes late"
    parameters: tuple[Parameter, ...] = (
        Parameter("delay", "s", 0.05, -0.4, 0.5, "age of the effort at its stamp"),
    )
    literature: str = "Ljung, System Identification, 2nd ed. 1999, sec. 14.3"
    requires: Requirements = Requirements()
    observability: Observability = Observability(
        channel="slip_rate",
        below="the tractive effort comes early: wheel and vehicle speeds are late",
        excitation="quick changes of effort at a steady creep",
        separations=(
            Separation(
                "creep_relaxation",
                "the same creep sweep at a third and at three times the speed: a delay is "
                "constant in seconds, a relaxation length in metres",
                one_speed_signs=(1,),
            ),
        ),
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return replace(instruments, effort_delay=instruments.effort_delay + values[0])
