"""The plausibility watch: what the readings of all signals together cannot be.

A rail changes under one axle after the other, wheels differ in load and so in slip, a vehicle of
hundreds of tonnes moves as its forces say, and a wheel that is pulled harder slips more. What
contradicts that is an instrument, whatever curve fits its numbers afterwards:

- the vehicle speed leaves its course by a step, or by a change of its rate, while the adhesion
  forces and the wheels do not (`SPEED_JUMP`, `SPEED_DEVIATES`);
- all wheels jump by one factor within a cycle and run on evenly (`WHEELS_JUMP`);
- all efforts jump, and no slip answers (`EFFORTS_JUMP`); all loads jump (`LOADS_JUMP`), or are far
  from the static ones (`LOADS_OFF`).

After a jump nobody knows what the readings mean, so the objection stands until they agree with the
curve from before it, or coasting shows that wheels and vehicle run alike. How far a speed leaves
its course on a sound drive is learned from the drive.
"""

from collections import deque
from collections.abc import Sequence
from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.plausibility.agreement import Agreement
from adhesion_can.estimation.plausibility.course import Course, extrapolation
from adhesion_can.estimation.plausibility.settings import PlausibilitySettings
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import GRAVITY, Locomotive
from adhesion_can.values import Stateful

WINDOWS = ((40, 6), (60, 25), (75, 50))
"""Cycles on which a course rests, and cycles after them: for steps, then for changes of the rate."""
COURSE = 125
"""Number of cycles of the course of the vehicle speed."""
LEAST_KNOWN = 200
"""Number of cycles from which the drive has shown how far its speed leaves its course."""
MEMORY = 3000.0
"""Number of cycles over which that is averaged."""
FOLLOWED = 0.5
"""Share of the deviation of the vehicle speed that the wheels follow where the vehicle moves so."""
FORCE_SLACK = 1.5
"""Factor on what the forces do to the vehicle alone, its wagons left out, that is still motion."""
LEAST_SPEED_JUMP = 0.002
"""Deviation of the vehicle speed that is told at least, as a share of it."""
STEPS = 12
"""Number of cycles of wheels, adhesion, slips and loads in which steps are looked for."""
EDGE = 3
"""Number of cycles on either side of a step whose means are compared."""
GAP = 2
"""Number of cycles between them, within which a step happens."""
LEAST_WHEEL_JUMP = 0.008
"""Step of all wheel speeds that is told at least, as a share of them."""
EVEN = 0.05
"""Spread over the axles, as a share of the step, below which a step is one factor."""
FLAT = 0.15
"""Change within either side, as a share of the step, below which it is a step and no ramp."""
LEAST_AXLES = 3
"""Number of axles that agree on a step by no chance."""
ABSURD = 0.3
"""Step of a wheel speed within a cycle, as a share, that no wheelset makes."""
LEAST_EFFORT_JUMP = 0.03
"""Step of the adhesion of all axles that is looked at."""
ANSWER_CYCLES = 10
"""Number of cycles that wheels are given to answer a step of the efforts."""
ANSWERED = 0.4
"""Share of the slip that the curve asks for by which wheels have answered."""
LEAST_ANSWER = 0.0015
"""Slip below which no answer can be asked for."""
LOADS_JUMPED = 0.15
"""Step of the sum of the axle loads, as a share, that no vehicle makes."""
LONGEST_GAP_CYCLES = 5.0
"""Pause, in usual cycles, after which a course begins anew."""
HISTORY = 15
"""Number of updates by which the curve from before a step is older than its objection."""


class _Before(NamedTuple):
    """The curve from before a step.

    Attributes:
        theta: (c1, c2, c3).
        mu_max: Largest adhesion, 1.
        lambda_m: Slip ratio of it, 1.

    """

    theta: CurveParameters
    mu_max: float
    lambda_m: float


class PlausibilityWatch(Stateful):
    """Watches the samples of a vehicle, update by update.

    Args:
        vehicle: Vehicle with its static loads.
        settings: Limits; None: the defaults.

    """

    def __init__(self, vehicle: Locomotive, settings: PlausibilitySettings | None = None) -> None:
        self._settings = settings or PlausibilitySettings()
        self._static = vehicle.axle_load
        axles = vehicle.axles
        self._weights = _WEIGHTS
        self._speeds = Course(COURSE, 3)
        self._steps = Course(STEPS, 4 * axles)
        self._axles = axles
        self._latest: Array = np.full((4, axles), np.nan)
        self._age = [STEPS] * axles
        self._now_us = 0
        self._cycle_s = inf
        self._travelled = 0.0
        self._square = np.zeros(len(WINDOWS))
        self._known = 0
        self._before: deque[_Before | None] = deque(maxlen=HISTORY)
        self._agreement = Agreement()
        self._reference: _Before | None = None
        self._asked: tuple[int, Array, Array] | None = None
        """Updates left for an answer, and adhesion and slip of the axles before the step."""
        self.jump = Objection.NONE
        """The objection by a jump that stands."""

    @property
    def suspects(self) -> bool:
        """Whether the samples are not to be used for now."""
        return self.jump is not Objection.NONE or self._asked is not None

    def add(self, samples: Samples, estimate: Estimate | None) -> Objection:
        """Look at the samples of an update.

        Args:
            samples: Samples as they were formed, at least one.
            estimate: Estimate from the samples before; None where there is none.

        Returns:
            The gravest objection.

        """
        self._take(samples, estimate)
        if self.jump is not Objection.NONE:
            if self._agreement.add(samples):
                self._forgive()
        else:
            self.jump = self._find_jump()
            if self.jump is not Objection.NONE:
                self._asked = None
                self._reference = self._before[0] if self._before else None
                reference = self._reference
                self._agreement.begin(
                    None if reference is None else reference.theta,
                    inf if reference is None else reference.lambda_m,
                    inf if reference is None else reference.mu_max,
                )
        if self.jump is not Objection.NONE:
            return self.jump
        share = self._load_share()
        if not self._settings.least_load <= share <= self._settings.most_load:
            return Objection.LOADS_OFF
        return Objection.NONE

    def _forgive(self) -> None:
        """Withdraw the objection by a jump; courses begin anew."""
        self.jump = Objection.NONE
        self._speeds.clear()
        self._steps.clear()
        self._before.clear()

    def _take(self, samples: Samples, estimate: Estimate | None) -> None:
        """Bring the courses to an update."""
        t_us = samples.t_us.item(-1)
        seconds = (t_us - self._now_us) * 1e-6
        self._now_us = t_us
        if seconds > LONGEST_GAP_CYCLES * self._cycle_s or seconds <= 0.0 or seconds > 5.0:
            self._speeds.clear()
            self._steps.clear()
            self._asked = None
        elif self._cycle_s == inf:
            self._cycle_s = seconds
        else:
            self._cycle_s += 0.05 * (seconds - self._cycle_s)
        place = samples.axle - 1
        latest = self._latest
        latest[0, place] = samples.speed + samples.creep_speed
        latest[1, place] = samples.adhesion
        latest[2, place] = samples.slip
        latest[3, place] = samples.load
        self._age = [age + 1 for age in self._age]
        for axle in place.tolist():
            self._age[axle] = 0
        speed = samples.speed.item(-1)
        live = [i for i, age in enumerate(self._age) if age < EDGE]
        forces = latest[1] * latest[3]
        weight = sum(latest[3, i] for i in live)
        if self._speeds.count:
            force = sum(forces[i] for i in live)
            self._travelled += seconds * force * GRAVITY / weight if weight > 0.0 else 0.0
        rims = sorted(latest[0, i] for i in live)
        self._speeds.add((speed, rims[len(rims) // 2], self._travelled))
        self._steps.add(latest.ravel())
        known = estimate is not None and estimate.identifiable.both
        self._before.append(
            _Before(estimate.theta, estimate.mu_max, estimate.lambda_m)
            if estimate is not None and known
            else None
        )

    # ------------------------------------------------------------------------------- jumps

    def _find_jump(self) -> Objection:
        """Objection by the latest rows; NONE where they are sound."""
        if self._steps.is_full:
            found = self._find_step()
            if found is not Objection.NONE:
                return found
        return self._find_deviation() if self._speeds.is_full else Objection.NONE

    def _find_deviation(self) -> Objection:
        """Whether the vehicle speed leaves its course, and neither forces nor wheels do."""
        speed, wheels, force = (self._weights @ self._speeds.rows).T
        moved = FORCE_SLACK * force
        unexplained = speed - np.clip(speed, np.minimum(moved, 0.0), np.maximum(moved, 0.0))
        followed = wheels * np.sign(unexplained) >= FOLLOWED * np.abs(unexplained)
        square = unexplained * unexplained
        known = self._known >= LEAST_KNOWN
        limit = self._settings.alarm**2 * self._square
        least = LEAST_SPEED_JUMP * self._speeds.rows[-1, 0]
        if known:
            alarms = (square > limit) & ~followed & (square > least * least)
            if alarms.any():
                return Objection.SPEED_JUMP if alarms[0] else Objection.SPEED_DEVIATES
            # What is far out counts as half of that: it may be the beginning of a fault.
            square = np.minimum(square, limit / 4.0)
        self._known += 1
        self._square += (square - self._square) / min(self._known, MEMORY)
        return Objection.NONE

    def _find_step(self) -> Objection:
        """Whether all wheels, all efforts or all loads made a step at once."""
        live = [i for i, age in enumerate(self._age) if age < EDGE]
        if len(live) < LEAST_AXLES:
            return Objection.NONE
        rows = self._steps.rows.reshape(STEPS, 4, self._axles)[:, :, live]
        after, before = rows[-EDGE:].mean(axis=0), rows[-2 * EDGE - GAP : -EDGE - GAP].mean(axis=0)
        if not np.isfinite(after).all() or not np.isfinite(before).all():
            return Objection.NONE
        old, new = self._speeds.rows[[-EDGE - GAP - 2, -2], 0].tolist()
        if self._speeds.count >= STEPS and self._wheels_jumped(
            rows[:, 0], after[0], before[0], new / old
        ):
            return Objection.WHEELS_JUMP
        loads = float(after[3].sum() / before[3].sum()) if before[3].sum() > 0.0 else 1.0
        if abs(loads - 1.0) > LOADS_JUMPED:
            return Objection.LOADS_JUMP
        return self._efforts_jumped(rows, after, before)

    def _wheels_jumped(self, rims: Array, after: Array, before: Array, moved: float) -> bool:
        """Whether all wheel speeds made one step."""
        if not before.min() > 0.0:
            return False
        step = after / (moved * before) - 1.0
        size = abs(float(step.mean()))
        if size < LEAST_WHEEL_JUMP or (step * step.mean() <= 0.0).any():
            return False
        if float(np.ptp(step)) > EVEN * size:
            return False
        within = max(
            float(np.abs(rims[-1] - rims[-EDGE]).max() / max(after.max(), before.max())),
            float(np.abs(rims[-EDGE - GAP - 1] - rims[-2 * EDGE - GAP]).max() / before.max()),
        )
        return within < FLAT * size or size > ABSURD

    def _efforts_jumped(self, rows: Array, after: Array, before: Array) -> Objection:
        """Whether all efforts made a step that no wheel answers; it takes some cycles to see."""
        curve = self._before[0] if self._before else None
        if self._asked is not None:
            left, mu_before, slip_before = self._asked
            self._asked = (left - 1, mu_before, slip_before) if left > 1 else None
            if left > 1 or curve is None or len(slip_before) != after.shape[1]:
                return Objection.NONE
            return self._judge_answer(curve, after, mu_before, slip_before)
        step = after[1] - before[1]
        same_way = bool((step > LEAST_EFFORT_JUMP).all() or (step < -LEAST_EFFORT_JUMP).all())
        if same_way and curve is not None:
            size = float(np.abs(step).mean())
            within = float(np.abs(rows[-1, 1] - rows[-EDGE, 1]).mean())
            if within < size:
                self._asked = (ANSWER_CYCLES, before[1], rows[0, 2].copy())
        return Objection.NONE

    def _judge_answer(
        self, curve: _Before, after: Array, mu_before: Array, slip_before: Array
    ) -> Objection:
        c1, c2, c3 = curve.theta
        # On the rising branch of the curve from before; above its top the slip must at least pass
        # that of the top.
        grid = np.linspace(0.0, curve.lambda_m, 64)
        level = c1 * -np.expm1(-c2 * grid) - c3 * grid

        def slip_at(mu: Array) -> Array:
            return np.asarray(np.copysign(np.interp(np.abs(mu), level, grid), mu))

        asked = float(np.median(slip_at(after[1]) - slip_at(mu_before)))
        got = float(np.median(after[2] - slip_before))
        if abs(asked) < LEAST_ANSWER or got * np.sign(asked) > ANSWERED * abs(asked):
            return Objection.NONE
        return Objection.EFFORTS_JUMP

    def _load_share(self) -> float:
        """Sum of the axle loads over the static ones."""
        live = [i for i, age in enumerate(self._age) if age < EDGE]
        static = sum(self._static[i] for i in live)
        return float(sum(self._latest[3, i] for i in live)) / static if static > 0.0 else 1.0

    @property
    def spread(self) -> Sequence[float]:
        """Standard deviation of how far the speed leaves its course, m/s, by the windows."""
        return [sqrt(one) for one in self._square.tolist()]


_WEIGHTS = extrapolation(COURSE, WINDOWS)
