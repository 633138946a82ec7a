"""The wheel speeds come late."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class WheelSpeedDelay:
    """ω measured at t is ω at t − delay; early where the delay is below 0."""

    id: str = "wheel_speed_delay"
    form: str = ""
    title: str = "the wheel speeds come late"
    parameters: tuple[Parameter, ...] = (
        Parameter("delay", "s", 0.1, -0.5, 0.5, "age of the wheel speeds at their stamps"),
    )
    literature: str = "Ljung, System Identification, 2nd ed. 1999, sec. 14.3"
    requires: Requirements = Requirements(speed=True)
    observability: Observability = Observability(
        channel="slip_rate",
        below="the wheel speeds come early: vehicle speed and effort are late",
        excitation="quick changes of creep at a changing speed",
        separations=(
            Separation(
                "effort_delay",
                "quick changes of the vehicle speed at a steady effort, as over a crest: only the "
                "wheel speeds' delay shows there",
                one_speed_signs=(-1, 1),
            ),
            Separation(
                "creep_relaxation",
                "the same creep sweep at a third and at three times the speed: a delay is "
                "constant in seconds, a relaxation length in metres",
                one_speed_signs=(-1,),
            ),
        ),
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        delay = instruments.wheel_speed_delay + values[0]
        return replace(instruments, wheel_speed_delay=delay)
