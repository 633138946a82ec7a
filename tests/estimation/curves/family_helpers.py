"""Samples of curves by formulas of the tests' own, with errors of slip and adhesion."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from adhesion_can.physics.samples import Samples

AXLES = 4
Law = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Adhesion of slips, not negative, at speeds, m/s."""


def burckhardt(c1: float = 0.41, c2: float = 33.0, c3: float = 0.38, c4: float = 0.0) -> Law:
    """Burckhardt's curve, with its fall by creep speed."""
    return lambda s, v: (c1 * (1 - np.exp(-c2 * s)) - c3 * s) * np.exp(-c4 * s * v)


def polach(mu0: float = 0.4, stiffness: float = 90.0, left: float = 0.4, rate: float = 0.4) -> Law:
    """Polach's saturation with friction that falls with creep speed, without loads."""

    def law(s: np.ndarray, v: np.ndarray) -> np.ndarray:
        f = mu0 * ((1 - left) * np.exp(-rate * s * v) + left)
        x = stiffness * s / f
        return 2 * f / np.pi * (0.6 * x / (1 + (0.6 * x) ** 2) + np.arctan(0.25 * x))

    return law


def top(law: Law, speed: float) -> tuple[float, float]:
    """Height and slip ratio of the peak at a speed."""
    s = np.geomspace(1e-3, 0.4, 20_000)
    mu = law(s, np.full_like(s, speed))
    return float(mu.max()), float(s[mu.argmax()])


def make_samples(
    law: Law,
    rng: np.random.Generator,
    seconds: float,
    *,
    begin_s: float = 0.0,
    slip_std: float = 0.002,
    noise: float = 0.01,
    reach: float = 0.15,
) -> Samples:
    """Samples of sweeps in traction and braking, 50 a second and axle.

    Args:
        law: Curve.
        rng: Random numbers.
        seconds: Duration, s.
        begin_s: Time of the first sample, s.
        slip_std: Standard deviation of the slip's error.
        noise: Standard deviation of the adhesion's error.
        reach: Largest slip ratio.

    """
    t = begin_s + np.arange(round(50 * seconds)) / 50
    rows = np.repeat(t, AXLES)
    axle = np.tile(np.arange(1, AXLES + 1), len(t))
    direction = np.where(np.sin(2 * np.pi * rows / 23.0) >= 0.0, 1.0, -1.0)
    size = reach * np.sin(2 * np.pi * rows / 7.0 + axle) ** 2
    speed = 11.0 + 5.0 * np.sin(2 * np.pi * rows / 41.0)
    slip = direction * size + slip_std * rng.standard_normal(len(rows))
    adhesion = direction * law(size, speed) + noise * rng.standard_normal(len(rows))
    stamps = np.round(rows * 1e6).astype(np.int64)
    one = np.ones(len(rows))
    return replace(
        Samples.curve(slip, adhesion, stamps),
        axle=axle.astype(np.int64),
        creep_speed=slip * speed,
        speed=speed,
        load=2.2e5 * one,
        slip_var=slip_std**2 * one,
        adhesion_var=noise**2 * one,
    )
