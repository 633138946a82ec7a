"""The locomotive's data: axles, wheels, loads and the transfer of load under effort."""

from dataclasses import dataclass, field
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.physics.burckhardt import Array

GRAVITY = 9.80665
"""Standard gravity, m/s²."""


@dataclass(frozen=True, slots=True)
class Geometry:
    """Heights and lengths that turn effort into transfer of axle load.

    Attributes:
        axles_per_bogie: front bogie first; their sum is the number of axles.
        pivot_distance: between the bogie pivots, m.
        axle_spacing: between neighbouring axles of one bogie, m.
        coupler_height: of the coupler above the rail, m.
        traction_height: of the link that pulls the body at the bogie, above the rail, m.

    """

    axles_per_bogie: tuple[int, ...] = (3, 3)
    pivot_distance: float = 10.3
    axle_spacing: float = 1.9
    coupler_height: float = 0.95
    traction_height: float = 0.46

    def __post_init__(self) -> None:
        if not self.axles_per_bogie or min(self.axles_per_bogie) < 1:
            raise ValueError("every bogie needs an axle")
        lengths = (self.pivot_distance, self.axle_spacing)
        heights = (self.coupler_height, self.traction_height)
        if not (all(isfinite(x) and x > 0 for x in lengths) and all(map(isfinite, heights))):
            raise ValueError("lengths of the geometry must be positive, heights finite")

    def load_transfer(self, effort: ArrayLike) -> Array:
        """Change of each axle's load under effort, N; sums to zero over the axles.

        Moments about the rail: the couple of coupler and traction link tilts the body and
        shifts load from the front bogie to the rear one; the effort at each bogie's link tilts
        the bogie and shifts load from its front axles to its rear ones, in proportion to their
        distance from the pivot (equal springs).

        Args:
            effort: effort at the rim of each axle, N, shape (..., axles), axle 1 in front.

        Returns:
            Change of load, shape (..., axles), N.

        """
        force = np.asarray(effort, dtype=np.float64)
        total = force.sum(axis=-1, keepdims=True)
        body = total * (self.coupler_height - self.traction_height) / self.pivot_distance
        parts = []
        first = 0
        for number, axles in enumerate(self.axles_per_bogie):
            bogie = force[..., first : first + axles].sum(axis=-1, keepdims=True)
            ahead = self.axle_spacing * ((axles - 1) / 2 - np.arange(axles))
            lean = ahead / max(float(ahead @ ahead), 1e-12)
            side = self._body_side(number)
            parts.append(-bogie * self.traction_height * lean - side * body / axles)
            first += axles
        return np.concatenate(parts, axis=-1)

    def _body_side(self, bogie: int) -> float:
        """+1 for the front bogie, −1 for the last one, evenly between; 0 for a single one."""
        last = len(self.axles_per_bogie) - 1
        return 1.0 - 2.0 * bogie / last if last else 0.0


@dataclass(frozen=True, slots=True)
class Locomotive:
    """A locomotive and its train; the defaults are a heavy Co-Co.

    Attributes:
        wheel_radius: of each axle, m.
        axle_load: static load of each axle, N.
        wheelset_inertia: of one wheelset with its motor, at the wheel, kg·m².
        train_mass: of locomotive and train, kg.
        geometry: for the transfer of load; None: no transfer is computed.
        load_std: relative standard deviation of a load that is not measured.

    """

    wheel_radius: tuple[float, ...] = (0.625,) * 6
    axle_load: tuple[float, ...] = (245e3,) * 6
    wheelset_inertia: float = 200.0
    train_mass: float = 1.65e6
    geometry: Geometry | None = field(default_factory=Geometry)
    load_std: float = 0.02

    def __post_init__(self) -> None:
        if len(self.wheel_radius) != len(self.axle_load) or not self.wheel_radius:
            raise ValueError(
                f"{len(self.wheel_radius)} wheel radii for {len(self.axle_load)} axle loads"
            )
        positive = (*self.wheel_radius, *self.axle_load, self.train_mass)
        if not all(isfinite(x) and x > 0 for x in positive):
            raise ValueError("wheel radii, axle loads and train mass must be positive")
        if not (isfinite(self.wheelset_inertia) and self.wheelset_inertia >= 0):
            raise ValueError("the wheelset's inertia must not be negative")
        if not (isfinite(self.load_std) and self.load_std >= 0):
            raise ValueError("load_std must not be negative")
        if self.geometry and sum(self.geometry.axles_per_bogie) != self.axles:
            raise ValueError(f"the bogies' axles do not add up to {self.axles}")

    @property
    def axles(self) -> int:
        """Number of axles."""
        return len(self.wheel_radius)

    def loads(self, effort: ArrayLike) -> Array:
        """Axle loads under effort (N, shape (..., axles)): static load and its transfer, N."""
        static = np.asarray(self.axle_load)
        if self.geometry is None:
            return np.broadcast_to(static, np.broadcast(static, effort).shape).copy()
        return np.asarray(static + self.geometry.load_transfer(effort))
