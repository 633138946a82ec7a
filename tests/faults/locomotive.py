"""A locomotive of six driven axles and its train, in steps of a millisecond.

Each wheelset: J dω/dt = r (T − F), the rail's force F = μ N at the slip ratio of its axle. The
train: M dv/dt = ΣF − resistance − M g grade. A contact near zero slip is as stiff as 2 000 1/s, so
that ω takes a step that is implicit in the slope of the curve; the force follows from the balance.

Every axle's creep is controlled to a demand that holds a part of the curve and now and then goes
beyond the peak and back, one axle after the other.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tests.faults.rail import DRY, Floats, Rail, peak

AXLES = 6
RADIUS = 0.625
INERTIA = 200.0
STATIC_LOAD = 245e3
BEHIND = np.array([0.0, 1.9, 3.8, 10.3, 12.2, 14.1])
"""Distance of each axle behind the leading one, m."""
STEP_S = 0.001
EVERY = 5
"""Steps from one row of the truth to the next."""
LIMIT = 130e3
"""Largest effort of an axle, N."""
GAIN, INTEGRAL_GAIN, MOTOR_LAG_S = 55e3, 6e5, 0.012
START_S, LEVER_S = 0.3, 0.8
"""Time without effort at the start, and time over which the driver's lever is averaged twice, s."""
GRAVITY = 9.81
SHIFT = 0.02 * np.array([-1.6, -1.0, -0.4, 0.4, 1.0, 1.6])
"""Load that an axle wins of each newton that all axles pull: the body pitches."""


@dataclass(frozen=True)
class World:
    """A drive, before anything is spoilt.

    Attributes:
        seed: Seed of what is drawn: speed, masses, gradient, phases of the excursions.
        seconds: Duration, s.
        rails: Times at which the leading axle comes onto a rail, s, and the rails; the first at 0.
        braking: Spans in which the axles brake, s.
        coasting: Spans without any effort, s.
        sanding: Spans in which sand raises the adhesion, s.
        slide_s: Time at which one axle slides while it brakes, s; None: none does.
        climb: Change of the gradient that begins at `climb_s`, m/m.
        climb_s: Time of that change, s.

    """

    seed: int
    seconds: float = 40.0
    rails: tuple[tuple[float, Rail], ...] = ((0.0, DRY),)
    braking: tuple[tuple[float, float], ...] = ()
    coasting: tuple[tuple[float, float], ...] = ()
    sanding: tuple[tuple[float, float], ...] = ()
    slide_s: float | None = None
    climb: float = 0.0
    climb_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Truth:
    """What truly happened; a row each 5 ms.

    Attributes:
        world: The drive.
        t: Time, s, (n,).
        speed: Vehicle speed, m/s, (n,).
        wheel: Angular speeds, rad/s, (n, 6).
        effort: Efforts at the rim, N, (n, 6).
        load: Axle loads, N, (n, 6).
        gradient: Gradient, m/m, (n,).
        peaks: Smallest and largest of the axles' largest adhesions, (2, n).
        slips: Smallest and largest of their slip ratios, (2, n).
        settled: Whether all axles run on the same rail, and no sand begins or ends, (n,).

    """

    world: World
    t: Floats
    speed: Floats
    wheel: Floats
    effort: Floats
    load: Floats
    gradient: Floats
    peaks: Floats
    slips: Floats
    settled: NDArray[np.bool_]


@dataclass(frozen=True)
class _Drawn:
    """What the seed decides."""

    speed: float
    mass: float
    phase: float
    period_s: float
    base: float
    high: float
    waves: Floats
    load: Floats
    sway: Floats


def _draw(world: World) -> _Drawn:
    rng = np.random.default_rng([world.seed, 4401])
    return _Drawn(
        speed=float(rng.uniform(9.0, 16.0)),
        mass=float(rng.uniform(1.3e6, 1.9e6)),
        phase=float(rng.uniform(0.0, 1.0)),
        period_s=float(rng.uniform(4.0, 6.0)),
        base=float(rng.uniform(0.3, 0.5)),
        high=float(rng.uniform(2.0, 2.6)),
        # Amplitude, 1/wavelength and phase of the gradient's waves.
        waves=np.stack(
            [rng.uniform(2e-4, 1e-3, 4), 1 / rng.uniform(300, 2000, 4), rng.uniform(0, 6.28, 4)]
        ),
        load=STATIC_LOAD * (1 + 0.01 * rng.standard_normal(AXLES)),
        sway=np.stack([rng.uniform(0.6, 1.4, AXLES), rng.uniform(0, 6.28, AXLES)]),
    )


def demand(world: World) -> Floats:
    """Slip ratio that each axle is to have at each step, (n, 6)."""
    drawn = _draw(world)
    t = np.arange(round(world.seconds / STEP_S)) * STEP_S
    slip = float(peak(world.rails[0][1], np.array([drawn.speed]))[1][0])
    turn = (t[:, None] / drawn.period_s + drawn.phase + np.arange(AXLES) / AXLES) % 1.0
    # Up to beyond the peak and back in half of the period, the other half below it.
    beyond = np.where(turn < 0.5, 0.5 - 0.5 * np.cos(4 * np.pi * turn), 0.0)
    wander = 1 + 0.25 * np.sin(2 * np.pi * (t[:, None] / 7.3 + np.arange(AXLES) * 0.37))
    wanted = slip * (drawn.base * wander + (drawn.high - drawn.base) * beyond)
    # The driver's lever: braking, traction or nothing, moved within 1.6 s.
    lever = np.ones_like(t)
    for begin, end in world.braking:
        lever[(t >= begin) & (t < end)] = -1.0
    for begin, end in world.coasting:
        lever[(t >= begin) & (t < end)] = 0.0
    lever[t < START_S] = 0.0
    wanted *= _smoothed(lever, LEVER_S / STEP_S)[:, None]
    if world.slide_s is not None:
        slides = (t >= world.slide_s) & (t < world.slide_s + 1.5)
        wanted[slides, 1] = -0.35
    # No controller steps: what is demanded passes a low-pass of 0.1 s.
    return _smoothed(wanted, 0.1 / STEP_S)


def _smoothed(values: Floats, rows: float) -> Floats:
    """Moving mean over so many rows, twice; it takes twice that time, and begins late."""
    width = round(rows)
    for _ in range(2):
        padded = np.concatenate([np.repeat(values[:1], width, axis=0), values])
        total = np.cumsum(padded, axis=0)
        values = (total[width:] - total[:-width]) / width
    return values


@lru_cache(24)
def simulate(world: World) -> Truth:
    """The drive."""
    drawn, wanted = _draw(world), demand(world)
    steps = len(wanted)
    t = np.arange(steps) * STEP_S
    sand = np.ones(steps)
    for begin, end in world.sanding:
        sand += 0.12 * np.clip((t - begin) / 0.8, 0, 1) * np.clip((end + 2.0 - t) / 2.0, 0, 1)
    sway = 1 + 0.004 * np.sin(2 * np.pi * t[::EVERY, None] * drawn.sway[0] + drawn.sway[1])
    rails = np.array([rail.values for _, rail in world.rails])
    entered = [-np.inf] + [np.inf] * (len(world.rails) - 1)
    # Balanced on average: what the axles pull at some two thirds of the peak.
    level = float(peak(world.rails[0][1], np.array([drawn.speed]))[0][0])
    mean = 0.78 * level * float(drawn.load.sum()) / (drawn.mass * GRAVITY)
    mean *= -1.0 if world.braking and world.braking[0][0] <= 0 else 1.0
    rows = steps // EVERY
    out = {name: np.empty((rows, AXLES)) for name in ("wheel", "effort", "load")}
    speeds, grades = np.empty(rows), np.empty(rows)
    under = np.zeros((rows, AXLES), dtype=int)
    speed, position, count = drawn.speed, 0.0, 1
    omega = np.full(AXLES, speed / RADIUS)
    effort, integral = np.zeros(AXLES), np.zeros(AXLES)
    load = drawn.load.copy()
    here = np.zeros(AXLES, dtype=int)
    a, rise, share, fall = rails[here].T
    gain, keep = STEP_S * RADIUS / INERTIA, STEP_S / MOTOR_LAG_S
    grade = mean
    for step in range(steps):
        if step % EVERY == 0:
            row = step // EVERY
            if count < len(world.rails) and t[step] >= world.rails[count][0]:
                entered[count] = position
                count += 1
            if count > 1 and here[-1] != count - 1:
                here = np.searchsorted(entered, position - BEHIND, side="right") - 1
                a, rise, share, fall = rails[here].T
            wave = np.sin(2 * np.pi * position * drawn.waves[1] + drawn.waves[2])
            grade = mean + float(drawn.waves[0] @ wave) + world.climb * (t[step] >= world.climb_s)
            # The driver's line: where the train has become slow the track is easier.
            grade += 0.002 * max(min(speed - drawn.speed, 5.0), -5.0)
            load = drawn.load * sway[row] + SHIFT * effort.sum()
            out["wheel"][row], out["effort"][row], out["load"][row] = omega, effort, load
            speeds[row], grades[row], under[row] = speed, grade, here
        creep = RADIUS * omega - speed
        size = np.abs(creep) / speed
        left = np.exp(-size / rise)
        rate = speed / fall
        falling = (1.0 - share) * np.exp(-size * rate)
        whole = a * sand[step]
        mu = np.copysign(whole * (1.0 - left) * (share + falling), creep)
        slope = whole * (left / rise * (share + falling) - (1.0 - left) * rate * falling)
        stiff = np.maximum(slope, 0.0) * load * (RADIUS / speed)
        change = gain * (effort - mu * load) / (1.0 + gain * stiff)
        change = np.maximum(change, -omega)
        force = effort - change / gain
        omega = omega + change
        pull = float(force.sum())
        resistance = drawn.mass * GRAVITY * (0.0012 + 2.2e-6 * speed * speed)
        before = speed
        speed += STEP_S * (pull - resistance - drawn.mass * GRAVITY * grade) / drawn.mass
        speed = max(speed, 0.5)
        position += STEP_S * 0.5 * (before + speed)
        error = wanted[step] * speed - (RADIUS * omega - speed)
        free = np.abs(integral) < LIMIT
        integral = np.where(free, integral + STEP_S * INTEGRAL_GAIN * error, 0.999 * integral)
        command = np.minimum(np.maximum(GAIN * error + integral, -LIMIT), LIMIT)
        effort = effort + keep * (command - effort)
    peaks, slips = _true_peaks(world, speeds, under, sand[::EVERY][:rows])
    return Truth(
        world,
        t[::EVERY][:rows],
        speeds,
        out["wheel"],
        out["effort"],
        out["load"],
        grades,
        peaks,
        slips,
        (under[:, 0] == under[:, -1]) & (np.gradient(sand[::EVERY][:rows]) == 0),
    )


def _true_peaks(world: World, speed: Floats, under: Floats, sand: Floats) -> tuple[Floats, Floats]:
    """Smallest and largest of the axles' largest adhesions and of their slip ratios."""
    every = np.array([peak(rail, speed) for _, rail in world.rails])
    rows = np.arange(len(speed))[:, None]
    # (rails, 2, n) by the rail under each axle: (n, 6).
    mu = every[under, 0, rows] * sand[:, None]
    slip = every[under, 1, rows]
    return np.stack([mu.min(axis=1), mu.max(axis=1)]), np.stack(
        [slip.min(axis=1), slip.max(axis=1)]
    )
