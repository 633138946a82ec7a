"""Creep controllers beside which ours is measured; they see the same frames as it does.

All but the threshold hold a slip or a creep speed by the same plain PI controller, with the limits
of effort and rate of ours. None of them reads the service's messages. Each has a setting by which
it trades force for slip: `USUAL`, and `OTHERS` for its front of both.
"""

import numpy as np

from adhesion_can.control.creep_loop import CreepLoop
from adhesion_can.control.settings import LoopSettings
from adhesion_can.control.speed_filter import SpeedFilter

CYCLE_S = 0.01


class _HoldsCreep:
    """Holds a creep speed that the class decides on."""

    name = ""

    def __init__(self, vehicle):
        mass = vehicle.wheelset_inertia / np.array(vehicle.wheel_radius) ** 2
        self.axles = vehicle.axles
        self.slip = None
        """Slip ratio that was wanted last."""
        self._speed = SpeedFilter(1.0)
        self._loop = CreepLoop(LoopSettings(), mass)

    def step(self, measured, _advice):
        speed = self._speed.step(measured)
        if speed is None:
            return self._loop.release()
        wanted = self.creep_speed(measured, speed)
        self.slip = wanted / max(speed, 1.0)
        return self._loop.step(
            np.broadcast_to(wanted, (self.axles,)), measured.rim_speed - speed, 0.0
        )


class Oracle(_HoldsCreep):
    """Knows the slip of every axle's peak, `lambda_m`, which the bench tells it."""

    name = "oracle"
    lambda_m = None

    def creep_speed(self, _measured, speed):
        return self.lambda_m * max(speed, 1.0)


class FixedSlip(_HoldsCreep):
    """PI on a fixed slip ratio."""

    name = "fixed slip"
    USUAL, OTHERS = 0.05, (0.08,)

    def __init__(self, vehicle, setting=USUAL):
        super().__init__(vehicle)
        self._slip = setting

    def creep_speed(self, _measured, speed):
        return self._slip * max(speed, 1.0)


class ConstantCreep(_HoldsCreep):
    """PI on a fixed creep speed, m/s."""

    name = "fixed creep"
    USUAL, OTHERS = 0.4, (0.65,)

    def __init__(self, vehicle, setting=USUAL):
        super().__init__(vehicle)
        self._creep = setting

    def creep_speed(self, _measured, _speed):
        return self._creep


class PerturbAndObserve(_HoldsCreep):
    """Changes the slip of all axles by 12 % each half second; turns where the effort fell.

    Its setting is the price of the slip: it looks for the largest effort times 1 - price · slip.
    """

    name = "perturb and observe"
    USUAL, OTHERS = 0.0, (1.0,)

    def __init__(self, vehicle, setting=USUAL):
        super().__init__(vehicle)
        self._price = setting
        self._slip, self._factor = 0.02, 1.12
        self._sum = self._count = 0.0
        self._before = None
        self._since_s = 0.0

    def creep_speed(self, measured, speed):
        age_s = measured.time_s - self._since_s
        if age_s > 0.2:
            self._sum += measured.effort.sum() * (1.0 - self._price * self._slip)
            self._count += 1
        if age_s >= 0.5:
            effort = self._sum / max(self._count, 1)
            if self._before is not None and effort < self._before:
                self._factor = 1.0 / self._factor
            self._before, self._since_s = effort, measured.time_s
            self._sum = self._count = 0.0
            self._slip = min(max(self._slip * self._factor, 0.004), 0.4)
        return self._slip * max(speed, 1.0)


class SteepestGradient(_HoldsCreep):
    """Extremum seeking: a sine on the slip, the gradient by a regression that forgets.

    Its setting is the price of the slip, as in perturb and observe.
    """

    name = "steepest gradient"
    USUAL, OTHERS = 0.0, (1.0,)
    PERIOD_S, MEMORY_S, SIZE = 1.2, 1.5, 0.1

    def __init__(self, vehicle, setting=USUAL):
        super().__init__(vehicle)
        self._price = setting
        self._slip = 0.015
        self._means = np.zeros(4)
        self._steps = 0

    def creep_speed(self, measured, speed):
        scale = max(speed, 1.0)
        slip = (measured.rim_speed - speed).mean() / scale
        adhesion = measured.effort.sum() / measured.load.sum()
        if not self._steps:
            self._means[:2] = slip, adhesion
        share = CYCLE_S / self.MEMORY_S
        means = self._means
        means[:2] += share * (np.array([slip, adhesion]) - means[:2])
        away = np.array([slip, adhesion]) - means[:2]
        means[2:] += share * (away[0] * away - means[2:])
        self._steps += 1
        if self._steps > 100:
            slope = means[3] / (means[2] + 1e-7) - self._price * means[1]
            pace = np.clip(0.6 * slope * self._slip / 0.02, -1.0, 1.0)
            self._slip = min(max(self._slip * (1.0 + CYCLE_S * pace), 0.004), 0.4)
        else:
            self._slip += 0.02 * CYCLE_S
        wave = np.sin(2.0 * np.pi * measured.time_s / self.PERIOD_S)
        return self._slip * (1.0 + self.SIZE * wave) * scale


class Threshold:
    """What most locomotives have: effort is cut back at a creep speed, then rises along a ramp."""

    name = "threshold"
    USUAL, OTHERS = 0.6, (1.0,)
    CUT, HOLD_S, RAMP = 0.25, 0.3, 25e3
    slip = None

    def __init__(self, vehicle, setting=USUAL):
        self._creep = setting
        self._effort = np.zeros(vehicle.axles)
        self._until_s = np.zeros(vehicle.axles)
        self._speed = SpeedFilter(1.0)

    def step(self, measured, _advice):
        speed = self._speed.step(measured)
        if speed is None:
            self._effort[:] = 0.0
            return self._effort
        creep, now_s = measured.rim_speed - speed, measured.time_s
        slips = (creep > self._creep) & (now_s > self._until_s)
        self._until_s = np.where(slips, now_s + self.HOLD_S, self._until_s)
        ramp = np.where(creep < 0.8 * self._creep, self.RAMP, 0.3 * self.RAMP) * CYCLE_S
        rising = np.where(now_s > self._until_s, self._effort + ramp, self._effort)
        wanted = np.where(slips, (1.0 - self.CUT) * self._effort, rising)
        self._effort = np.minimum(wanted, LoopSettings().effort_max)
        return self._effort


RIVALS = (FixedSlip, ConstantCreep, Threshold, PerturbAndObserve, SteepestGradient)
