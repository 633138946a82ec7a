"""The plausibility watch: what the readings of all signals together cannot be.

A rail changes under one axle after the other, wheels differ in load and so in slip, a vehicle of
hundreds of tonnes moves as its forces say, and a wheel that is pulled harder slips more. What
contradicts that is an instrument, whatever curve fits its numbers afterwards:

- the vehicle speed leaves its course by a step, or by a change of its rate, while the adhesion
  forces and the wheels do not (`SPEED_JUMP`, `SPEED_DEVIATES`);
- all wheels jump by one factor within a cycle and run on evenly (`WHEELS_JUMP`);
- all efforts jump, and neither slips nor the vehicle answer (`EFFORTS_JUMP`); all loads jump
  (`LOADS_JUMP`), or are far from the static ones (`LOADS_OFF`).

After a jump nobody knows what the readings mean, so the objection holds until they agree with the
curve from before it, or coasting shows that wheels and vehicle run alike. How far a speed leaves
its course on a sound drive is learned from the drive.
"""

from collections import deque
from math import copysign, inf, isfinite, sqrt

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.plausibility.agreement import Agreement
from adhesion_can.estimation.plausibility.course import COURSE, MEMORY, Course, extrapolation
from adhesion_can.estimation.plausibility.mass_share import MassShare
from adhesion_can.estimation.plausibility.settings import PlausibilitySettings
from adhesion_can.estimation.plausibility.steps import (
    ANSWERED,
    EDGE,
    LEAST_AXLES,
    STEPS,
    Asked,
    CurveBefore,
    Window,
    after,
    before,
    is_effort_step,
    is_wheel_jump,
)
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import GRAVITY, Locomotive
from adhesion_can.values import Stateful

WINDOWS = ((40, 6), (60, 25), (75, 50))
"""Cycles on which a course rests, and those after them: for steps, then for changes of the rate."""
LEAST_KNOWN = 200
"""Number of cycles from which the drive has shown how far its speed leaves its course."""
FOLLOWED = 0.5
"""Share of the deviation of the vehicle speed that the wheels follow where the vehicle moves so."""
LEAST_SPEED_JUMP = 0.002
"""Deviation of the vehicle speed that is reported at least, as a share of it."""
OUTER_JERK = 1.5
"""Jerk of a vehicle alone by other forces than those of its driven wheels, m/s³: by its friction
brakes, or a coupled vehicle. A train has less by the vehicle's share of its mass, since brakes
apply one vehicle after the other."""
LEAST_WHEEL_JUMP = 0.003
"""Step of most wheel speeds that is reported at least, as a share of them."""
ANSWER_CYCLES = 10
"""Number of cycles that wheels are given to answer a step of the efforts."""
TELLING = 4.0
"""Answer of the vehicle, in standard deviations, above which it is none by chance, while there is
time to wait for more."""
LOADS_JUMPED = 0.15
"""Step of the sum of the axle loads, as a share, that no vehicle makes."""
ABSURD = 100.0
"""Adhesion from which a sample has none."""
LONGEST_GAP_CYCLES = 5.0
"""Pause, in usual cycles, after which a course starts again."""
HISTORY = 15
"""Number of updates by which the curve from before a step is older than its objection."""


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
        self._speeds = Course(COURSE, 3)
        self._steps = Course(STEPS, 4 * axles)
        self._axles = axles
        self._latest: Array = np.full((4, axles), np.nan)
        self._age = [STEPS] * axles
        self._live: list[int] = []
        """Places of the axles with a sample in the latest cycles."""
        self._load_share = 1.0
        """Sum of their loads over the static ones."""
        self._now_us = 0
        self._cycle_s = inf
        self._travelled = 0.0
        self._square = [0.0] * len(WINDOWS)
        self._answer_square = [0.0] * len(WINDOWS)
        self._white = 0.0
        """Variance of the white noise of the vehicle speed, (m/s)²."""
        self._known = 0
        self._before: deque[Estimate | None] = deque(maxlen=HISTORY)
        self._agreement = Agreement()
        self._share = MassShare(sum(vehicle.axle_load) / GRAVITY / vehicle.train_mass)
        self._asked: Asked | None = None
        self._looks = False
        """Whether a step is looked for at this update: at every other one."""
        self.jump = Objection.NONE
        """The objection by a jump that stands."""

    @property
    def waits(self) -> bool:
        """Whether it waits for the answer to a step of the efforts."""
        return self._asked is not None

    @property
    def earlier(self) -> Estimate | None:
        """The estimate from before what the latest updates may show; None where there was none."""
        return self._before[0] if self._before else None

    @property
    def _curve(self) -> CurveBefore | None:
        """The curve from before, where its peak was known."""
        known = self.earlier
        if known is None or not known.identifiable.both:
            return None
        return CurveBefore(known.theta, known.mu_max, known.lambda_m)

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
                # The objection is withdrawn, and courses start again.
                self.jump = Objection.NONE
                self._speeds.clear()
                self._steps.clear()
                self._before.clear()
        else:
            # By the time that a step of the efforts is judged, later curves have learned of it.
            asked = self._asked
            self.jump = self._find_jump()
            if self.jump is not Objection.NONE:
                self._agreement.begin(self._curve if asked is None else asked.curve)
                self._asked = None
        if self.jump is not Objection.NONE:
            return self.jump
        if self.waits:
            return Objection.EFFORTS_JUMP
        if not self._settings.least_load <= self._load_share <= self._settings.most_load:
            return Objection.LOADS_OFF
        return Objection.NONE

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
        # No number at all where it is absurd: products of it would overflow.
        latest[1, place] = np.where(np.abs(samples.adhesion) < ABSURD, samples.adhesion, np.nan)
        latest[2, place] = samples.slip
        latest[3, place] = samples.load
        self._age = [age + 1 for age in self._age]
        for axle in place.tolist():
            self._age[axle] = 0
        speed = samples.speed.item(-1)
        live = self._live = [i for i, age in enumerate(self._age) if age < EDGE]
        rim, mu, _, load = latest.tolist()
        weight = sum([load[i] for i in live])
        static = sum([self._static[i] for i in live])
        self._load_share = weight / static if static > 0.0 else 1.0
        if self._speeds.count and weight > 0.0:
            force = sum([mu[i] * load[i] for i in live])
            self._travelled += seconds * force * GRAVITY / weight
        rims = sorted([rim[i] for i in live])
        course = (speed, rims[len(rims) // 2], self._travelled)
        if all(map(isfinite, course)):
            self._speeds.add(course)
        else:
            self._travelled = 0.0
            self._speeds.clear()
        self._steps.add(latest.ravel())
        self._before.append(estimate)

    # ------------------------------------------------------------------------------- jumps

    def _find_jump(self) -> Objection:
        """Objection by the latest rows; NONE where they are sound."""
        # A step is in the gap between both sides for more than one update; a question counts them.
        self._looks = not self._looks
        if self._steps.is_full and (self._looks or self.waits):
            objection = self._find_step()
            if objection is not Objection.NONE:
                return objection
        return self._find_deviation() if self._speeds.is_full else Objection.NONE

    def _find_deviation(self) -> Objection:
        """Whether the vehicle speed leaves its course, and neither forces nor wheels do."""
        # Numbers: for three windows faster than arrays of them.
        deviations = (_WEIGHTS @ self._speeds.rows).tolist()
        weight = 1.0 / min(self._known + 1, MEMORY)
        least = LEAST_SPEED_JUMP * self._speeds.rows.item(-1, 0)
        jolt = OUTER_JERK * min(self._share.value, 1.0) * _JERK_CYCLES2 * self._cycle_s**2
        older, old, new = self._speeds.rows[-3:, 0].tolist()
        white = (new - 2.0 * old + older) ** 2 / 6.0
        if self._known >= LEAST_KNOWN:
            white = min(white, _SPIKE * self._white)
        self._white += weight * (white - self._white)
        squares: list[float] = []
        for number, (speed, wheels, force) in enumerate(deviations):
            moved = self._share.largest * force
            rest = speed - min(max(speed, min(moved, 0.0)), max(moved, 0.0))
            # Where the forces explain everything nothing is left, and that is no measure of noise.
            chance = max(self._square[number], self._white * _OF_WHITE[number])
            limit = self._settings.alarm**2 * chance
            if self._known >= LEAST_KNOWN:
                followed = wheels * copysign(1.0, rest) >= FOLLOWED * abs(rest)
                floor = max(least, jolt) if number == 0 else least
                if rest * rest > max(limit, floor * floor) and not followed:
                    return Objection.SPEED_JUMP if number == 0 else Objection.SPEED_DEVIATES
                # What is far out counts as half of that: it may be the beginning of a fault.
                squares.append(min(rest * rest, limit / 4.0))
            else:
                squares.append(rest * rest)
        answers = [(speed - self._share.value * force) ** 2 for speed, _, force in deviations]
        self._square = _averaged(self._square, squares, weight)
        self._answer_square = _averaged(self._answer_square, answers, weight)
        self._known += 1
        speed, _, force = deviations[-1]
        self._share.add(speed, force)
        return Objection.NONE

    def _find_step(self) -> Objection:
        """Whether all wheels, all efforts or all loads made a step at once."""
        live = self._live
        rows = self._steps.rows.reshape(STEPS, 4, self._axles)[:, :, live]
        known = len(live) >= LEAST_AXLES and self._speeds.count >= STEPS
        if not known or not np.isfinite(rows).all():
            self._asked = None
            return Objection.NONE
        rim, adhesion, slip, load = rows.transpose(1, 0, 2)
        window = Window(rim, adhesion, slip, load, self._speeds.rows[-STEPS:, 0])
        curve = self._curve
        chance = self._settings.alarm * sqrt(self._square[0]) / window.speed.item(-1)
        if is_wheel_jump(window, curve, max(LEAST_WHEEL_JUMP, chance)):
            return Objection.WHEELS_JUMP
        loads = float(after(window.load).sum() / before(window.load).sum())
        if abs(loads - 1.0) > LOADS_JUMPED:
            return Objection.LOADS_JUMP
        return self._efforts_jumped(window, curve)

    def _efforts_jumped(self, window: Window, curve: CurveBefore | None) -> Objection:
        """Whether all efforts made a step that nothing answers; that takes some cycles to see."""
        asked = self._asked
        if asked is None:
            if curve is not None and is_effort_step(window):
                asked = Asked(0, curve, before(window.adhesion), window.slip[0].copy())
                if not asked.is_answered(after(window.adhesion), after(window.slip)):
                    self._asked = asked
            return Objection.NONE
        asked = self._asked = asked._replace(cycles=asked.cycles + 1)
        if asked.cycles == ANSWER_CYCLES:
            if asked.is_answered(after(window.adhesion), after(window.slip)):
                self._asked = None
        elif asked.cycles >= WINDOWS[2][1]:
            self._asked = None
            if not self._is_driven(2, 0.0):
                return Objection.EFFORTS_JUMP
        elif asked.cycles >= WINDOWS[1][1] and self._is_driven(1, TELLING):
            self._asked = None
        return Objection.NONE

    def _is_driven(self, number: int, sigmas: float) -> bool:
        """Whether the vehicle moves as the forces since a step say; not where nothing shows it.

        Args:
            number: Number of the window, as long as the time since the step.
            sigmas: Answer, in standard deviations of such answers, below which it may be chance.

        """
        if not self._speeds.is_full:
            return False
        speed, _, force = (_WEIGHTS[number] @ self._speeds.rows).tolist()
        expected = self._share.value * force
        answer = speed * copysign(1.0, expected)
        least = sigmas * sqrt(self._answer_square[number])
        return bool(answer > max(ANSWERED * abs(expected), least))


def _averaged(old: list[float], new: list[float], weight: float) -> list[float]:
    """Running averages with new values of this weight."""
    return [average + weight * (value - average) for average, value in zip(old, new, strict=True)]


_WEIGHTS = extrapolation(COURSE, WINDOWS)
_OF_WHITE = (_WEIGHTS**2).sum(axis=1).tolist()
"""Variance of the deviations by white noise of variance 1."""
_SPIKE = 16.0
"""Most that one reading counts for the white noise, in its variances: a spike is no noise."""
_CYCLES = np.arange(COURSE)
_JERK_CYCLES2 = max(abs(_WEIGHTS[0] @ np.maximum(_CYCLES - k, 0) ** 2 / 2) for k in range(COURSE))
"""Largest deviation in the window for steps by a jerk of 1 that sets in, in squares of a cycle."""
