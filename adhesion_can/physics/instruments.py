"""Errors of the sensors and of the vehicle's data.

Sample formation, diagnosis and the simulated sensors share the same value.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from adhesion_can.physics.instrument_laws import InstrumentLaw, LoadShift, Need, Quantity
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
        laws: Errors that depend on the situation, beside the constant ones above.

    A delay below 0 is that of a signal that comes early, as the others come late.

    """

    radius_error: Mapping[int, float] = field(default_factory=lambda: _NONE)
    inertia_error: float = 0.0
    speed_error: float = 0.0
    speed_delay: float = 0.0
    effort_bias: float = 0.0
    effort_delay: float = 0.0
    wheel_speed_delay: float = 0.0
    laws: tuple[InstrumentLaw, ...] = ()

    def with_law(self, law: InstrumentLaw, size: float) -> "Instruments":
        """These instruments with a law in addition; unchanged where its size is 0."""
        return replace(self, laws=(*self.laws, law)) if size else self

    def needs(self, need: Need) -> bool:
        """Whether a law needs something of the situation."""
        return any(need in law.needs for law in self.laws)

    @property
    def misread_speed(self) -> bool:
        """Whether the vehicle speed has an error."""
        if self.speed_error or self.speed_delay:
            return True
        return any(law.quantity is Quantity.SPEED for law in self.laws)

    @property
    def load_shifts(self) -> tuple[LoadShift, ...]:
        """Laws by which loads move under effort."""
        return tuple(law for law in self.laws if isinstance(law, LoadShift))

    @property
    def law_covariates(self) -> tuple[str, ...]:
        """Names of the covariates on which laws depend, each once."""
        return tuple(dict.fromkeys(name for law in self.laws for name in law.covariates))

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
