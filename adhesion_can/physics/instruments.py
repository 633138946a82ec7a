"""Errors of the sensors and of the vehicle's data.

Sample formation, diagnosis and the simulated sensors share the same value.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from adhesion_can.physics.vehicle import Locomotive

_NONE: Mapping[int, float] = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Instruments:
    """Errors of the sensors and of the vehicle's data; the default has none.

    Attributes:
        radius_error: Relative error of the wheel radius by number of the axle, from 1: true radius
            = configured radius · (1 + error).
        inertia_error: True less configured inertia of a wheelset, kg·m².
        speed_error: Relative error of the vehicle speed: measured = (1 + error) · true.
        speed_delay: Age of a measured vehicle speed at its stamp, s.
        effort_bias: Measured less true effort of every axle, N.
        effort_delay: Age of a measured effort at its stamp, s.
        wheel_speed_delay: Age of the measured wheel speeds at their stamps, s.

    A delay below 0 is that of a signal that comes early, as the others come late.

    """

    radius_error: Mapping[int, float] = field(default_factory=lambda: _NONE)
    inertia_error: float = 0.0
    speed_error: float = 0.0
    speed_delay: float = 0.0
    effort_bias: float = 0.0
    effort_delay: float = 0.0
    wheel_speed_delay: float = 0.0

    @property
    def speed_lag(self) -> float:
        """Age of the vehicle speed over that of the wheel speeds, s."""
        return self.speed_delay - self.wheel_speed_delay

    @property
    def effort_lag(self) -> float:
        """Age of the effort over that of the wheel speeds, s."""
        return self.effort_delay - self.wheel_speed_delay

    def vehicle(self, configured: Locomotive) -> Locomotive:
        """The vehicle as it really is: radii and inertia amended."""
        radii = tuple(
            radius * (1.0 + self.radius_error.get(axle, 0.0))
            for axle, radius in enumerate(configured.wheel_radius, start=1)
        )
        inertia = max(configured.wheelset_inertia + self.inertia_error, 0.0)
        return replace(configured, wheel_radius=radii, wheelset_inertia=inertia)

    def radius_factor(self, axles: int) -> np.ndarray:
        """True over configured radius of axles 1.., shape (axles,)."""
        return np.array([1.0 + self.radius_error.get(i + 1, 0.0) for i in range(axles)])


PERFECT = Instruments()
"""Sensors and data without an error."""
