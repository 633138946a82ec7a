"""A driving plan: steps with the slips that the axles are to have, within limits.

A plan says what to drive so that explanations of earlier drives can be distinguished. Its steps end
by time alone, so that it is known beforehand at which time of the drive which step is driven.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite
from typing import Annotated, Literal

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.ranges import Within, require_ranges

Mode = Literal["traction", "braking", "coast"]

LONGEST_PLAN_S = 3600.0
"""Longest duration of a plan, s."""
ROUND_OFF = 1e-9
"""Excess over a limit that is round-off."""


@dataclass(frozen=True, slots=True)
class PlanLimits:
    """Limits within which a plan may drive.

    Attributes:
        effort_max: Largest effort of an axle, N. Less keeps the slips below those of the peak on a
            dry rail, which shows less of the curve.
        slip_max: Largest slip ratio, 1.
        speed_min: Lowest vehicle speed, m/s; braking ends there.
        speed_max: Highest vehicle speed, m/s; traction ends there.
        duration_max: Longest duration of a plan, s.
        braking: Whether axles may brake electrically.
        single_axles: Whether some axles may pull while the others idle.
        sand: Whether sand may be strewn.

    """

    effort_max: Annotated[float, Within(1, 1e7)] = 120e3
    slip_max: Annotated[float, Within(1e-4, 1)] = 0.2
    speed_min: Annotated[float, Within(0.01, 200)] = 3.0
    speed_max: Annotated[float, Within(0.02, 200)] = 25.0
    duration_max: Annotated[float, Within(1, LONGEST_PLAN_S)] = 120.0
    braking: bool = True
    single_axles: bool = True
    sand: bool = True

    def __post_init__(self) -> None:
        require_ranges(self)
        if not self.speed_max > self.speed_min:
            raise ValueError("speed_max must be above speed_min")


@dataclass(frozen=True, slots=True)
class PlanStep:
    """A part of a plan.

    Attributes:
        duration_s: Duration, s.
        mode: Direction of the efforts; no axle pulls or brakes in 'coast'.
        slip: Slip ratio, without its sign, at the start and at the end; with `period_s` at the ends
            of the sweeps.
        period_s: Duration of a sweep from the first slip to the second and back, s; 0: the slip
            changes once, evenly over the step.
        stagger: Whether the axles are at different phases of the sweeps, which keeps the sum of
            their efforts steady.
        axles: Numbers of the axles that pull or brake, from 1; (): all of them.
        sand: Whether sand is strewn.

    """

    duration_s: float
    mode: Mode
    slip: tuple[float, float] = (0.0, 0.0)
    period_s: float = 0.0
    stagger: bool = False
    axles: tuple[int, ...] = ()
    sand: bool = False

    def __post_init__(self) -> None:
        if not (isfinite(self.duration_s) and self.duration_s > 0.0):
            raise ValueError("duration_s must be above 0")
        if not (isfinite(self.period_s) and self.period_s >= 0.0):
            raise ValueError("period_s must not be negative")
        if not all(isfinite(slip) and slip >= 0.0 for slip in self.slip):
            raise ValueError("slips have no sign; mode states the direction")
        if self.mode == "coast" and (max(self.slip) > 0.0 or self.axles):
            raise ValueError("no axle pulls or brakes in a step that coasts")
        if self.mode != "coast" and max(self.slip) == 0.0:
            raise ValueError("a step in traction or braking needs a slip above 0")
        if self.stagger and not self.period_s:
            raise ValueError("stagger needs period_s")
        if len(set(self.axles)) < len(self.axles) or min(self.axles, default=1) < 1:
            raise ValueError("axles must be different numbers from 1")

    @property
    def sign(self) -> float:
        """Sign of slips and efforts: 1 in traction, -1 in braking, 0 where the axles idle."""
        return {"traction": 1.0, "braking": -1.0, "coast": 0.0}[self.mode]

    @property
    def slip_rate(self) -> float:
        """Largest rate of change of the slip within the step, 1/s."""
        low, high = self.slip
        span = abs(high - low)
        return float(np.pi * span / self.period_s if self.period_s else span / self.duration_s)

    @property
    def description(self) -> str:
        """The step in words, a noun phrase."""
        if self.mode == "coast":
            what = "coasting"
        else:
            low, high = (f"{slip:.3g}" for slip in self.slip)
            held = f"slip {low}" if low == high else f"slip {low} to {high}"
            what = f"{self.mode}, {held}"
            if self.period_s:
                what += f" and back every {self.period_s:g} s"
            if self.axles:
                word = "axle" if len(self.axles) == 1 else "axles"
                what += f", {word} {', '.join(map(str, self.axles))} alone"
            elif self.stagger:
                what += ", the axles in turn"
        return what + (", with sand" if self.sand else "")

    def slips(self, elapsed_s: Array | float, axles: int) -> Array:
        """Slip ratio that each axle is to have, with its sign; NaN for an axle that idles.

        Args:
            elapsed_s: Time since the step's start, s; shape (n,) or one number.
            axles: Number of axles of the vehicle.

        Returns:
            Slip ratios, shape (n, axles) or (axles,).

        """
        elapsed = np.asarray(elapsed_s, dtype=np.float64)[..., None]
        active = np.array([not self.axles or axle in self.axles for axle in range(1, axles + 1)])
        if self.mode == "coast":
            return np.full((*elapsed.shape[:-1], axles), np.nan)
        if self.period_s:
            phase = elapsed / self.period_s
            if self.stagger:
                place = np.cumsum(active) - 1.0
                phase = phase + place / active.sum()
            # Without corners: a jump of the acceleration would look like a vibration.
            share = (1.0 - np.cos(2.0 * np.pi * phase)) / 2.0
        else:
            share = np.clip(elapsed / self.duration_s, 0.0, 1.0)
        low, high = self.slip
        slip = np.broadcast_to(low + (high - low) * share, (*elapsed.shape[:-1], axles))
        return np.where(active, self.sign * slip, np.nan)


@dataclass(frozen=True, slots=True)
class Prediction:
    """What an explanation predicts for a plan.

    Attributes:
        name: Name of the explanation.
        predicts: Sentence about what is measured if it holds.

    """

    name: str
    predicts: str


@dataclass(frozen=True, slots=True)
class DrivingPlan:
    """Steps one after another, and what they are for.

    Attributes:
        steps: Steps in the order in which they are driven.
        start_speed: Vehicle speed at which the first step starts, m/s.
        curve: Parameters (c1, c2, c3) of the expected adhesion curve, from which the controller
            takes the stiffness of the contact.
        limits: Limits that the plan respects.
        purpose: Sentence about what the plan is to distinguish.
        predictions: Predictions of the explanations.
        bandwidth_share: Share of the creep speed control's bandwidth that is used, above 0 and at
            most 1: signals that may be late need less.

    """

    steps: tuple[PlanStep, ...]
    start_speed: float
    curve: tuple[float, float, float] = (0.37, 60.0, 0.26)
    limits: PlanLimits = field(default_factory=PlanLimits)
    purpose: str = ""
    predictions: tuple[Prediction, ...] = ()
    bandwidth_share: float = 1.0

    def __post_init__(self) -> None:
        limits = self.limits
        if not 0.0 < self.bandwidth_share <= 1.0:
            raise ValueError("bandwidth_share must be above 0 and at most 1")
        if not self.steps:
            raise ValueError("a plan needs a step")
        if not limits.speed_min <= self.start_speed <= limits.speed_max:
            raise ValueError(
                f"start_speed must be within speed_min and speed_max, {limits.speed_min:g} to "
                f"{limits.speed_max:g} m/s"
            )
        c1, c2, c3 = self.curve
        if not (all(map(isfinite, self.curve)) and c1 > 0 and c3 >= 0 and c1 * c2 > c3):
            raise ValueError("curve must be c1, c2, c3 of a curve with a peak")
        if self.duration_s > limits.duration_max + ROUND_OFF:
            raise ValueError(f"the steps take longer than duration_max, {limits.duration_max:g} s")
        for number, step in enumerate(self.steps, start=1):
            why = _beyond(step, limits)
            if why:
                raise ValueError(f"step {number} {why}")

    @property
    def duration_s(self) -> float:
        """Duration of all steps, s."""
        return float(sum(step.duration_s for step in self.steps))

    @property
    def most_axle(self) -> int:
        """Largest axle number that a step names; 0 where none does."""
        return max((max(step.axles, default=0) for step in self.steps), default=0)

    def begins(self) -> Iterator[tuple[float, PlanStep]]:
        """Start of each step after that of the plan, s, and the step."""
        begin = 0.0
        for step in self.steps:
            yield begin, step
            begin += step.duration_s

    def step_at(self, elapsed_s: float) -> tuple[int, float] | None:
        """Number of the step from 0 and time since its start, s; None where the plan is over.

        Args:
            elapsed_s: Time since the plan's start, s.

        """
        for number, (begin, step) in enumerate(self.begins()):
            if elapsed_s < begin + step.duration_s:
                return number, elapsed_s - begin
        return None


def _beyond(step: PlanStep, limits: PlanLimits) -> str:
    """Limit that a step exceeds, as a predicate; '' where there is none."""
    if max(step.slip) > limits.slip_max + ROUND_OFF:
        return f"has a slip beyond slip_max, {limits.slip_max:g}"
    if step.mode == "braking" and not limits.braking:
        return "brakes, which the limits exclude"
    if step.axles and not limits.single_axles:
        return "lets axles idle, which the limits exclude (single_axles)"
    if step.sand and not limits.sand:
        return "uses sand, which the limits exclude"
    return ""
