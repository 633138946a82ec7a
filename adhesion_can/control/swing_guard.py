"""Creep speeds that swing about their setpoints: one slip for all, less bandwidth, a slow climb.

A loop with more dead time than it was laid out for swings, most of all where slips change quickly
and beyond the peak: wheel speeds that come late, a slow drive. Then pairs at two slips show no
slope. What helps is one steady slip, where the contact itself damps, and less bandwidth. The slip
climbs slowly by perturb and observe: over a second a late signal hardly counts. It looks for the
largest mean adhesion times 1 - λ, the part that moves the train, and so stays before the peak.
"""

from math import exp

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.control.inputs import Measurement
from adhesion_can.control.settings import SwingSettings


class SwingGuard:
    """Whether creep speeds swing, and what is held where they do.

    Args:
        settings: Limits and times.
        cycle_s: Time between two steps, s.

    """

    def __init__(self, settings: SwingSettings, cycle_s: float) -> None:
        self._settings, self._cycle_s = settings, cycle_s
        self._error = self._left_s = self._waits_s = self._calm_s = 0.0
        self._hold_s = settings.hold_s
        self.bandwidth_share = 1.0
        """Factor of the loop's bandwidth for now."""
        self.slip = 0.0
        """Slip ratio that all axles are to have while `holds`."""
        self._begin_step()
        self._up = True
        self._before = 0.0

    @property
    def holds(self) -> bool:
        """Whether one slip is held."""
        return self._left_s > 0.0

    def step(self, measured: Measurement, setpoint: Array, creep: Array, slip: float) -> None:
        """Judge a step, and move the slip where one is held.

        Args:
            measured: Measured state.
            setpoint: Creep speed that each axle was to have, m/s, shape (axles,).
            creep: Creep speed of each axle, m/s, shape (axles,); NaN: unknown, and left out.
            slip: Median of the axles' slip ratios that were to be held.

        """
        s = self._settings
        self._left_s -= self._cycle_s
        self._waits_s -= self._cycle_s
        if not self.holds:
            self.bandwidth_share = 1.0
        known = np.isfinite(creep) & (setpoint > 0.0)
        if not known.any():
            return
        relative = np.abs(creep[known] - setpoint[known]) / setpoint[known]
        error = float(np.minimum(relative, 1.0).mean())
        self._error += (error - self._error) * self._cycle_s / s.time_constant_s
        if self._error > s.error_max and self._waits_s <= 0.0:
            self._back_off(slip)
        elif self.holds:
            self._climb(float((measured.effort / measured.load)[known].mean()))
        else:
            # As much time without swings as the next hold would last halves it again.
            self._calm_s += self._cycle_s
            if self._calm_s >= self._hold_s:
                self._hold_s = max(0.5 * self._hold_s, s.hold_s)
                self._calm_s = 0.0

    def _back_off(self, slip: float) -> None:
        s = self._settings
        if self.holds:
            self._move_slip(s.back_off)
            self.bandwidth_share = max(s.back_off * self.bandwidth_share, s.bandwidth_min)
        else:
            self.slip, self.bandwidth_share = slip, s.bandwidth_first
            self._left_s = self._hold_s
            self._hold_s *= 2.0
            self._calm_s = 0.0
        # What was lowered needs a while to show.
        self._error, self._waits_s = 0.0, s.time_constant_s
        self._begin_step()
        self._up, self._before = True, 0.0

    def _begin_step(self) -> None:
        self._used = self._steps = 0.0

    def _climb(self, adhesion: float) -> None:
        s = self._settings
        self._steps += 1.0
        # The first half of the time belongs to the way from one slip to the next.
        if self._steps * self._cycle_s > s.climb_s / 2:
            self._used += adhesion * (1.0 - self.slip)
        if self._steps * self._cycle_s < s.climb_s:
            return
        if self._used < self._before:
            self._up = not self._up
        self._before = self._used
        self._move_slip(exp(s.climb if self._up else -s.climb))
        self._begin_step()

    def _move_slip(self, factor: float) -> None:
        s = self._settings
        self.slip = min(max(factor * self.slip, s.slip_min), s.slip_max)
