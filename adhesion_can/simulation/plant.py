"""Wheelsets on a rail and the train behind them.

Each wheelset: J dω/dt = r (T − F), F = μ(λ) N. The train: M dv/dt = Σ F − resistance − gradient.
Near the start of the curve the contact is stiff (1000 1/s and more). So a step is linearly implicit
in ω (Rosenbrock-Euler; Rosenbrock, Comput. J. 5, 1963), and the force of the rail follows from the
same balance.

Effects in the contact turn the curve into F = factor μ(λ') N, with λ' the slip that they change.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi, sin
from typing import Protocol

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import SLIP_MAX, Surface, adhesion, adhesion_slope
from adhesion_can.physics.curves import Conditions as CurveConditions
from adhesion_can.physics.curves import CurveFamily
from adhesion_can.physics.curves.surfaces import FamilySurface
from adhesion_can.physics.effects import (
    ActiveEffect,
    Contact,
    ContactEffect,
    LagStates,
    compute_change,
)
from adhesion_can.physics.instrument_laws import LoadShift
from adhesion_can.physics.vehicle import GRAVITY, Locomotive
from adhesion_can.simulation.surroundings import SurroundingConditions, Surroundings

AxleCurves = tuple[Array, ...]
"""Values of the curve's parameters under each axle, such as c1, c2, c3, shape (axles,) each."""

SLOWEST = 0.2
"""Smallest speed in the slip ratio, m/s, so that a standing train can start."""

SLIP_STEP = 1e-6
"""Step of the slip in the difference quotient of a contact whose slip effects change."""


def running_resistance(speed: float, train_mass: float) -> float:
    """Resistance of a freight train on the level, N: 1.5 + 0.00025 V² N/kN, V in km/h.

    Args:
        speed: Vehicle speed, m/s.
        train_mass: Mass of locomotive and train, kg.

    """
    kmh = 3.6 * speed
    return (1.5 + 0.00025 * kmh * kmh) * 1e-3 * train_mass * GRAVITY


@dataclass(frozen=True, slots=True)
class GradientProfile:
    """A track that keeps the train near a speed: it rises where the train is fast.

    A vehicle whose wheels are all driven is stronger than any track is steep. Beside it runs what
    adhesion tests have for that: a second vehicle, which brakes it where it is fast and pushes it
    where it is slow.

    Attributes:
        speed: Speed at which the track is level, m/s.
        rise: Gradient per m/s above that speed, m/m per m/s.
        steepest: Largest gradient up or down, m/m.
        amplitude: Relative amplitude with which the speed of the level track varies with time.
        period_s: Period of the variation, s.
        help_rise: Force of the second vehicle per m/s, in shares of the train's weight.
        help_most: Largest force of the second vehicle, in shares of the train's weight.

    """

    speed: float = 0.0
    rise: float = 0.0
    steepest: float = 0.035
    amplitude: float = 0.0
    period_s: float = 180.0
    help_rise: float = 0.0
    help_most: float = 0.0

    def at(self, speed: float, time_s: float = 0.0) -> float:
        """Gradient where the train has a speed (m/s) at a time (s), m/m, positive uphill."""
        excess = self.rise * (speed - self._level(time_s))
        return min(max(excess, -self.steepest), self.steepest)

    def help(self, speed: float, time_s: float = 0.0) -> float:
        """Force of the second vehicle where the train has a speed (m/s) at a time (s).

        In shares of the train's weight, positive where it brakes.
        """
        excess = self.help_rise * (speed - self._level(time_s))
        return min(max(excess, -self.help_most), self.help_most)

    def _level(self, time_s: float) -> float:
        return self.speed * (1.0 + self.amplitude * sin(2.0 * pi * time_s / self.period_s))


class Plant:
    """State of the locomotive and its train.

    Args:
        vehicle: True data of the vehicle.
        speed: Speed at the start, m/s.
        effects: Mechanisms beyond the curve; those of the instruments change nothing here.
        load_transfer: Whether axle loads change under effort.
        load_shifts: Changes of the axle loads under effort that loads as read do not show; they
            take the place of the transfer by the vehicle's geometry.
        gradient: Gradient of the track, m/m, positive uphill, or the profile of the gradient.
        surroundings: Air, rail, sand and curves along the run; None: calm.
        family: Family of the surfaces' curves; None: Burckhardt's curve.

    """

    def __init__(
        self,
        vehicle: Locomotive,
        speed: float,
        effects: Sequence[ActiveEffect] = (),
        *,
        load_transfer: bool = False,
        load_shifts: Sequence[LoadShift] = (),
        gradient: float | GradientProfile = 0.0,
        surroundings: Surroundings | None = None,
        family: CurveFamily | None = None,
    ) -> None:
        self.vehicle = vehicle
        self._family = family
        self._gradient = gradient
        self.time_s = 0.0
        self.speed = speed
        self.position = 0.0
        self.radius = np.array(vehicle.wheel_radius)
        self.wheel_speed: Array = speed / self.radius
        self.force: Array = np.zeros(vehicle.axles)
        self.load: Array = np.array(vehicle.axle_load)
        self._effects = tuple(a for a in effects if isinstance(a.effect, ContactEffect))
        self._channels = {name for a in self._effects for name in a.effect.requires.covariates}
        self._lags = LagStates()
        self._lags_follow_slip = False
        self._axle = np.arange(1.0, vehicle.axles + 1)
        self.sanding: bool | None = None
        """Whether sand is strewn; None: as the surroundings have it."""
        self._surroundings = surroundings or Surroundings()
        # Transfer is linear in the efforts: (axles, axles), N of load per N of effort.
        self._transfer: Array | None = None
        if load_shifts:
            self._transfer = np.sum([shift.shares(vehicle).T for shift in load_shifts], axis=0)
        elif load_transfer and vehicle.geometry:
            self._transfer = vehicle.geometry.load_transfer(np.eye(vehicle.axles))
        self.acceleration = 0.0
        """Acceleration of the vehicle in the last step, m/s²."""
        self.wheel_angle: Array = np.zeros(vehicle.axles)
        """Angle that each wheelset has turned since the start, rad; shape (axles,)."""

    @property
    def gradient(self) -> float:
        """Gradient of the track here, m/m, positive uphill."""
        slope = self._gradient
        return slope.at(self.speed, self.time_s) if isinstance(slope, GradientProfile) else slope

    @property
    def _help(self) -> float:
        """Force of the second vehicle in shares of the train's weight, positive where it brakes."""
        slope = self._gradient
        return slope.help(self.speed, self.time_s) if isinstance(slope, GradientProfile) else 0.0

    @property
    def conditions(self) -> SurroundingConditions:
        """Conditions around the locomotive now."""
        known = self._surroundings.at(self.time_s, self.position)
        return known if self.sanding is None else replace(known, sanding=float(self.sanding))

    @property
    def slip(self) -> Array:
        """Slip ratio of each axle, shape (axles,)."""
        v = max(self.speed, SLOWEST)
        return np.asarray((self.radius * self.wheel_speed - self.speed) / v)

    def step(self, effort: Array, theta: AxleCurves, dt: float) -> None:
        """Advance by one step.

        Args:
            effort: Effort at the rim of each axle, N, shape (axles,).
            theta: Values of the curve's parameters under each axle, shape (axles,) each.
            dt: Duration of the step, s.

        """
        r, inertia = self.radius, self.vehicle.wheelset_inertia
        v = max(self.speed, SLOWEST)
        if self._transfer is not None:
            self.load = np.asarray(self.vehicle.axle_load + effort @ self._transfer)
        slip = self.slip
        contact = self._contact(slip, v, dt) if self._effects else None
        if contact is None:
            mu, slope = self._curve(slip, theta), self._slope(slip, theta)
        else:
            mu, slope = self._compute_adhesion(contact, theta)
        stiffness = np.maximum(slope, 0.0) * self.load * r / v
        gain = dt * r / inertia
        change = gain * (effort - mu * self.load) / (1.0 + gain * stiffness)
        locked = change <= -self.wheel_speed
        self.force = effort - inertia * change / (r * dt)
        turned = self.wheel_speed
        self.wheel_speed = self.wheel_speed + change
        if locked.any():
            # Brakes do not turn a locked wheel backwards, and the rail gives what it can.
            self.force = np.where(locked, mu * self.load, self.force)
            self.wheel_speed = np.where(locked, 0.0, self.wheel_speed)
        mass = self.vehicle.train_mass
        resistance = running_resistance(self.speed, mass) if self.speed > 0 else 0.0
        held = self.gradient + self._help
        pull = float(self.force.sum()) - resistance - mass * GRAVITY * held
        before = self.speed
        self.speed = max(before + dt * pull / mass, 0.0)
        self.acceleration = (self.speed - before) / dt
        self.wheel_angle = self.wheel_angle + (0.5 * dt) * (turned + self.wheel_speed)
        self.position += dt * (before + self.speed) / 2
        self.time_s += dt
        if contact is not None and self._lags_follow_slip:
            compute_change(self._effects, replace(contact, slip=self.slip), self._lags)

    def _compute_adhesion(self, contact: Contact, theta: AxleCurves) -> tuple[Array, Array]:
        """Adhesion at the end of a step in which the slip stays, and its slope over that slip.

        Both of shape (axles,). A contact that follows the slip moves only a part of the way within
        the step, so its slope is that part of the curve's.
        """
        slip, after = contact.slip, self._lags.copy()
        change = compute_change(self._effects, contact, after)
        mu = self._curve(change.slip, theta) * change.factor
        if change.slip is slip:
            self._lags = after
            return mu, self._slope(slip, theta) * change.factor
        # Lag states that follow the slip are advanced in `step`, once the slip at its end is known.
        self._lags_follow_slip = True
        moved = replace(contact, slip=slip + SLIP_STEP)
        stepped = compute_change(self._effects, moved, self._lags.copy())
        return mu, (self._curve(stepped.slip, theta) * stepped.factor - mu) / SLIP_STEP

    def _contact(self, slip: Array, v: float, dt: float) -> Contact:
        """State of the contacts, at the time of the step's end."""

        def every(value: float) -> Array:
            return np.full(len(slip), value)

        known = self.conditions.covariates(self.gradient) if self._channels else {}
        return Contact(
            slip=slip,
            creep_speed=slip * v,
            speed=every(v),
            load=self.load,
            time_s=every(self.time_s + dt),
            axle=self._axle,
            place=self._axle,  # the simulated locomotive runs forward
            adhesion=self.force / self.load,
            covariates={name: every(x) for name, x in known.items() if name in self._channels},
        )

    def _curve(self, slip: Array, theta: AxleCurves) -> Array:
        # Past a slip of 1 a wheel only spins faster: the straight -c3 λ would turn negative there.
        slip = np.minimum(np.maximum(slip, -SLIP_MAX), SLIP_MAX)
        if self._family is None:
            c1, c2, c3 = theta
            return adhesion(slip, c1, c2, c3)
        return self._family.adhesion(slip, theta, self._curve_conditions())

    def _slope(self, slip: Array, theta: AxleCurves) -> Array:
        if self._family is None:
            c1, c2, c3 = theta
            return adhesion_slope(slip, c1, c2, c3)
        return self._family.slope(slip, theta, self._curve_conditions())

    def _curve_conditions(self) -> CurveConditions:
        return CurveConditions(max(self.speed, SLOWEST), self.load)


@dataclass(frozen=True, slots=True)
class TrackSection:
    """A surface and when the leading axle enters it.

    Attributes:
        from_s: Time at which the leading axle comes onto the section, s.
        surface: Surface of the section.

    """

    from_s: float
    surface: Surface | FamilySurface

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the parameters of the surface's curve."""
        surface = self.surface
        return surface.values if isinstance(surface, FamilySurface) else surface.theta


class Rails(Protocol):
    """Curves under the axles."""

    def under(self, time_s: float, position: float) -> AxleCurves:
        """Values of the curve's parameters under each axle, shape (axles,) each.

        Args:
            time_s: Simulated time, s.
            position: Position of the leading axle, m.

        """


class Track:
    """Surfaces along the track: an axle finds the change where the leading axle found it.

    Args:
        sections: Sections in the order of their times, the first from 0; curves of one family.
        behind: Distance of each axle behind the leading one, m, shape (axles,); zeros change the
            surface under all axles at once.

    """

    def __init__(self, sections: Sequence[TrackSection], behind: Array) -> None:
        self._sections = list(sections)
        self._behind = behind
        self._entered_m = [-np.inf]
        self._curves = np.array([s.values for s in self._sections])
        self._settled: AxleCurves | None = None

    def under(self, time_s: float, position: float) -> AxleCurves:
        """Values of the curve's parameters under each axle, as `Rails.under` defines it."""
        count = len(self._entered_m)
        if count < len(self._sections) and time_s >= self._sections[count].from_s:
            self._entered_m.append(position)
            self._settled = None
        if self._settled is None:
            where = position - self._behind
            index = np.searchsorted(self._entered_m, where, side="right") - 1
            values = tuple(self._curves[index].T)
            if int(index.min()) < len(self._entered_m) - 1:
                return values
            self._settled = values
        return self._settled
