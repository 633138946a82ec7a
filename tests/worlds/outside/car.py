"""A car by the multi-body simulator of others, as a table with a row for each wheel.

`commonroad-vehicle-models` (Althoff and Würsching, CommonRoad: Vehicle Models, 2020): 29 states,
Pacejka's tyres with combined slip, pitch, roll and load transfer. It is integrated here by Heun's
method, and driven by a slip control through sweeps in traction and braking, on a straight or round
bends.
"""

import importlib.util
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

from tests.worlds.hidden import Hidden
from tests.worlds.rail import Floats
from tests.worlds.truth import Surface, Truth

CARS = ("car:scales", "car:loads")
"""Loads as on the scales, or as they are."""
SAME_IN_CAR = {
    "car:scales": {
        "curve_shape": "Pacejka's curve is not Burckhardt's",
        "load_transfer": "pitch and roll move the loads, and the scales do not show it",
        "curve_creep": "lateral slip takes part of the adhesion in bends",
    },
    "car:loads": {
        "curve_shape": "Pacejka's curve is not Burckhardt's",
        "curve_creep": "lateral slip takes part of the adhesion in bends",
    },
}
"""What is no false name in a car, with the reason."""
STEP_S, ROW_S = 0.002, 0.02
ADHESION_STD, SPEED_STD, WHEEL_STD = 0.005, 0.01, 0.01
LONGEST_S = 120.0
"""The simulator takes 0.1 s for a second of driving."""
WHEELS = slice(23, 27)
SPEEDS = (9.0, 30.0)
COLUMNS = ("time_s", "slip", "longitudinal_force_N", "normal_load_N", "speed_mps", "axle")


def has_simulator() -> bool:
    """Whether the package is installed (extra `test`)."""
    return importlib.util.find_spec("vehiclemodels") is not None


@dataclass(frozen=True)
class Simulator:
    """The package's model of a BMW 320i.

    Attributes:
        parameters: Parameters as the package has them.
        rates: Derivative of the state by state, inputs and parameters.
        start: State at a speed.

    """

    parameters: Any
    rates: Callable[[list[float], list[float], Any], list[float]]
    start: Callable[[float], list[float]]


def load_simulator() -> Simulator:
    """The package; imported here, for nothing else needs it."""
    from vehiclemodels.init_mb import init_mb
    from vehiclemodels.parameters_vehicle2 import parameters_vehicle2
    from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

    p = parameters_vehicle2()
    return Simulator(
        p,
        lambda x, u, p: vehicle_dynamics_mb(list(x), u, p),
        lambda speed: [float(value) for value in init_mb([0, 0, 0, speed, 0, 0, 0], p)],
    )


def make_car(kind: str, seed: int, path: Path, *, duration_s: float = LONGEST_S) -> Truth:
    """Write a table of a drive; longer ones than `LONGEST_S` are cut.

    Args:
        kind: one of `CARS`.
        seed: draws manoeuvres and noise.
        path: of the table (.csv).
        duration_s: Duration of the drive, s.

    Raises:
        RuntimeError: the simulator is not installed.

    """
    if not has_simulator():
        raise RuntimeError("commonroad-vehicle-models is not installed: pip install '.[test]'")
    rng = np.random.default_rng([seed, crc32(b"car")])
    bends = bool(rng.random() < 0.5)
    rows = np.array(list(_drive(rng, min(duration_s, LONGEST_S), bends=bends)))
    t, v, slip, force, load = rows[:, 0], rows[:, 1], rows[:, 2:6], rows[:, 6:10], rows[:, 10:14]
    static = np.broadcast_to(static_loads(load_simulator().parameters), load.shape)
    shown = static if kind == "car:scales" else load
    adhesion = force / shown + ADHESION_STD * rng.standard_normal(force.shape)
    speed = v + SPEED_STD * rng.standard_normal(len(v))
    rim = (1 + slip) * v[:, None] + WHEEL_STD * rng.standard_normal(slip.shape)
    table = np.stack([
        np.repeat(t, 4), (rim / speed[:, None] - 1).ravel(), (adhesion * shown).ravel(),
        shown.ravel(), np.repeat(speed, 4), np.tile(np.arange(1, 5), len(t)),
    ], axis=1)  # fmt: skip
    np.savetxt(path, table, fmt="%.7g", delimiter=",", header=",".join(COLUMNS), comments="")
    return Truth(
        kind=kind, seed=seed, path=str(path), effects=(Hidden(kind, "", {}),), channel=None,
        surfaces=(Surface(0.0, math.nan, math.nan, math.nan),), noise_floor=ADHESION_STD,
        rmse_before=math.nan, excess=(), fresh=None, judge=_NoJudge(t),
        conditions={"bends": bends},
    )  # fmt: skip


@dataclass(frozen=True)
class _NoJudge:
    """The true extended model of a car has no c1..c3 to fit."""

    t: Floats

    def errors(self, inside: Any) -> tuple[float, float]:
        raise NotImplementedError

    def errors_on(self, other: Any) -> tuple[float, float]:
        raise NotImplementedError

    def floor(self, inside: Any) -> float:
        raise NotImplementedError


def static_loads(p: Any) -> Floats:
    """On the scales: front left and right, rear left and right, N."""
    front = 9.81 * (p.m_s * p.b / (p.a + p.b) + p.m_uf) / 2
    rear = 9.81 * (p.m_s * p.a / (p.a + p.b) + p.m_ur) / 2
    return np.array([front, front, rear, rear])


def _drive(rng: np.random.Generator, duration_s: float, *, bends: bool) -> Iterator[list[float]]:
    """Rows of time, speed, slips, forces and loads (4 each), with nothing measured yet."""
    simulator = load_simulator()
    p, x = simulator.parameters, simulator.start(float(rng.uniform(14, 20)))
    mode, end, target, period, begin = 1, 0.0, 0.0, 1.0, 0.0
    swing, pace = (rng.uniform(0.005, 0.025), rng.uniform(3, 9)) if bends else (0.0, 1.0)
    every = round(ROW_S / STEP_S)
    for step in range(round(duration_s / STEP_S)):
        t, v = step * STEP_S, x[3]
        if t >= end or (mode > 0 and v > SPEEDS[1]) or (mode < 0 and v < SPEEDS[0]):
            mode = -1 if v > SPEEDS[1] - 5 else 1 if v < SPEEDS[0] + 4 else int(rng.choice((-1, 1)))
            begin, end = t, t + rng.uniform(1.5, 4)
            target, period = float(np.exp(rng.uniform(np.log(0.03), np.log(0.3)))), end - t
        wanted = target * math.sin(math.pi * min((t - begin) / period, 1.0)) ** 2
        steer = swing * math.sin(2 * math.pi * t / pace)
        slip = [p.R_w * w / v - 1 for w in x[WHEELS]]
        # The wheels of the harder worked axle are held at the slip wanted.
        worked = max(mode * s for s in slip)
        u = [20.0 * (steer - x[2]), mode * float(np.clip(120.0 * (wanted - worked), 0.0, 11.0))]
        rates = simulator.rates(x, u, p)
        if step % every == 0:
            yield [t, v, *slip, *_forces(rates, u[1], v, p), *_loads(x, p)]
        half = simulator.rates([a + STEP_S * b for a, b in zip(x, rates, strict=True)], u, p)
        x = [a + STEP_S * 0.5 * (b + c) for a, b, c in zip(x, rates, half, strict=True)]


def _forces(rates: list[float], acceleration: float, v: float, p: Any) -> list[float]:
    """Longitudinal force of each tyre, N, from the balance of its wheel."""
    limit = p.longitudinal.a_max * min(1.0, p.longitudinal.v_switch / v)
    torque = p.m * p.R_w * min(acceleration, limit)
    front = p.T_sb if acceleration <= 0 else p.T_se
    shares = (front, front, 1 - front, 1 - front)
    pairs = zip(rates[WHEELS], shares, strict=True)
    return [(0.5 * share * torque - p.I_y_w * rate) / p.R_w for rate, share in pairs]


def _loads(x: list[float], p: Any) -> list[float]:
    """Load of each tyre from its deflection, N; the roll of the axles is small but not none."""

    def side(z: float, roll: float, track: float, sign: float) -> float:
        deflection = z + p.R_w * (math.cos(roll) - 1) + sign * 0.5 * track * math.sin(roll)
        return max(float(deflection * p.K_zt), 1.0)

    front, rear = (x[16], x[13], p.T_f), (x[21], x[18], p.T_r)
    return [side(*front, -1), side(*front, 1), side(*rear, -1), side(*rear, 1)]
