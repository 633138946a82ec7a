"""What instruments read of a drive: at the cycles of the messages, with noise and its memory."""

from dataclasses import dataclass, replace

import numpy as np

from tests.faults.locomotive import Truth
from tests.faults.rail import Floats

WHEEL_S, SPEED_S, EFFORT_S, LOAD_S = 0.01, 0.02, 0.01, 0.2


@dataclass(frozen=True, eq=False)
class Noise:
    """Sizes of the noise of one drive.

    Attributes:
        wheel: Standard deviation of a wheel speed, rad/s.
        speed: Standard deviation of the vehicle speed, m/s.
        memory_s: Time over which the noise of the vehicle speed remembers, s; 0: white.
        effort: Standard deviation of an effort, N.
        load: Standard deviation of a load, N.

    """

    wheel: float
    speed: float
    memory_s: float
    effort: float
    load: float


SILENT = Noise(0.0, 0.0, 0.0, 0.0, 0.0)


def draw_noise(seed: int) -> Noise:
    """Noise of a drive: the speed's is 0.01 to 0.03 m/s, in half of the drives with a memory."""
    rng = np.random.default_rng([seed, 4402])
    return Noise(
        wheel=float(rng.uniform(0.002, 0.005)),
        speed=float(rng.uniform(0.01, 0.03)),
        memory_s=float(rng.uniform(0.2, 1.0)) if seed % 2 else 0.0,
        effort=float(rng.uniform(800.0, 2500.0)),
        load=float(rng.uniform(300.0, 1000.0)),
    )


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings before they are packed; a row a frame of the message's cycle.

    Attributes:
        wheel: Angular speeds, rad/s, (n, 6).
        speed: Vehicle speed, m/s, (m,).
        effort: Efforts at the rim, N, (n, 6).
        load: Axle loads, N, (k, 6).
        gradient: Gradient, m/m, (k,).

    """

    wheel: Floats
    speed: Floats
    effort: Floats
    load: Floats
    gradient: Floats

    def times(self, name: str) -> Floats:
        """Times of the rows of a quantity, s."""
        cycle = {"wheel": WHEEL_S, "speed": SPEED_S, "effort": EFFORT_S}.get(name, LOAD_S)
        return np.arange(len(getattr(self, name))) * cycle

    def changed(self, **values: Floats) -> "Readings":
        """These readings with other ones in some places."""
        return replace(self, **values)


def read(truth: Truth, noise: Noise) -> Readings:
    """Readings of sound instruments."""
    rng = np.random.default_rng([truth.world.seed, 4403])
    end = truth.world.seconds

    def at(values: Floats, cycle: float) -> Floats:
        t = np.arange(round(end / cycle)) * cycle
        rows = np.minimum(np.rint(t / (truth.t[1] - truth.t[0])).astype(int), len(truth.t) - 1)
        return values[rows]

    wheel, speed = at(truth.wheel, WHEEL_S), at(truth.speed, SPEED_S)
    effort, load = at(truth.effort, EFFORT_S), at(truth.load, LOAD_S)
    own = rng.standard_normal(len(speed))
    if noise.memory_s > 0:
        own = remembering(own, SPEED_S, noise.memory_s)
    return Readings(
        wheel=np.maximum(wheel + noise.wheel * rng.standard_normal(wheel.shape), 0.0),
        speed=np.maximum(speed + noise.speed * own, 0.0),
        effort=effort + noise.effort * rng.standard_normal(effort.shape),
        load=load + noise.load * rng.standard_normal(load.shape),
        gradient=at(truth.gradient, LOAD_S),
    )


def remembering(white: Floats, cycle_s: float, memory_s: float) -> Floats:
    """AR(1) noise of unit size from white noise of unit size."""
    keep = float(np.exp(-cycle_s / memory_s))
    new, last, out = float(np.sqrt(1 - keep * keep)), float(white[0]), np.empty_like(white)
    for row, value in enumerate(white.tolist()):
        last = keep * last + new * value if row else value
        out[row] = last
    return out
