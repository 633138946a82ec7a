"""A controller that drives a plan: each axle gets the slip that the plan's step states.

    APPROACH  the train is brought to the speed at which the plan starts
    STEP n    the slips of a step are held by the creep speed control, in traction or in braking
    OVER      no effort is demanded any more

The limits of the plan hold whatever the steps say: the effort is cut off, an axle whose slip runs
away is released, and at the ends of the speed range nothing pulls or brakes beyond them.
"""

from dataclasses import replace

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.control.creep_loop import CreepLoop
from adhesion_can.control.inputs import Advice, KnownCurve, Measurement
from adhesion_can.control.settings import ControlSettings
from adhesion_can.control.speed_filter import SpeedFilter
from adhesion_can.physics.driving_plan import DrivingPlan, PlanStep
from adhesion_can.physics.vehicle import Locomotive

APPROACH = PlanStep(1.0, "traction", (0.01, 0.01)), PlanStep(1.0, "braking", (0.01, 0.01))
"""Steps by which the speed of the plan's start is approached from below and from above."""
NEAR_MPS = 0.5
"""Difference from the speed of the plan's start at which it starts, m/s."""
RUN_AWAY = 1.25
"""Slip over the plan's largest one from which an axle is released."""
SLIP_RATE = 0.3
"""Rate at which the slip goes over from one step to the next, 1/s: a jump would make the wheels
swing."""
LEAST_SLIP = 2e-4
"""Least slip that a controlled axle is to have: the stiffness of a contact without slip is none."""


class PlanFollower:
    """Efforts of all axles by a plan.

    Args:
        vehicle: Vehicle, whose wheelsets have an inertia.
        plan: Plan to drive.
        settings: Settings of the creep speed control; its cycle and gains are used.

    Raises:
        ValueError: The vehicle has fewer axles than the plan names, or wheelsets without inertia.

    """

    def __init__(
        self, vehicle: Locomotive, plan: DrivingPlan, settings: ControlSettings | None = None
    ) -> None:
        if plan.most_axle > vehicle.axles:
            raise ValueError(
                f"the plan uses axle {plan.most_axle}, but the vehicle has {vehicle.axles}"
            )
        if not vehicle.wheelset_inertia > 0.0:
            raise ValueError("the wheelsets have no inertia to control")
        given = settings or ControlSettings()
        mass = vehicle.wheelset_inertia / np.array(vehicle.wheel_radius) ** 2
        loop = replace(given.loop, effort_max=min(plan.limits.effort_max, given.loop.effort_max))
        self.plan = plan
        """Plan that is driven."""
        self._axles = vehicle.axles
        self._curve = KnownCurve(plan.curve, 1.0, 0.0, {})
        self._speed = SpeedFilter(given.speed_timeout_s)
        self._loop = CreepLoop(loop, mass)
        self._loop.bandwidth_share = plan.bandwidth_share
        self._cycle_s = loop.cycle_s
        self._sign = 1.0
        self._slip = np.zeros(vehicle.axles)
        self._rate = SLIP_RATE
        self._began_s: float | None = None
        self.step_number: int | None = None
        """Number of the step that is driven, from 0; None before the first and after the last."""
        self.is_over = False
        """Whether the last step has ended."""

    @property
    def sanding(self) -> bool:
        """Whether sand is to be strewn."""
        number = self.step_number
        return number is not None and self.plan.steps[number].sand

    @property
    def phase(self) -> str:
        """What is driven, for a reader."""
        if self.is_over:
            return "the plan has ended: no effort is demanded"
        number = self.step_number
        if number is None:
            return f"approaching {self.plan.start_speed:g} m/s, the start of the plan"
        return f"step {number + 1} of {len(self.plan.steps)}: {self.plan.steps[number].description}"

    def step(self, measured: Measurement, _advice: Advice) -> Array:
        """Effort to demand of each axle until the next cycle, N, shape (axles,).

        Args:
            measured: Measured state.

        """
        speed = self._speed.step(measured)
        if speed is None:  # the efforts are taken back
            self._slip = np.zeros(self._axles)
            return self._sign * self._loop.release()
        now = self._find_step(measured.time_s, speed)
        if now is None or now[0].sign == 0.0 or self._is_at_end_of_speeds(now[0], speed):
            return self._hold(None, 0.0, speed, measured.rim_speed - speed)
        return self._hold(*now, speed, measured.rim_speed - speed)

    def _find_step(self, time_s: float, speed: float) -> tuple[PlanStep, float] | None:
        """Step to drive now and the time since its start, s; None where nothing is to be driven."""
        if self._began_s is None:
            short = self.plan.start_speed - speed
            if abs(short) > NEAR_MPS:
                up, down = APPROACH
                if short > 0.0:
                    return up, 0.0
                # Where the limits exclude braking, the train coasts.
                return (down, 0.0) if self.plan.limits.braking else None
            self._began_s = time_s
        place = self.plan.step_at(time_s - self._began_s)
        self.step_number = None if place is None else place[0]
        self.is_over = place is None
        return None if place is None else (self.plan.steps[place[0]], place[1])

    def _is_at_end_of_speeds(self, step: PlanStep, speed: float) -> bool:
        limits = self.plan.limits
        too_fast = step.sign > 0.0 and speed >= limits.speed_max
        return too_fast or (step.sign < 0.0 and speed <= limits.speed_min)

    def _hold(self, step: PlanStep | None, elapsed_s: float, speed: float, creep: Array) -> Array:
        """Efforts that bring the axles to the slips of a step; None: to coasting."""
        wanted = np.zeros(self._axles)
        if step is not None:
            if step.sign != self._sign and not self._slip.any():
                self._sign = step.sign
            if step.sign == self._sign:
                wanted = np.nan_to_num(self._sign * step.slips(elapsed_s, self._axles))
                self._rate = max(SLIP_RATE, step.slip_rate)
        most = self._rate * self._cycle_s
        self._slip = self._slip + np.clip(wanted - self._slip, -most, most)
        creep = self._sign * creep
        running_away = creep > RUN_AWAY * self.plan.limits.slip_max * speed
        # An axle whose creep is unknown to the loop gets its effort taken back.
        creep = np.where((self._slip > 0.0) & ~running_away, creep, np.nan)
        held = np.maximum(self._slip, LEAST_SLIP)
        return self._sign * self._loop.step(held * speed, creep, self._curve.elasticity(held))
