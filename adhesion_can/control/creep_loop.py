"""Creep speed control of the axles: efforts from creep speed setpoints.

A PI controller in its velocity form, so that limits of effort and rate need no anti-windup. The
contact is stiff on the stable side of the curve, the stiffer the slower the train, and an
integrator at the peak. So the integral gain and a feedforward of setpoint changes follow the
elasticity e = d ln F/d ln λ: stiffness dF/dw = e F/w at the creep speed w.
"""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.control.settings import LoopSettings

CREEP_MIN = 1e-3
"""Smallest creep speed in the stiffness, m/s."""
EFFORT_MIN = 5e3
"""Smallest effort in the stiffness, N, so that a train at rest starts to pull."""
CHANGE_MAX = 0.5
"""Largest logarithm of a setpoint's change that is fed forward at once."""


class CreepLoop:
    """Creep speed control of all axles.

    Args:
        settings: Gains and limits.
        mass: Inertia of a wheelset at its rim, J/r², kg, shape (axles,).

    """

    def __init__(self, settings: LoopSettings, mass: Array) -> None:
        self._settings = settings
        self._full_gain = settings.bandwidth * mass
        self.bandwidth_share = 1.0
        """Share of the bandwidth that is used."""
        self._error = np.zeros(len(mass))
        self._setpoint: Array | None = None
        self.effort: Array = np.zeros(len(mass))
        """Effort demanded of each axle, N, shape (axles,)."""

    def step(self, setpoint: Array, creep: Array, elasticity: Array | float) -> Array:
        """Efforts of the next cycle, N, shape (axles,).

        Args:
            setpoint: Creep speed that each axle is to have, m/s, shape (axles,).
            creep: Creep speed of each axle, m/s, shape (axles,); NaN: unknown, and the effort is
                taken back.
            elasticity: Elasticity of the curve at the setpoint.

        """
        s = self._settings
        setpoint = np.maximum(setpoint, CREEP_MIN)
        known = np.isfinite(creep)
        error = np.where(known, setpoint - creep, 0.0)
        stiffness = np.clip(elasticity, 0.0, 1.0) * np.maximum(self.effort, EFFORT_MIN) / setpoint
        gain, share = self.bandwidth_share * self._full_gain, self.bandwidth_share
        integral = share * (s.integral_rate * gain + s.stable_rate * stiffness)
        change = gain * (error - self._error) + integral * s.cycle_s * error
        if self._setpoint is not None:
            step = np.clip(np.log(setpoint / self._setpoint), -CHANGE_MAX, CHANGE_MAX)
            change += self.effort * np.clip(elasticity, 0.0, 1.0) * step
        self._error, self._setpoint = error, setpoint
        change = np.where(known, change, -s.fall_max * s.cycle_s)
        change = np.clip(change, -s.fall_max * s.cycle_s, s.rise_max * s.cycle_s)
        self.effort = np.clip(self.effort + change, 0.0, s.effort_max)
        return self.effort

    def release(self) -> Array:
        """Efforts of the next cycle where there is nothing to control by: they are taken back."""
        s = self._settings
        self.effort = np.maximum(self.effort - s.fall_max * s.cycle_s, 0.0)
        self._error, self._setpoint = np.zeros_like(self.effort), None
        return self.effort
