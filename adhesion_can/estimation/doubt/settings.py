"""Settings of the doubt, and what the instruments may be wrong by before anything is known."""

from dataclasses import dataclass, replace
from typing import Annotated

from adhesion_can.ranges import Within, require_ranges
from adhesion_can.values import Value


@dataclass(frozen=True, slots=True, kw_only=True)
class DoubtSettings(Value):
    """Tests of the residual against conditions that the model leaves out.

    Attributes:
        enabled: Whether the residual is tested; False: the doubt is 'not available', and standard
            deviations hold for a model without an error.
        false_alarm: Probability at which a direction of the residual is significant, in one test
            of it. Larger: doubts come earlier, and more often without a reason.
        least_size: Least size of a significant direction, as a share of the adhesion (root mean
            square over the drive). Larger: smaller errors of the model are left without a doubt.
        shape_std: Plausible deviation of a rail's curve from Burckhardt's form, as a share of the
            largest adhesion. It is part of the standard deviations until the data exclude it.
        first_lambda_m_std: Relative standard deviation of λ_m by the shape before the first
            comparison, 1. λ_m of Burckhardt curves fitted to computed contacts is 6 to 30 % off.

    """

    enabled: bool = True
    false_alarm: Annotated[float, Within(1e-15, 0.5)] = 1e-6
    least_size: Annotated[float, Within(0, 1)] = 0.003
    shape_std: Annotated[float, Within(0, 1)] = 0.03
    first_lambda_m_std: Annotated[float, Within(0, 10)] = 0.2

    def __post_init__(self) -> None:
        require_ranges(self)


HEAVY_LOAD = 245e3
"""Static load of a heavy locomotive's axle, N."""
EFFORT_BIAS_SHARE = 1000.0 / HEAVY_LOAD
"""Plausible bias of the efforts as a share of the static axle load, 1: 1 % of a rated effort of
0.41 times the load, the adhesion that drives are laid out for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class InstrumentUncertainty(Value):
    """Errors of the instruments that all axles share, before the data show them.

    They cannot be seen while the train only pulls: they are part of the standard deviations until
    coasting and braking have been driven. A calibrated vehicle states smaller ones; 0: none.

    Attributes:
        speed_error_std: Relative standard deviation of the vehicle speed's scale, 1. A radar over
            ground has 0.2 to 0.5 % (mounting angle), a worn reference wheel as much.
        effort_bias_std: Standard deviation of the efforts' common bias, N; None for 0.41 % of the
            mean static axle load (1000 N of 245 kN). The torque that an inverter computes from flux
            and current is off by about 1 % of its rated one, and a drive is rated for some 0.4 of
            its load at the rim.
        speed_wander_std: Relative standard deviation of an error of the vehicle speed that lasts
            for some 5 s and changes then, 1; 0: none. That of an observed speed is 0.002 or more.

    """

    speed_error_std: Annotated[float, Within(0, 1)] = 0.003
    effort_bias_std: Annotated[float | None, Within(0, 1e6)] = None
    speed_wander_std: Annotated[float, Within(0, 1)] = 0.0

    def __post_init__(self) -> None:
        require_ranges(self)

    def on_load(self, axle_load: float) -> "InstrumentUncertainty":
        """These errors, with the efforts' bias of a vehicle where none is stated.

        Args:
            axle_load: Mean static load of an axle, N.

        """
        if self.effort_bias_std is not None:
            return self
        return replace(self, effort_bias_std=EFFORT_BIAS_SHARE * axle_load)

    @property
    def used_bias_std(self) -> float:
        """Standard deviation of the efforts' common bias, N; a heavy locomotive's by default."""
        stated = self.effort_bias_std
        return EFFORT_BIAS_SHARE * HEAVY_LOAD if stated is None else stated


EXACT = InstrumentUncertainty(speed_error_std=0.0, effort_bias_std=0.0)
"""Instruments without common errors, or with errors that a model already corrects."""
