"""A drive at a constant speed with slips that a test sets: kinematics alone, no train, no curve."""

import numpy as np

from adhesion_can.estimation.observed_speed.filter import ObservedSpeedFilter
from adhesion_can.physics.vehicle import Locomotive

STEP_S = 0.01
LOAD, RADIUS = 245e3, 0.625


class StraightDrive:
    """One drive with its filter; the effort follows from `adhesion` and who is relieved."""

    def __init__(self, seed=0, speed=15.0, radius_error=(0.0,) * 6, adhesion=0.12, settings=None):
        self.rng = np.random.default_rng(seed)
        self.speed = speed
        self.radius_error = np.array(radius_error)
        self.adhesion = adhesion
        self.slip = np.full(6, 0.006)
        self.relieved = None
        self.t = 0.0
        self.filter = ObservedSpeedFilter(Locomotive(), settings)
        self._ramp = np.ones(6)

    def run(self, duration_s, gnss=None):
        """Let time pass; returns what the filter states at its end.

        Args:
            duration_s: s.
            gnss: A speed each second, m/s; None: there is none.
        """
        for _ in range(round(duration_s / STEP_S)):
            goal = np.ones(6)
            if self.relieved is not None:
                goal[self.relieved] = 0.0
            self._ramp += np.clip(goal - self._ramp, -0.07, 0.07)
            rim = self.speed * (1 + self.slip * self._ramp**3)
            omega = rim / (RADIUS * (1 + self.radius_error)) + self.rng.normal(0, 0.003, 6)
            effort = self.adhesion * self._ramp * LOAD + self.rng.normal(0, 0.01 * LOAD, 6)
            second = round(self.t / STEP_S) % 100 == 0
            shown = None if gnss is None else np.array([gnss if second else np.nan])
            stated = self.filter.update(
                STEP_S, omega[None], effort[None], np.full((1, 6), LOAD), shown
            )
            self.t += STEP_S
        return stated

    def relieve(self, axle):
        """Relieve an axle for a second, and let it pull again."""
        self.relieved = axle
        self.run(1.0)
        self.relieved = None
        return self.run(1.0)

    def error(self, stated):
        """Error of each slip while all axles pull."""
        return stated.slip[0] - self.slip
