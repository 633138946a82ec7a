"""The locomotive's data: axles, wheels, loads and the transfer of load under effort."""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise
from statistics import fmean
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from adhesion_can.arrays import Array
from adhesion_can.ranges import Length, Within, require_ranges

MOST_AXLES = 64
"""Largest number of axles of a vehicle here; several coupled ones are several services."""
GRAVITY = 9.80665
"""Standard gravity, m/s²."""


@dataclass(frozen=True, slots=True)
class Geometry:
    """Heights and lengths that turn effort into transfer of axle load.

    Attributes:
        axles_per_bogie: Number of axles of each bogie, the front one first.
        pivot_distance: Distance between the bogie pivots, m.
        axle_spacing: Distance between neighbouring axles of one bogie, m.
        coupler_height: Height of the coupler above the rail, m.
        traction_height: Height above the rail of the link that pulls the body at the bogie, m.

    """

    axles_per_bogie: Annotated[tuple[int, ...], Within(1, MOST_AXLES), Length(1, MOST_AXLES)] = (
        3,
        3,
    )
    pivot_distance: Annotated[float, Within(0.01, 1000)] = 10.3
    axle_spacing: Annotated[float, Within(0.01, 1000)] = 1.9
    coupler_height: Annotated[float, Within(-10, 100)] = 0.95
    traction_height: Annotated[float, Within(-10, 100)] = 0.46

    def __post_init__(self) -> None:
        require_ranges(self)
        if self.axles_per_bogie == (1,):
            raise ValueError("a single axle cannot take the moment of its effort")

    @property
    def axle_places(self) -> Array:
        """Distance of each axle behind the first one, m, shape (axles,)."""
        places: list[float] = []
        for number, axles in enumerate(self.axles_per_bogie):
            middle = number * self.pivot_distance
            places += list(middle - self.axle_spacing * _centred(axles))
        return np.array(places) - places[0]

    def load_transfer(self, effort: ArrayLike) -> Array:
        """Change of each axle's load under effort, N; sums to zero over the axles.

        Moments about the rail: the coupler pulls back with the whole effort at its height. Each
        bogie of two axles and more takes the moment of its own effort at the traction link, its
        front axles losing what its rear ones gain, in proportion to their distance from the pivot
        (equal springs). What is left tilts the body, which shifts load between the bogies by the
        same rule. A single frame takes all of it.

        Args:
            effort: Effort at the rim of each axle, N, axle 1 in front; shape (..., axles).

        Returns:
            Change of the axle loads, N; shape (..., axles).

        """
        force = np.asarray(effort, dtype=np.float64)
        bounds = np.cumsum((0, *self.axles_per_bogie))
        bogies = [force[..., a:b].sum(axis=-1, keepdims=True) for a, b in pairwise(bounds)]
        whole = np.sum(bogies, axis=0) * self.coupler_height
        single = len(bogies) == 1
        moments = [
            (whole if single else pull * self.traction_height) if axles > 1 else 0.0 * pull
            for pull, axles in zip(bogies, self.axles_per_bogie, strict=True)
        ]
        body = whole - np.sum(moments, axis=0)
        places = self.pivot_distance * _centred(len(bogies))
        reach = max(float(places @ places), 1e-12)
        parts = []
        for place, moment, axles in zip(places, moments, self.axles_per_bogie, strict=True):
            ahead = self.axle_spacing * _centred(axles)
            lean = ahead / max(float(ahead @ ahead), 1e-12)
            parts.append(-moment * lean - body * (place / reach / axles))
        return np.concatenate(parts, axis=-1)


def _centred(count: int) -> Array:
    """Places of `count` points a unit apart around their middle, the front one first."""
    return np.asarray((count - 1) / 2 - np.arange(count))


DEFAULT_LOAD = 245e3
"""Static load of an axle of the default locomotive, N."""


@dataclass(frozen=True, slots=True)
class Locomotive:
    """A locomotive and its train; the defaults are a heavy Co-Co.

    Attributes:
        wheel_radius: Wheel radius of each axle, m.
        axle_load: Static load of each axle, N.
        wheelset_inertia: Inertia of one wheelset with its motor, at the wheel, kg·m².
        train_mass: Mass of locomotive and train, kg.
        geometry: Geometry for the transfer of load; None: no transfer is computed.
        load_std: Relative standard deviation of a load that is not measured.

    """

    wheel_radius: Annotated[tuple[float, ...], Within(0.01, 10), Length(1, MOST_AXLES)] = (
        0.625,
    ) * 6
    axle_load: Annotated[tuple[float, ...], Within(1, 1e7), Length(1, MOST_AXLES)] = (
        DEFAULT_LOAD,
    ) * 6
    wheelset_inertia: Annotated[float, Within(0, 1e6)] = 200.0
    train_mass: Annotated[float, Within(1, 1e12)] = 1.65e6
    geometry: Geometry | None = field(default_factory=Geometry)
    load_std: Annotated[float, Within(0, 1)] = 0.02

    def __post_init__(self) -> None:
        require_ranges(self)
        if len(self.wheel_radius) != len(self.axle_load):
            raise ValueError(
                f"{len(self.wheel_radius)} wheel radii for {len(self.axle_load)} axle loads"
            )
        if self.geometry and sum(self.geometry.axles_per_bogie) != self.axles:
            raise ValueError(f"the bogies' axles do not add up to {self.axles}")

    @property
    def axles(self) -> int:
        """Number of axles."""
        return len(self.wheel_radius)

    @property
    def relative_load(self) -> float:
        """Mean static load of an axle over that of the default locomotive, 1.

        Noise of efforts and loads is in proportion to it: an inverter's estimate of the torque is
        specified in percent of the rated one, and motors are laid out for the load.
        """
        return fmean(self.axle_load) / DEFAULT_LOAD

    def transfer_shares(self, traction: float = 1.0) -> Array:
        """Load that each axle gains for each axle's effort, 1, shape (axles, axles).

        By the configured geometry; without one by that of a usual vehicle with as many axles.

        Args:
            traction: Height of the link that pulls the body, relative to that of the geometry.

        """
        geometry = self.geometry or Geometry(_BOGIES.get(self.axles, (self.axles,)))
        return _transfer_shares(geometry, traction)

    def loads(self, effort: ArrayLike) -> Array:
        """Axle loads under effort (N, shape (..., axles)): static load and its transfer, N."""
        static = np.asarray(self.axle_load)
        if self.geometry is None:
            return np.broadcast_to(static, np.broadcast(static, effort).shape).copy()
        return np.asarray(static + self.geometry.load_transfer(effort))


_BOGIES: dict[int, tuple[int, ...]] = {4: (2, 2), 6: (3, 3), 8: (2, 2, 2, 2), 12: (3, 3, 3, 3)}
"""Axles of each bogie of a usual vehicle by its number of axles; of others in one frame."""


@lru_cache(maxsize=32)
def _transfer_shares(geometry: Geometry, traction: float) -> Array:
    scaled = replace(geometry, traction_height=traction * geometry.traction_height)
    return np.ascontiguousarray(scaled.load_transfer(np.eye(sum(scaled.axles_per_bogie))).T)
