"""One axle's wheels have another radius than the configured one."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Observability, Requirements
from adhesion_can.physics.instruments import Instruments
from adhesion_can.physics.parameter import Parameter


@dataclass(frozen=True, slots=True)
class WheelRadius:
    """True radius = configured radius · (1 + error), at one axle."""

    id: str = "wheel_radius"
    form: str = ""
    title: str = "the wheel radius of one axle differs from the configured one"
    parameters: tuple[Parameter, ...] = (
        Parameter("error", "1", 0.01, -0.05, 0.05, "share by which its wheels are larger"),
        Parameter("axle", "1", 1.0, 1.0, 999.0, "number of the axle", axle=True),
    )
    literature: str = "Malvezzi et al., Proc. IMechE F 228 (2014), on odometry"
    requires: Requirements = Requirements(several_axles=True)
    observability: Observability = Observability(
        channel="axle", excitation="coasting of the axle together with others"
    )

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """Instruments with this error in addition."""
        error, axle = values[0], round(values[1])
        before = instruments.radius_error.get(axle, 0.0)
        return replace(instruments, radius_error={**instruments.radius_error, axle: before + error})
