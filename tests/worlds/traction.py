"""Wheelsets on a rail with curves of any form, for controllers: explicit Euler, no line of ours.

Steps of 0.2 ms; the vehicle is so heavy that its speed is given.
"""

import numpy as np

INERTIA, RADIUS, LOAD = 200.0, 0.625, 245e3
STEP_S, SLICE = 0.01, 50


class Wheelsets:
    """Axles that pull at a given speed.

    Args:
        curves: Function of time that gives a curve for all axles, or a list with one each.
        speed: Speed of the vehicle, m/s, or a function of time.

    """

    def __init__(self, curves, speed=10.0, *, seed=1, load=LOAD, axles=6):
        self.curves = curves
        self.speed_at = speed if callable(speed) else (lambda _: speed)
        self.rng = np.random.default_rng(seed)
        self.load = np.broadcast_to(np.asarray(load, dtype=float), (axles,)).copy()
        self.t_s = 0.0
        self.rim = np.full(axles, self.speed_at(0.0))
        self.effort = np.zeros(axles)
        self.used = np.zeros(axles)
        self.reading = 0

    def step(self, demand):
        """A cycle of 10 ms with the demanded efforts, which lag by 5 ms."""
        for _ in range(SLICE):
            dt = STEP_S / SLICE
            speed = self.speed_at(self.t_s)
            self.effort += (np.nan_to_num(demand) - self.effort) * dt / 0.005
            slip = (self.rim - speed) / max(speed, 0.2)
            self.used = _adhesion(self.curves(self.t_s), slip)
            self.rim = self.rim + dt * RADIUS**2 / INERTIA * (self.effort - self.used * self.load)
            self.t_s += dt
        self.slip = (self.rim - speed) / max(speed, 0.2)

    def measured(self):
        """Speed (every second cycle), rim speeds, efforts with the noise of sensors."""
        self.reading += 1
        speed = self.speed_at(self.t_s) + 0.01 * self.rng.standard_normal()
        rim = self.rim + 0.002 * self.rng.standard_normal(len(self.rim))
        effort = self.effort + 2450.0 * self.rng.standard_normal(len(self.rim))
        return (max(speed, 0.0) if self.reading % 2 else None), rim, effort


def _adhesion(curves, slip):
    """Adhesion of each axle by its own curve; one call where all have the same."""
    if callable(curves):
        return curves(slip)
    return np.array([float(curve(x)) for curve, x in zip(curves, slip, strict=True)])


def burckhardt(c1, c2, c3):
    """The curve of the paper, odd in the slip."""

    def curve(slip):
        size = np.minimum(np.abs(slip), 1.0)
        return np.sign(slip) * (c1 * (1.0 - np.exp(-c2 * size)) - c3 * size)

    return curve


def tangent(top, place, fall):
    """A curve of another form, x/(1 + x²): its fall beyond the peak is a share of that."""

    def curve(slip):
        size = np.minimum(np.abs(slip), 1.0)
        bent = 2.0 * (size / place) / (1.0 + (size / place) ** 2)
        beyond = np.where(size < place, bent, 1.0 - fall + fall * bent)
        return np.sign(slip) * top * beyond

    return curve
