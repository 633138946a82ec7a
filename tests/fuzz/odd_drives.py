"""Drives that nobody means to record: logs and tables with odd physics, stamps and rows.

Unlike mutants of bytes they pass the readers, and meet what is computed from them.
"""

import random

import numpy as np

from adhesion_can.recordings.candump import format_frame
from tests.wire import Bench, axles

NAMES = ("WheelSpeeds1", "WheelSpeeds2", "VehicleSpeed", "TractiveEffort1", "TractiveEffort2",
         "AxleLoads1", "AxleLoads2")  # fmt: skip
CYCLES_US = dict.fromkeys(NAMES, 10_000) | {"VehicleSpeed": 20_000, "AxleLoads1": 200_000,
                                            "AxleLoads2": 200_000}  # fmt: skip
RADIUS = 0.625
COURSES = ("swept", "steady", "coasting", "braking", "standing", "locked", "spinning")
LOADS = (245e3, 245e3, 245e3, 0.0, 10.0, 655_340.0)
SPEEDS = (10.0, 10.0, 3.0, 0.0, 0.9, 60.0, 131.0)


def odd_log(number):
    """Candump text of an odd drive of some seconds."""
    rng = random.Random(f"log {number}")
    seconds = rng.choice((0.0, 0.05, 1.0, 3.0, 6.0, 12.0, 12.0))
    course, speed, load = rng.choice(COURSES), rng.choice(SPEEDS), rng.choice(LOADS)
    noise, gain = rng.choice((0.0, 0.001, 0.05)), rng.choice((1.0, 1.0, 1.0, -1.0, 3.0, 0.0))
    names = [name for name in NAMES if rng.random() > 0.02]
    only = rng.choice((None, None, None, 1, 6))
    bench, frames = Bench(), []
    for t_us in range(0, round(seconds * 1e6), 10_000):
        slip, adhesion, v = _point(course, speed, t_us / 1e6)
        for name in names:
            if t_us % CYCLES_US[name]:
                continue
            signals = _signals(name, slip, gain * adhesion, v, load, only)
            noisy = {k: _within(k, x * (1 + noise * rng.gauss(0, 1))) for k, x in signals.items()}
            frames.append(bench.frame(name, 10**9 + t_us, **noisy))
    return "".join(map(format_frame, _stamped(frames, rng))).encode()


def _point(course, speed, t_s):
    """Slip, adhesion and vehicle speed at a time."""
    swept = 0.1 * (1 - np.cos(2 * t_s))
    slip = {"swept": swept, "steady": 0.02, "coasting": 0.0, "braking": -swept, "standing": 0.0,
            "locked": -1.0, "spinning": 5.0}[course]  # fmt: skip
    size = 0.4 * (1 - np.exp(-60 * abs(slip))) - 0.3 * abs(slip)
    v = 0.0 if course == "standing" else max(speed + (0.3 * t_s if course == "swept" else 0.0), 0)
    return float(slip), float(np.sign(slip) * size), float(v)


def _signals(name, slip, adhesion, speed, load, only):
    if name == "VehicleSpeed":
        return {"VehicleSpeed": speed, "VehicleSpeedSource": 1}
    places = [axle for axle in axles(name) if only in (None, axle)]
    if name.startswith("WheelSpeeds"):
        return {f"WheelSpeed_Ax{i}": speed * (1 + slip) / RADIUS for i in places}
    if name.startswith("TractiveEffort"):
        return {f"TractiveEffort_Ax{i}": adhesion * load for i in places}
    return {f"AxleLoad_Ax{i}": load for i in places}


LIMITS = {"WheelSpeed": (0, 131), "VehicleSpeed": (0, 131), "TractiveEffort": (-327e3, 327e3),
          "AxleLoad": (0, 655_330)}  # fmt: skip
"""What the signals can carry."""


def _within(name, value):
    low, high = LIMITS.get(name.partition("_")[0], (0, 1))
    return min(max(value, low), high)


def _stamped(frames, rng):
    """Frames with stamps of every kind."""
    way = rng.randrange(14)
    if way == 0:
        return [frame._replace(t_us=0) for frame in frames]
    if way == 1:
        return frames[::-1]
    if way == 2:
        return [f._replace(t_us=f.t_us % 500_000) for f in frames]
    if way == 3:
        return [f._replace(t_us=f.t_us if n < len(frames) // 2 else f.t_us + 10**15)
                for n, f in enumerate(frames)]  # fmt: skip
    if way == 4:
        return [f._replace(t_us=f.t_us * rng.choice((1, 1000)) // 1000) for f in frames]
    if way == 5:
        return rng.sample(frames, len(frames))
    if way == 6:
        return frames + frames
    return frames


def odd_table(number):
    """CSV of an odd table of samples."""
    rng = random.Random(f"table {number}")
    rows = rng.choice((0, 1, 2, 5, 19, 20, 60, 400))
    time_s = 0.02 * np.arange(rows)
    gauss = np.random.default_rng(number)
    slip = gauss.uniform(-0.15, 0.15, rows)
    mu = np.sign(slip) * (0.4 * (1 - np.exp(-60 * np.abs(slip))) - 0.3 * np.abs(slip))
    columns = {"time_s": time_s, "slip": slip, "speed_mps": 10 + 0.01 * np.arange(rows)}
    if rng.random() < 0.5:
        columns["adhesion"] = mu + gauss.normal(0, 0.01, rows)
    else:
        columns |= {"longitudinal_force_N": 6e4 * mu, "normal_load_N": np.full(rows, 6e4)}
    if rng.random() < 0.3:
        columns["axle"] = np.arange(rows) % 3 + 1
    if rng.random() < 0.5:
        columns["temperature"] = gauss.normal(20, 5, rows)
    for _ in range(rng.choice((0, 1, 1, 2, 3))):
        name = rng.choice(list(columns))
        columns[name] = _odd_column(columns[name], rng, gauss)
    if rng.random() < 0.1:
        columns.pop(rng.choice(list(columns)))
    order = np.arange(rows)
    if rng.random() < 0.2:
        order = gauss.permutation(rows)
    texts = [",".join(columns)]
    texts += [",".join(_text(column[row]) for column in columns.values()) for row in order]
    return ("\n".join(texts) + "\n").encode()


def _odd_column(column, rng, gauss):
    """A column that is constant, empty, scaled, stuck, of another sign or of odd numbers."""
    rows = len(column)
    if column.dtype == object:
        return column
    ways = (
        lambda: np.zeros(rows),
        lambda: np.full(rows, rng.choice((1.0, -1.0, 1e-12, 1e12, np.nan, np.inf))),
        lambda: np.abs(column),
        lambda: -column,
        lambda: column * rng.choice((100.0, 1e-3, 1e6, 3.6)),
        lambda: np.where(gauss.random(rows) < 0.3, np.nan, column),
        lambda: np.where(np.arange(rows) > rows // 2, column[:1].sum(), column),
        lambda: column[::-1],
        lambda: np.round(column, 1),
        lambda: column + rng.choice((1e9, 1.7e12, -5.0)),
        lambda: gauss.permutation(column),
        lambda: np.repeat(column[: rows // 4 + 1], 4)[:rows],
        lambda: np.array([rng.choice(("dry", "wet", "#N/A")) for _ in range(rows)], object),
    )
    return rng.choice(ways)()


def _text(cell):
    return cell if isinstance(cell, str) else f"{cell:.6g}"
