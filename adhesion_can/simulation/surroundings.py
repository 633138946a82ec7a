"""What surrounds the locomotive: air, rail, sand and curves, as functions of time and place.

Each has a period of its own, so that its influence on adhesion can be separated from the others.
Nothing here is random: a scenario is the same drive each time, but for the noise of its sensors.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import pi, sin

from adhesion_can.physics.channels import COVARIATES
from adhesion_can.physics.readings import Role

# Looked up once: a plant asks for the covariates in every step.
AMBIENT_TEMPERATURE = COVARIATES[Role.AMBIENT_TEMPERATURE]
RAIL_TEMPERATURE = COVARIATES[Role.RAIL_TEMPERATURE]
HUMIDITY = COVARIATES[Role.HUMIDITY]
SANDING = COVARIATES[Role.SANDING]
RAIN = COVARIATES[Role.RAIN]
GRADIENT = COVARIATES[Role.GRADIENT]
CURVATURE = COVARIATES[Role.CURVATURE]


@dataclass(frozen=True, slots=True)
class SurroundingConditions:
    """Surroundings at one time and place.

    Attributes:
        ambient_temperature: Temperature of the air, degC.
        rail_temperature: Temperature of the rail, degC.
        humidity: Relative humidity of the air, %.
        sanding: State of the sanders: 1.0 while sand is strewn, else 0.0.
        rain: Intensity of the rain: 0 none, 1 light, 2 heavy.
        curvature: Curvature of the track, 1/m, positive to the left.

    """

    ambient_temperature: float = 15.0
    rail_temperature: float = 18.0
    humidity: float = 60.0
    sanding: float = 0.0
    rain: float = 0.0
    curvature: float = 0.0

    def covariates(self, gradient: float) -> dict[str, float]:
        """Values by the names of the covariates.

        Args:
            gradient: Gradient of the track, m/m, positive uphill.

        """
        return {
            AMBIENT_TEMPERATURE: self.ambient_temperature,
            RAIL_TEMPERATURE: self.rail_temperature,
            HUMIDITY: self.humidity,
            SANDING: self.sanding,
            RAIN: self.rain,
            GRADIENT: gradient,
            CURVATURE: self.curvature,
        }


DEFAULT_CONDITIONS = SurroundingConditions()


def interpolate(x: float, corners: Sequence[float], values: Sequence[float]) -> float:
    """Linear interpolation of one number: to the last bit as np.interp, at a tenth of its cost.

    Args:
        x: Place.
        corners: Places of the values, ascending, at least one.
        values: Values at the corners; beyond the ends they stay.

    """
    place = bisect_right(corners, x) - 1
    if place < 0:
        return values[0]
    if place >= len(corners) - 1 or corners[place] == x:
        return values[place]
    slope = (values[place + 1] - values[place]) / (corners[place + 1] - corners[place])
    return slope * (x - corners[place]) + values[place]


@dataclass(frozen=True, slots=True)
class Wave:
    """A channel that swings around a mean.

    Attributes:
        mean: Mean, in the channel's unit.
        swing: Amplitude, in the channel's unit.
        period_s: Period, s.

    """

    mean: float
    swing: float = 0.0
    period_s: float = 60.0

    def at(self, time_s: float) -> float:
        """Value at a time, s."""
        return self.mean + self.swing * sin(2.0 * pi * time_s / self.period_s)


TRANSITION_M = 40.0
"""Length over which curvature grows from 0 and falls back to it, m."""


@dataclass(frozen=True, slots=True)
class TrackCurve:
    """A curve of the track and the straight behind it.

    Attributes:
        length: Length with both transitions, m.
        radius: Radius, m, negative for a curve to the right.
        straight: Length of the straight behind the curve, m.

    """

    length: float
    radius: float
    straight: float

    def __post_init__(self) -> None:
        if not (self.length >= 2 * TRANSITION_M and self.straight > 0 and self.radius != 0):
            raise ValueError("a curve needs its two transitions, a radius and a straight")


@dataclass(frozen=True)
class Surroundings:
    """How the conditions change along a run; by default they do not.

    Attributes:
        humidity: Relative humidity of the air, %.
        rail_temperature: Temperature of the rail, degC.
        sanding_period_s: Time from one sanding to the next, s.
        sanding_s: Duration of a sanding, at the end of each period, s.
        rain_period_s: Time from one shower to the next, s.
        shower_s: Duration of a shower, at the end of each period, s: its first half is light rain,
            its second half heavy.
        curves: Curves one after another; after the last one the first comes again.

    """

    humidity: Wave = field(default_factory=lambda: Wave(DEFAULT_CONDITIONS.humidity))
    rail_temperature: Wave = field(
        default_factory=lambda: Wave(DEFAULT_CONDITIONS.rail_temperature)
    )
    sanding_period_s: float = 60.0
    sanding_s: float = 0.0
    rain_period_s: float = 60.0
    shower_s: float = 0.0
    curves: tuple[TrackCurve, ...] = ()

    def at(self, time_s: float, position: float) -> SurroundingConditions:
        """Conditions at a time, s, and a place along the track, m."""
        remaining_s = self.sanding_period_s - time_s % self.sanding_period_s
        return SurroundingConditions(
            rail_temperature=self.rail_temperature.at(time_s),
            humidity=self.humidity.at(time_s),
            sanding=float(remaining_s <= self.sanding_s),
            rain=self._rain(time_s),
            curvature=self.curvature(position),
        )

    def _rain(self, time_s: float) -> float:
        """Level of the rain at a time, s."""
        remaining_s = self.rain_period_s - time_s % self.rain_period_s
        if remaining_s > self.shower_s:
            return 0.0
        return 1.0 if remaining_s > 0.5 * self.shower_s else 2.0

    def curvature(self, position: float) -> float:
        """Curvature of the track at a place, m: 1/m."""
        if not self.curves:
            return 0.0
        positions, curvatures = self._curvature_corners
        return interpolate(position % positions[-1], positions, curvatures)

    @cached_property
    def _curvature_corners(self) -> tuple[Sequence[float], Sequence[float]]:
        """Corners of the curvature over the position, m and 1/m; what lies between is straight."""
        positions, curvatures = [0.0], [0.0]
        for curve in self.curves:
            begin, inner = positions[-1], 1.0 / curve.radius
            offsets = (TRANSITION_M, curve.length - TRANSITION_M, curve.length)
            positions += [
                *(begin + offset for offset in offsets),
                begin + curve.length + curve.straight,
            ]
            curvatures += [inner, inner, 0.0, 0.0]
        return positions, curvatures
