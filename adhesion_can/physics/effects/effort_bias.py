"""The tractive effort has a zero error."""

from dataclasses import dataclass, replace

from adhesion_can.physics.effects.base import Parameter
from adhesion_can.physics.instruments import Instruments


@dataclass(frozen=True, slots=True)
class EffortBias:
    """F measured = F + bias at every axle."""

    id: str = "effort_bias"
    form: str = ""
    title: str = "the tractive effort has a zero error"
    parameters: tuple[Parameter, ...] = (
        Parameter("bias", "N", 3000.0, -50e3, 50e3, "by how much it reads high"),
    )
    literature: str = "Kiencke and Nielsen, Automotive Control Systems, 2nd ed. 2005"
    needs: tuple[str, ...] = ()

    def amend(self, instruments: Instruments, values: tuple[float, ...]) -> Instruments:
        """See `InstrumentEffect.amend`."""
        return replace(instruments, effort_bias=instruments.effort_bias + values[0])
