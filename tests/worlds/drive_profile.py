"""A drive as a driver and a line make it: creep, speed, curves, weather, sand and loads.

Creep is prescribed and the speed integrates the force of the bare contact, so neither depends on
an effect that is hidden: what it adds to the force, the train's resistance takes. A resistance does
not jump, so the contact is that of the drive: its law where it has one, else Burckhardt's curve.
All that the hidden effects feed on varies in every drive, each thing on its own.
"""

from dataclasses import dataclass, replace

import numpy as np

from tests.worlds.contact_laws import ContactLaw
from tests.worlds.rail import Floats, Ints, Rail, curve, peak

STEP_S = 0.01
LEAD = 200
"""Rows before the recording begins, for what is late or has a memory."""
AXLES = 6
RADIUS, INERTIA, STATIC_LOAD = 0.625, 200.0, 245e3
AXLE_PLACES = np.array([0.0, 1.9, 3.8, 10.3, 12.2, 14.1])
"""Behind the first axle, m."""
SPEEDS = (4.2, 24.5)


@dataclass(frozen=True)
class Vehicle:
    """What stays the same from drive to drive.

    Attributes:
        static_load: N, shape (6,).
        transfer: change of each axle's load as a share of the whole effort, shape (6,), travelling
            forward.
        mass: Mass of loco and train, kg.
        forward: whether axle 1 leads.

    """

    static_load: Floats
    transfer: Floats
    mass: float
    forward: bool

    @property
    def order(self) -> Ints:
        """Place of each axle in the direction of travel, 1 for the leading one, shape (6,)."""
        order = np.arange(1, AXLES + 1)
        return order if self.forward else order[::-1]

    @property
    def behind(self) -> Floats:
        """Distance of each axle behind the leading one, m, shape (6,)."""
        return AXLE_PLACES if self.forward else (AXLE_PLACES[-1] - AXLE_PLACES)


@dataclass(frozen=True)
class DriveProfile:
    """A drive, row by row of 10 ms; n rows, the first LEAD of them before the recording.

    Attributes:
        t: s, (n,); 0 where the recording begins.
        v: m/s, (n,).
        slip: creep of each axle, (n, 6).
        load: N, (n, 6).
        position: Travelled distance of the leading axle, m; shape (n,).
        curvature: 1/m, (n,).
        humidity: %, (n,).
        rail_temperature: degC, (n,).
        ambient_temperature: degC, (n,).
        sanding: 0 or 1, (n,).
        gradient: 1, uphill positive, (n,).

    """

    t: Floats
    v: Floats
    slip: Floats
    load: Floats
    position: Floats
    curvature: Floats
    humidity: Floats
    rail_temperature: Floats
    ambient_temperature: Floats
    sanding: Floats
    gradient: Floats


@dataclass(frozen=True)
class Style:
    """How a driver and a line share a drive between traction and braking.

    Attributes:
        preferred: 1 mostly traction (a heavy train uphill), -1 mostly braking (downhill), 0 both.
        heavier: Factor of the train's mass.
        limits: Speed below which traction follows, and above which braking follows, m/s.
        fewest: Phases of at least 4 s that each direction has, where that is not for the duration
            to say.

    """

    preferred: int = 0
    heavier: float = 1.0
    limits: tuple[float, float] = (9.0, 16.0)
    fewest: int | None = None

    def slope(self, vehicle: Vehicle, rail: Rail) -> float:
        """Mean gradient that takes most of what the preferred direction does to the speed."""
        grip = float(np.mean([peak(c)[0] for c in rail.curves]))
        mean = 0.55 * grip * float(vehicle.static_load.sum()) / (self.heavier * vehicle.mass)
        return self.preferred * 0.45 * mean / 9.81


MIXED = Style()
STYLES = {
    "mostly traction": Style(1, 3.0, (9.0, 20.0), 1),
    "mixed": MIXED,
    "mostly braking": Style(-1, 3.0, (6.5, 16.0), 1),
}


def draw_vehicle(rng: np.random.Generator, rail: Rail) -> Vehicle:
    """A locomotive with a light train, heavier where the rail lets it pull much."""
    grip = max(peak(c)[0] for c in rail.curves)
    lean = np.linspace(-1.0, 1.0, AXLES) * rng.uniform(0.02, 0.05)
    return Vehicle(
        static_load=STATIC_LOAD * (1 + rng.uniform(-0.05, 0.05, AXLES)),
        transfer=lean + rng.uniform(-0.005, 0.005, AXLES),
        mass=max(rng.uniform(300e3, 700e3), 1.4e6 * grip),
        forward=bool(rng.random() < 0.7),
    )


def wander(rng: np.random.Generator, t: Floats, shortest_s: float, longest_s: float) -> Floats:
    """A smooth random signal from −1 to 1, (n,)."""
    periods = np.exp(rng.uniform(np.log(shortest_s), np.log(longest_s), 5))
    phases = rng.uniform(0, 2 * np.pi, 5)
    x = np.sin(2 * np.pi * t[:, None] / periods + phases).sum(axis=1)
    return np.asarray(2 * (x - x.min()) / (x.max() - x.min()) - 1)


def draw_profile(
    rng: np.random.Generator,
    duration_s: float,
    vehicle: Vehicle,
    rail: Rail,
    law: ContactLaw | None = None,
    style: Style = MIXED,
) -> DriveProfile:
    """Draw a drive with every kind of phase in it, on a law's contact or the rail's curves."""
    n = LEAD + round(duration_s / STEP_S)
    t = (np.arange(n) - LEAD) * STEP_S
    gradient = style.slope(vehicle, rail) + 0.006 * wander(rng, t, 40, 160)
    vehicle = replace(vehicle, mass=style.heavier * vehicle.mass)
    curves = rail.curves[rail.surface_at(t)]
    while True:
        driven = _phases(rng, t, gradient, vehicle, curves, rail.tops, law, style)
        if driven is not None:
            v, slip = driven
            break
    position = np.cumsum(v) * STEP_S
    position -= position[LEAD]
    low, high = 40 + 12 * rng.random(), 90 - 12 * rng.random()
    humidity = (low + high) / 2 + (high - low) / 2 * wander(rng, t, 40, 200)
    return DriveProfile(
        t=t,
        v=v,
        slip=slip,
        load=_loads(rng, t, slip, vehicle, curves),
        position=position,
        curvature=_curvature(rng, position),
        humidity=humidity,
        rail_temperature=rng.uniform(5, 35) + rng.uniform(5, 10) * wander(rng, t, 40, 200),
        ambient_temperature=rng.uniform(5, 25) + rng.uniform(1, 3) * wander(rng, t, 60, 300),
        sanding=_sanding(rng, t),
        gradient=gradient,
    )


def _phases(
    rng: np.random.Generator,
    t: Floats,
    gradient: Floats,
    vehicle: Vehicle,
    curves: Floats,
    tops: tuple[float, float] | None,
    law: ContactLaw | None,
    style: Style,
) -> tuple[Floats, Floats] | None:
    """Speed (n,) and creep (n, 6) of traction, coasting and braking in turn; None: too few."""
    n = len(t)
    v, slip = np.empty(n), np.zeros((n, AXLES))
    speed, row, counts, last = rng.uniform(7, 14), 0, {1: 0, -1: 0}, 0
    length = LEAD + round(rng.uniform(1, 4) / STEP_S)
    mode = 0
    while row < n:
        end = min(row + length, n)
        wanted = mode * _sweeps(rng, end - row, curves[row:end], tops)
        adhesion = curve(curves[row:end], wanted)
        resistance = 0.015 + 9.81 * gradient[row:end]
        profile = _integrate(speed, adhesion, resistance, vehicle)
        if law is not None:
            # The law's force depends on the speed a little: that of the step before is enough.
            for _ in range(2):
                adhesion = _signed(law, wanted, profile, vehicle)
                profile = _integrate(speed, adhesion, resistance, vehicle)
        outside = np.flatnonzero((profile < SPEEDS[0]) | (profile > SPEEDS[1]))
        if len(outside):
            length = round(0.9 * int(outside[0]))
            if length < 300:
                return None
            continue
        v[row:end], slip[row:end] = profile, wanted
        speed, row = float(profile[-1]), end
        if mode:
            counts[mode] += length >= 400
            last = mode
        mode = _next_mode(rng, mode, last, speed, style)
        span = (4.0, 8.0) if mode == 0 else (9.0, 22.0)
        length = round(rng.uniform(*span) / STEP_S)
    # Two phases each way hardly fit into less than 45 s.
    enough = style.fewest or (1 if t[-1] < 45 else max(2, min(3, round(t[-1] / 60))))
    return (v, slip) if min(counts.values()) >= enough else None


def _integrate(speed: float, adhesion: Floats, resistance: Floats, vehicle: Vehicle) -> Floats:
    """Speed (n,) from a first one, by adhesion (n, 6) and resistance (n,), m/s²."""
    pull = (adhesion * vehicle.static_load).sum(axis=1) / vehicle.mass - resistance
    return np.asarray(speed + np.cumsum(pull) * STEP_S)


def _signed(law: ContactLaw, slip: Floats, speed: Floats, vehicle: Vehicle) -> Floats:
    """Adhesion of a law with the sign of the slip, (n, 6); a speed below the least counts as it."""
    v = np.maximum(speed, SPEEDS[0])[:, None]
    return np.asarray(np.sign(slip) * law.adhesion(np.abs(slip), v, vehicle.static_load))


def _next_mode(rng: np.random.Generator, mode: int, last: int, speed: float, style: Style) -> int:
    if mode and rng.random() < 0.75:
        return 0
    if speed < style.limits[0]:
        return 1
    if speed > style.limits[1]:
        return -1
    if style.preferred and rng.random() < 0.9:
        return style.preferred
    return -last if last and rng.random() < 0.75 else int(rng.choice((-1, 1)))


def _sweeps(
    rng: np.random.Generator, rows: int, curves: Floats, tops: tuple[float, float] | None
) -> Floats:
    """Creep from 0 to beyond the peak and back, again and again, (rows, 6), not negative."""
    t = np.arange(rows) * STEP_S
    beyond = 1.3 * max(peak(c)[1] for c in np.unique(curves, axis=0))
    low, high = tops or (min(max(0.15, beyond), 0.24), 0.25)
    top = rng.uniform(low, high) * rng.uniform(0.9, 1.0, AXLES)
    period = rng.uniform(4, max(min(20.0, rows * STEP_S), 4.5))
    phase = rng.uniform(0, 2 * np.pi, AXLES) if rng.random() < 0.5 else np.zeros(AXLES)
    swing = 0.5 - 0.5 * np.cos(2 * np.pi * t[:, None] / period + phase)
    ramp = rng.uniform(1.0, 2.5)
    edge = np.clip(np.minimum(t, t[-1] - t) / ramp, 0, 1)
    return np.asarray(
        top * swing * (edge * edge * edge * (10 - 15 * edge + 6 * edge * edge))[:, None]
    )


def _loads(
    rng: np.random.Generator, t: Floats, slip: Floats, vehicle: Vehicle, curves: Floats
) -> Floats:
    whole = (curve(curves, slip) * vehicle.static_load).sum(axis=1, keepdims=True)
    lean = vehicle.transfer * (1 if vehicle.forward else -1)
    sway = np.stack([wander(rng, t, 8, 50) for _ in range(AXLES)], axis=1)
    return np.asarray(vehicle.static_load * (1 + rng.uniform(0.01, 0.03) * sway) + lean * whole)


def _curvature(rng: np.random.Generator, position: Floats) -> Floats:
    """Straights and curves of 300..1500 m radius with linear transitions, (n,)."""
    at, places, values = float(position[0]), [float(position[0])], [0.0]
    while at < position[-1]:
        bend = rng.choice((-1, 1)) / np.exp(rng.uniform(np.log(300), np.log(1500)))
        for length, value in (
            (rng.uniform(60, 300), 0.0),
            (rng.uniform(30, 60), bend),
            (rng.uniform(100, 350), bend),
            (rng.uniform(30, 60), 0.0),
        ):
            at += length
            places.append(at)
            values.append(value)
    return np.interp(position, places, values)


def _sanding(rng: np.random.Generator, t: Floats) -> Floats:
    """On for 6-15 s now and then; it turns on the second, when the bus says so."""
    sanding, at = np.zeros(len(t)), int(rng.integers(5, 15))
    while at < t[-1]:
        end = at + int(rng.integers(6, 16))
        sanding[(t >= at - STEP_S / 2) & (t < end - STEP_S / 2)] = 1.0
        at = end + int(rng.integers(12, 35))
    return sanding
