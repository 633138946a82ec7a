"""From a drive profile and what is hidden to the readings on the bus, and back to samples.

`drive` makes the readings. `view` is what a program that knows a model sees in them: with no
effects the plain model's slip and adhesion, with the true effects what the truth would have made of
the same noisy readings.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tests.worlds.drive_profile import (
    AXLES,
    LEAD,
    RADIUS,
    STATIC_LOAD,
    STEP_S,
    DriveProfile,
    Vehicle,
)
from tests.worlds.hidden import Contact, Hidden, State, between, contact, find
from tests.worlds.mechanism import UNCHANGED, Law, Scene
from tests.worlds.rail import Floats, Rail

EFFORT_STD, SPEED_STD, WHEEL_STD, LOAD_STD = 0.01 * STATIC_LOAD, 0.01, 0.003, 500.0
EDGE_S = 1.0
"""No sample this near to the ends: what is late has not come there yet."""


@dataclass(frozen=True)
class Noise:
    """Drawn once a drive, so that sizes are compared on the same noise; one row a frame."""

    effort: Floats
    speed: Floats
    wheel: Floats
    load: Floats


@dataclass(frozen=True)
class Readings:
    """What the bus carries: a row a frame of the message's cycle, quantised as the bus does.

    Attributes:
        wheel_speed: rad/s, (n, 6), each 10 ms.
        speed: m/s, (n/2,), each 20 ms.
        effort: N, (n, 6), each 10 ms.
        load: N, (n/20, 6), each 200 ms.
        curvature: 1/m, (n/20,), each 200 ms.
        gradient: 1, (n/20,), each 200 ms.
        humidity, rail_temperature, ambient_temperature, sanding: (n/100,), each second.
        forward: direction of travel.

    """

    wheel_speed: Floats
    speed: Floats
    effort: Floats
    load: Floats
    curvature: Floats
    gradient: Floats
    humidity: Floats
    rail_temperature: Floats
    ambient_temperature: Floats
    sanding: Floats
    forward: bool


def draw_noise(rng: np.random.Generator, rows: int, correlation_s: float) -> Noise:
    """White, but for the effort with a correlation time: AR(1) of the same total size."""
    effort = rng.standard_normal((rows, AXLES))
    if correlation_s > 0:
        keep = np.exp(-STEP_S / correlation_s)
        for row in range(1, rows):
            effort[row] = keep * effort[row - 1] + np.sqrt(1 - keep * keep) * effort[row]
    return Noise(
        effort=EFFORT_STD * effort,
        speed=SPEED_STD * rng.standard_normal(len(range(0, rows, 2))),
        wheel=WHEEL_STD * rng.standard_normal((rows, AXLES)),
        load=LOAD_STD * rng.standard_normal((len(range(0, rows, 20)), AXLES)),
    )


def drive(
    profile: DriveProfile,
    vehicle: Vehicle,
    rail: Rail,
    effects: Sequence[Hidden],
    noise: Noise,
    mechanism: Law | None = None,
) -> Readings:
    """Run the profile with the effects, and perhaps a mechanism of no library, hidden in it."""
    state = true_state(profile, vehicle)
    curves = rail.curves[rail.surface_at(profile.t)]
    link = between(effects)
    omega = (1 + profile.slip) * profile.v[:, None] / link.radius
    adhesion = contact(state, effects, curves).adhesion(curves)
    own = link.inertia * np.gradient(omega, STEP_S, axis=0) / link.radius
    change = UNCHANGED
    if mechanism is not None:
        whole = adhesion * profile.load + own
        change = mechanism(Scene(profile, vehicle, curves, omega, adhesion, whole))
        if change.slip is not None:
            entered = replace(state, slip=change.slip)
            adhesion = contact(entered, effects, curves).adhesion(curves)
    force = adhesion * change.factor * profile.load * change.load_factor
    omega = omega * change.rotation if change.wheel_speed is None else change.wheel_speed
    effort = (force + own) * change.gain + change.offset
    # The drive's torsion swings the wheel; the motor, whose torque the effort is, hardly feels it.
    omega = omega + torsion(profile, effects, rail)
    seen = profile.t[LEAD:]
    v = profile.v if change.speed is None else change.speed
    late_v = np.interp(seen[::2] - link.speed_delay, profile.t, v)
    late_f = np.stack(
        [np.interp(seen - link.effort_delay, profile.t, effort[:, i]) for i in range(AXLES)], axis=1
    )
    measured = late_f + link.bias + noise.effort
    measured = np.clip(measured, -link.saturation, link.saturation)
    load = profile.load if change.shown_load is None else change.shown_load
    return Readings(
        wheel_speed=quantise(omega[LEAD:] + noise.wheel, 0.002, 0, 65534),
        speed=quantise(link.scale * late_v + noise.speed, 0.002, 0, 65534),
        effort=quantise(measured, 10.0, -32768, 32766),
        load=quantise(load[LEAD::20] + noise.load, 10.0, 0, 65534),
        curvature=quantise(profile.curvature[LEAD::20], 1e-6, -32768, 32766),
        gradient=quantise(profile.gradient[LEAD::20], 1e-5, -32768, 32766),
        humidity=quantise(profile.humidity[LEAD::100], 0.5, 0, 200),
        rail_temperature=quantise(profile.rail_temperature[LEAD::100] + 40, 0.5, 0, 254) - 40,
        ambient_temperature=quantise(profile.ambient_temperature[LEAD::100] + 40, 0.5, 0, 254) - 40,
        sanding=profile.sanding[LEAD::100],
        forward=vehicle.forward,
    )


def true_state(profile: DriveProfile, vehicle: Vehicle) -> State:
    """What the contact truly feels, row by row of the profile."""
    return State(
        profile.t,
        profile.v,
        profile.slip,
        profile.load,
        profile.position,
        profile.curvature,
        profile.humidity,
        profile.rail_temperature,
        profile.sanding,
        vehicle.order,
        vehicle.behind,
    )


def quantise(values: Floats, step: float, lowest: int, highest: int) -> Floats:
    """Values in the digits of a signal, within its range of digits."""
    return np.asarray(np.clip(np.rint(values / step), lowest, highest) * step)


def torsion(profile: DriveProfile, effects: Sequence[Hidden], rail: Rail) -> Floats:
    """Swing of the wheel speeds, rad/s, (n, 6): it grows where the creep lies beyond the peak."""
    found = find(effects, "out:torsion")
    if found is None:
        return np.zeros_like(profile.slip)
    p = found.parameters
    c = rail.curves[0]
    onset = float(np.log(c[0] * c[1] / c[2]) / c[1])
    x = np.clip((np.abs(profile.slip) - onset) / 0.03, 0, 1)
    envelope = p["amplitude"] * x * x * (3 - 2 * x) * profile.v[:, None] / RADIUS
    turns = p["frequency"] * profile.t[:, None] + np.arange(AXLES) * p["shift"]
    return envelope * np.sin(2 * np.pi * turns)


@dataclass(frozen=True)
class View:
    """Samples as a model reads them; a row each 10 ms.

    Attributes:
        t: s, (n,).
        adhesion: (n, 6).
        std: standard deviation of an adhesion from the effort noise, (n, 6).
        slip_std: Standard deviation of the slip ratio; shape (n, 6).
        contact: how the curve is entered.
        limits: lowest and highest adhesion that the effort sensor can show, (2, n, 6); None: all.
        use: rows that a program can use, (n,).

    """

    t: Floats
    adhesion: Floats
    std: Floats
    slip_std: Floats
    contact: Contact
    limits: Floats | None
    use: NDArray[np.bool_]

    def residual(self, c: Floats) -> Floats:
        """Adhesion less the model's with curve c, (3,) or (n, 3); (n, 6)."""
        predicted = self.contact.adhesion(c)
        if self.limits is not None:
            predicted = np.clip(predicted, self.limits[0], self.limits[1])
        return self.adhesion - predicted

    def thinned(self, every: int) -> "View":
        """Every so many rows."""
        rows = slice(None, None, every)
        entered = replace(
            self.contact,
            slip=self.contact.slip[rows],
            lateral=self.contact.lateral[rows],
            factor=np.broadcast_to(self.contact.factor, self.contact.slip.shape)[rows],
            speed=self.contact.speed[rows],
            load=self.contact.load[rows],
        )
        return View(
            self.t[rows],
            self.adhesion[rows],
            self.std[rows],
            self.slip_std[rows],
            entered,
            None if self.limits is None else self.limits[:, rows],
            self.use[rows],
        )


def view(
    readings: Readings,
    effects: Sequence[Hidden],
    rail: Rail,
    vehicle: Vehicle,
    profile: DriveProfile | None = None,
) -> View:
    """Samples of the readings under the effects; `profile` gives the torsion."""
    link = between(effects)
    n = len(readings.wheel_speed)
    t = np.arange(n) * STEP_S
    held, slow = np.arange(n) // 20, np.arange(n) // 100
    omega = readings.wheel_speed
    if profile is not None:
        omega = omega - torsion(profile, effects, rail)[LEAD:]
    v = np.interp(t + link.speed_delay, t[::2], readings.speed) / link.scale
    effort = readings.effort - link.bias
    if link.effort_delay:
        ahead = t + link.effort_delay
        effort = np.stack([np.interp(ahead, t, effort[:, i]) for i in range(AXLES)], axis=1)
    position = np.cumsum(v) * STEP_S
    state = State(
        t,
        v,
        link.radius * omega / v[:, None] - 1,
        readings.load[held],
        position - position[0],
        readings.curvature[held],
        readings.humidity[slow],
        readings.rail_temperature[slow],
        readings.sanding[slow],
        vehicle.order,
        vehicle.behind,
    )
    own = link.inertia * np.gradient(omega, STEP_S, axis=0) / link.radius
    entered = contact(state, effects, rail.curves[rail.surface_at(t)])
    limits = None
    if np.isfinite(link.saturation):
        limits = (np.array([[[-1.0]], [[1.0]]]) * link.saturation - own) / state.load
    return View(
        t,
        (effort - own) / state.load,
        EFFORT_STD / state.load,
        np.hypot(RADIUS * WHEEL_STD / v[:, None], (1 + state.slip) * SPEED_STD / v[:, None]),
        entered,
        limits,
        np.asarray((t > EDGE_S) & (t < t[-1] - EDGE_S)),
    )
