"""The vehicle speed is measured too high or too low by a share."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Observability, Requirements, Separation
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter

SPEED_SCALE = "speed_scale"


@dataclass(frozen=True, slots=True)
class SpeedScale:
    """Measured v = (1 + error) v."""

    id: str = SPEED_SCALE
    form: str = ""
    title: str = "the vehicle speed reads too high or too low by a percentage"
    parameters: tuple[Parameter, ...] = (
        Parameter("error", "1", 0.01, -0.05, 0.05, "share by which it reads high"),
    )
    literature: str = "Malvezzi et al., Proc. IMechE F 228 (2014), on odometry"
    requires: Requirements = Requirements()
    observability: Observability = Observability(
        channel="signed_slip",
        excitation="coasting at several speeds",
        separations=(
            Separation(
                "traction_braking_asymmetry",
                "coasting, and braking beyond the peak, where a small error of the slip has no "
                "effect",
            ),
        ),
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        return replace(instruments, speed_error=instruments.speed_error + values[0])
