"""Mean adhesion and slip of each axle over a span of steps."""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.control.inputs import Measurement

LEAST = 1e-3
"""Smallest adhesion and slip ratio, whose logarithms are taken."""


class MeanAdhesion:
    """Mean adhesion μ = (F − J ω̇/r)/N, whose inertial part follows from the span's two ends.

    Args:
        mass: Inertia of a wheelset at its rim, J/r², kg, shape (axles,).

    """

    def __init__(self, mass: Array) -> None:
        self._mass = mass
        self.restart()

    def restart(self, before: Measurement | None = None) -> None:
        """Start a new span.

        Args:
            before: Step before the first one of the span, at which its inertial part starts; None:
                the first one.

        """
        self._first = before
        self.steps = 0
        """Number of steps in the span."""
        self._used = np.zeros(len(self._mass))
        self._squares = np.zeros(len(self._mass))
        self._slip = np.zeros(len(self._mass))
        self._load = np.zeros(len(self._mass))

    def add(self, measured: Measurement, slip: Array) -> None:
        """Add a step with the slip ratio of each axle, shape (axles,)."""
        if self._first is None:
            self._first = measured
        self._last = measured
        self.steps += 1
        used = measured.effort / measured.load
        self._used += used
        self._squares += used**2
        self._load += measured.load
        self._slip += slip

    def adhesion(self) -> Array:
        """Mean adhesion of each axle, shape (axles,)."""
        if self._first is None:
            raise ValueError("there is no step in the span")
        span_s = self._last.time_s - self._first.time_s
        used = self._used / self.steps
        if span_s > 0.0:
            rise = (self._last.rim_speed - self._first.rim_speed) / span_s
            used = used - self._mass * rise * self.steps / self._load
        return np.asarray(np.maximum(used, LEAST))

    def standard_error(self) -> Array:
        """Standard error of the mean by the scatter of its steps, shape (axles,)."""
        mean = self._used / self.steps
        variance = np.maximum(self._squares / self.steps - mean**2, 0.0)
        return np.asarray(np.sqrt(variance / self.steps))

    def slip(self) -> Array:
        """Mean slip ratio of each axle, shape (axles,)."""
        return np.asarray(np.maximum(self._slip / self.steps, LEAST / 10))
