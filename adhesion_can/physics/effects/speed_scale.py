"""The vehicle speed is measured too high or too low by a share."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Parameter
from adhesion_can.physics.instruments import Instruments


@dataclass(frozen=True, slots=True)
class SpeedScale:
    """Measured v = (1 + error) v."""

    id: str = "speed_scale"
    form: str = ""
    title: str = "the vehicle speed is measured too high or too low by a share"
    parameters: tuple[Parameter, ...] = (
        Parameter("error", "1", 0.01, -0.05, 0.05, "share by which it reads high"),
    )
    literature: str = "Malvezzi et al., Proc. IMechE F 228 (2014), on odometry"
    needs: tuple[str, ...] = ()

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """See `InstrumentEffect.amend`."""
        return replace(instruments, speed_error=instruments.speed_error + values[0])
