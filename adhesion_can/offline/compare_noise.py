"""Noise of the sensors as a recording shows it, beside the configured one."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from adhesion_can.bus.roles import resolutions_by_role
from adhesion_can.config import Configuration
from adhesion_can.offline.load_traces import LoadedTraces
from adhesion_can.physics.readings import Role
from adhesion_can.sampling.noise import NoiseEstimate, estimate_noise

NOISY_ROLES = frozenset(
    {Role.WHEEL_SPEED, Role.VEHICLE_SPEED, Role.TRACTIVE_EFFORT, Role.SPEED_SOURCE}
)
"""Roles whose readings are needed."""
TOLERANCE = 2.0
"""Largest ratio of estimated and configured noise, either way, without a warning."""


@dataclass(frozen=True, slots=True)
class ComparedNoise:
    """Estimated and configured noise of one kind of sensor.

    Attributes:
        key: Key of `[sensors]`.
        name: Name of the sensor.
        unit: Unit of the standard deviations.
        estimate: Estimate from the readings, of all axles together.
        configured: Configured standard deviation.
        by_axle: Estimate of each axle by its number; empty for a sensor of the vehicle.

    """

    key: str
    name: str
    unit: str
    estimate: NoiseEstimate
    configured: float
    by_axle: Mapping[int, NoiseEstimate] = field(default_factory=dict)

    @property
    def warning(self) -> str:
        """Sentence that names the key to write; '' where both agree, or nothing is known."""
        noise = self.estimate
        if noise.std is None:
            return ""
        # Where the step of a signal hides its noise, the estimate is a bound.
        if noise.reason and noise.std <= TOLERANCE * self.configured:
            return ""
        if self.configured / TOLERANCE <= noise.std <= TOLERANCE * self.configured:
            return ""
        return (
            f"{self.name}: noise of {noise.std:.3g} {self.unit}, configured "
            f"{self.configured:.3g} {self.unit}: write {self.key} = {noise.std:.2g} under [sensors]"
        )

    def to_dict(self) -> dict[str, Any]:
        """Values as JSON has them."""
        return {
            **self.estimate.to_dict(),
            "unit": self.unit,
            "configured": self.configured,
            "by_axle": {str(axle): noise.std for axle, noise in self.by_axle.items()},
        }


def compare_noise(traces: LoadedTraces, config: Configuration) -> tuple[ComparedNoise, ...]:
    """Noise of those sensors that a recording has readings of.

    Args:
        traces: Readings of a recording, of `NOISY_ROLES` at least.
        config: Configured noise, and the messages with their resolutions.

    """
    given, sensors = {role for role, _ in traces.columns}, config.sensors
    estimated = estimate_noise(traces.traces(), resolutions_by_role(config.messages))
    compared = []
    if Role.WHEEL_SPEED in given:
        std, by_axle = sensors.wheel_speed_std, estimated.wheel_speed_by_axle
        names = ("wheel_speed_std", "wheel speed", "rad/s")
        compared.append(ComparedNoise(*names, estimated.wheel_speed, std, by_axle))
    if Role.VEHICLE_SPEED in given:
        names = ("vehicle_speed_std", "vehicle speed", "m/s")
        compared.append(ComparedNoise(*names, estimated.vehicle_speed, sensors.vehicle_speed_std))
    if Role.TRACTIVE_EFFORT in given:
        names = ("effort_std", "effort", "N")
        compared.append(
            ComparedNoise(*names, estimated.effort, sensors.effort_std, estimated.effort_by_axle)
        )
    return tuple(compared)
