"""Six wheelsets on a rail and the train behind them.

Each wheelset: J dω/dt = r (T − F), F = μ(λ) N. The train: M dv/dt = Σ F − resistance − gradient.
Near the start of the curve the contact is stiff (1000 1/s and more), so a step is linearly implicit
in ω (Rosenbrock-Euler), and what the rail gives in it is taken from the same balance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from adhesion_can.physics.burckhardt import SLIP_MAX, Array, Surface, adhesion, adhesion_slope
from adhesion_can.physics.effects import Contact, Effect
from adhesion_can.physics.vehicle import GRAVITY, Locomotive

SLOWEST = 0.2
"""m/s; λ is formed with at least this speed, so that a standing train can start."""


@dataclass(frozen=True, slots=True)
class ActiveEffect:
    """An effect with the values of its parameters."""

    effect: Effect
    values: tuple[float, ...]


def running_resistance(speed: float, train_mass: float) -> float:
    """Resistance of a freight train on the level, N: 1.5 + 0.00025 V² N/kN, V in km/h.

    Args:
        speed: m/s.
        train_mass: kg.

    """
    kmh = 3.6 * speed
    return (1.5 + 0.00025 * kmh * kmh) * 1e-3 * train_mass * GRAVITY


@dataclass(frozen=True, slots=True)
class Profile:
    """A track that keeps the train near a speed: it rises where the train is fast.

    Attributes:
        speed: at which it is level, m/s.
        rise: gradient per m/s above that speed.
        steepest: either way, m/m.

    """

    speed: float = 0.0
    rise: float = 0.0
    steepest: float = 0.035

    def at(self, speed: float) -> float:
        """Gradient where the train has a speed, m/m, positive uphill."""
        return min(max(self.rise * (speed - self.speed), -self.steepest), self.steepest)


class Plant:
    """State of the locomotive and its train.

    Args:
        vehicle: its data.
        speed: at the start, m/s.
        effects: mechanisms beyond the curve.
        load_transfer: whether axle loads move under effort.
        gradient: of the track, m/m, positive uphill; or its profile.

    """

    def __init__(
        self,
        vehicle: Locomotive,
        speed: float,
        effects: Sequence[ActiveEffect] = (),
        *,
        load_transfer: bool = False,
        gradient: "float | Profile" = 0.0,
    ) -> None:
        self.vehicle = vehicle
        self._gradient = gradient
        self.speed = speed
        self.position = 0.0
        self.radius = np.array(vehicle.wheel_radius)
        self.wheel_speed: Array = speed / self.radius
        self.force: Array = np.zeros(vehicle.axles)
        self.load: Array = np.array(vehicle.axle_load)
        self._effects = tuple(effects)
        self._load_transfer = load_transfer

    @property
    def gradient(self) -> float:
        """Of the track here, m/m, positive uphill."""
        slope = self._gradient
        return slope.at(self.speed) if isinstance(slope, Profile) else slope

    @property
    def slip(self) -> Array:
        """Slip ratio of each axle, shape (axles,)."""
        v = max(self.speed, SLOWEST)
        return np.asarray((self.radius * self.wheel_speed - self.speed) / v)

    def step(self, effort: Array, theta: tuple[Array, Array, Array], dt: float) -> None:
        """Advance by one step.

        Args:
            effort: at the rim of each axle, N, shape (axles,).
            theta: c1, c2, c3 of the rail under each axle.
            dt: s.

        """
        r, inertia = self.radius, self.vehicle.wheelset_inertia
        v = max(self.speed, SLOWEST)
        slip = self.slip
        # Past a slip of 1 a wheel only spins faster: the straight -c3 λ would turn negative there.
        mu = adhesion(np.clip(slip, -SLIP_MAX, SLIP_MAX), *theta)
        if self._effects:
            contact = Contact(slip, slip * v, np.full_like(slip, self.speed), self.load)
            for active in self._effects:
                mu = active.effect.apply(mu, contact, active.values)
        if self._load_transfer:
            self.load = self.vehicle.loads(effort)
        stiffness = np.maximum(adhesion_slope(slip, *theta), 0.0) * self.load * r / v
        gain = dt * r / inertia
        change = gain * (effort - mu * self.load) / (1.0 + gain * stiffness)
        # A locked wheel stands: brakes do not turn it backwards, and the rail gives what it can.
        locked = change <= -self.wheel_speed
        free = effort - inertia * change / (r * dt)
        self.force = np.where(locked, mu * self.load, free)
        self.wheel_speed = np.where(locked, 0.0, self.wheel_speed + change)
        mass = self.vehicle.train_mass
        resistance = running_resistance(self.speed, mass) if self.speed > 0 else 0.0
        pull = float(self.force.sum()) - resistance - mass * GRAVITY * self.gradient
        before = self.speed
        self.speed = max(before + dt * pull / mass, 0.0)
        self.position += dt * (before + self.speed) / 2


@dataclass(frozen=True, slots=True)
class Stretch:
    """A surface and when the leading axle enters it.

    Attributes:
        from_s: time at which the leading axle comes onto it.
        surface: what lies there.

    """

    from_s: float
    surface: Surface


class Track:
    """Surfaces along the track: an axle finds the change where the leading axle found it.

    Args:
        stretches: in the order of their times, the first from 0.
        behind: distance of each axle behind the leading one, m; zeros change all axles at once.

    """

    def __init__(self, stretches: Sequence[Stretch], behind: Array) -> None:
        self._stretches = list(stretches)
        self._behind = behind
        self._entered_m = [-np.inf]
        self._curves = np.array([s.surface.theta for s in self._stretches])
        self._settled: tuple[Array, Array, Array] | None = None

    def under(self, time_s: float, position: float) -> tuple[Array, Array, Array]:
        """c1, c2, c3 under each axle, shape (axles,) each.

        Args:
            time_s: simulated time.
            position: of the leading axle, m.

        """
        count = len(self._entered_m)
        if count < len(self._stretches) and time_s >= self._stretches[count].from_s:
            self._entered_m.append(position)
            self._settled = None
        if self._settled is None:
            where = position - self._behind
            index = np.searchsorted(self._entered_m, where, side="right") - 1
            c1, c2, c3 = self._curves[index].T
            if int(index.min()) < len(self._entered_m) - 1:
                return c1, c2, c3
            self._settled = (c1, c2, c3)
        return self._settled
