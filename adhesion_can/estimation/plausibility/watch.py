"""The plausibility watch: what the readings of all signals together cannot be.

A rail changes under one axle after the other, wheels differ in load and so in slip, a vehicle of
hundreds of tonnes moves as its forces say, and a wheel that is pulled harder slips more. What
contradicts that is an instrument, whatever curve fits its numbers afterwards:

- the vehicle speed leaves its course by a step, or by a change of its rate, while the adhesion
  forces and the wheels do not (`SPEED_JUMP`, `SPEED_DEVIATES`);
- all wheels jump by one factor within a cycle and run on evenly (`WHEELS_JUMP`);
- all efforts jump, and neither slips nor the vehicle answer (`EFFORTS_JUMP`); all loads jump
  (`LOADS_JUMP`), or are far from the static ones (`LOADS_OFF`).

After a jump nobody knows what the readings mean, so the objection stands until they agree with the
curve from before it, or coasting shows that wheels and vehicle run alike. How far a speed leaves
its course on a sound drive is learned from the drive.
"""

from collections import deque
from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.plausibility.agreement import Agreement
from adhesion_can.estimation.plausibility.course import Course, extrapolation
from adhesion_can.estimation.plausibility.settings import PlausibilitySettings
from adhesion_can.physics.burckhardt import CurveParameters, adhesion
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import GRAVITY, Locomotive
from adhesion_can.values import Stateful

WINDOWS = ((40, 6), (60, 25), (75, 50))
"""Cycles on which a course rests, and those after them: for steps, then for changes of the rate."""
COURSE = 125
"""Number of cycles of the course of the vehicle speed."""
LEAST_KNOWN = 200
"""Number of cycles from which the drive has shown how far its speed leaves its course."""
MEMORY = 3000.0
"""Number of cycles over which that is averaged."""
FOLLOWED = 0.5
"""Share of the deviation of the vehicle speed that the wheels follow where the vehicle moves so."""
FORCE_SLACK = 1.5
"""Factor on what the forces do to the vehicle that is still motion."""
LEAST_SPEED_JUMP = 0.002
"""Deviation of the vehicle speed that is told at least, as a share of it."""
STEPS = 12
"""Number of cycles of wheels, adhesion, slips and loads in which steps are looked for."""
EDGE = 3
"""Number of cycles on either side of a step whose means are compared."""
GAP = 2
"""Number of cycles between them, within which a step happens."""
LEAST_WHEEL_JUMP = 0.003
"""Step of most wheel speeds that is told at least, as a share of them."""
EVEN, MOST_AXLES = 0.05, 0.65
"""Distance from the median step, as a share of it, within which axles made the same step, and share
of the axles that did."""
ROLLING = 0.15
"""Slip over that of the curve below which pulled wheels roll as if they were free."""
FLAT = 0.15
"""Change within either side, as a share of the step, below which it is a step and no ramp."""
LEAST_AXLES = 3
"""Number of axles that agree on a step by no chance."""
ABSURD = 0.3
"""Step of a wheel speed within a cycle, as a share, that no wheelset makes."""
LEAST_EFFORT_JUMP = 0.03
"""Step of the adhesion of all axles that is looked at."""
ANSWER_CYCLES, FORCE_CYCLES = 10, 50
"""Number of cycles that wheels are given to answer a step of the efforts, and the vehicle."""
ANSWERED = 0.4
"""Share of the answer that is asked for by which wheels or vehicle have answered."""
LEAST_ANSWER = 0.0015
"""Slip below which no answer can be asked for."""
TELLING = 4.0
"""Answer of the vehicle, in standard deviations, below which none can be asked for."""
MASS_KNOWN = 5.0
"""Share of the forces that moves the vehicle, in standard deviations, from which it is known."""
OFF_CURVE = 0.03
"""Distance of the adhesion from the curve after a step of all wheels that no curve explains."""
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

    def slip_at(self, mu: Array) -> Array:
        """Slip of the rising branch with these adhesions, that of its top beyond; shape (n,)."""
        grid = np.linspace(0.0, self.lambda_m, 64)
        level = adhesion(grid, *self.theta)
        return np.asarray(np.copysign(np.interp(np.abs(mu), level, grid), mu))

    def is_answered(self, asked: "_Asked", mu: Array, slip: Array) -> bool:
        """Whether slips have moved as the curve says, or that cannot be told.

        Args:
            asked: The step.
            mu: Adhesion of the axles after it, 1, shape (n,).
            slip: Slip of the axles after it, 1, shape (n,).

        """
        wanted = float(np.median(self.slip_at(mu) - self.slip_at(asked.adhesion)))
        got = float(np.median(slip - asked.slip))
        return abs(wanted) < LEAST_ANSWER or got * np.sign(wanted) > ANSWERED * abs(wanted)


class _Asked(NamedTuple):
    """A step of the efforts whose answer is awaited.

    Attributes:
        cycles: Cycles since the step was seen.
        curve: The curve from before it.
        adhesion: Adhesion of the axles before it, shape (n,).
        slip: Slip of the axles before it, shape (n,).

    """

    cycles: int
    curve: _Before
    adhesion: Array
    slip: Array


class _Share(Stateful):
    """Share of the vehicle's own acceleration by its adhesion forces that the train follows.

    It is the vehicle's mass over the train's: regression of the deviations of the speed on those of
    the forces, which gradients and resistance leave alone.

    Args:
        configured: Share by the configured masses.

    """

    def __init__(self, configured: float) -> None:
        self._configured = configured
        self._square = self._product = self._rest = 0.0

    def add(self, speed: float, force: float) -> None:
        """Add the deviations of speed and forces of a cycle, m/s."""
        keep = 1.0 - 1.0 / MEMORY
        self._square = keep * self._square + force * force
        self._product = keep * self._product + speed * force
        self._rest = keep * self._rest + speed * speed

    @property
    def _is_known(self) -> bool:
        # Neighbouring cycles have a window in common: as many as it has count as one.
        return (
            self._product > 0.0
            and self._product**2
            > MASS_KNOWN**2 * COURSE * (self._rest * self._square - self._product**2) / MEMORY
        )

    @property
    def value(self) -> float:
        """The share, as the drive shows it; the configured one where it does not."""
        return self._product / self._square if self._is_known else self._configured

    @property
    def largest(self) -> float:
        """Largest share of the forces that is still motion."""
        return FORCE_SLACK * (self.value if self._is_known else 1.0)


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
        self._now_us = 0
        self._cycle_s = inf
        self._travelled = 0.0
        self._square = np.zeros(len(WINDOWS))
        self._known = 0
        self._before: deque[_Before | None] = deque(maxlen=HISTORY)
        self._agreement = Agreement()
        self._reference: _Before | None = None
        self._share = _Share(sum(vehicle.axle_load) / GRAVITY / vehicle.train_mass)
        self._asked: _Asked | None = None
        self.jump = Objection.NONE
        """The objection by a jump that stands."""

    @property
    def waits(self) -> bool:
        """Whether it waits for the answer to a step of the efforts."""
        return self._asked is not None

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
        if self.waits:
            return Objection.EFFORTS_JUMP
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
        speed, wheels, force = (_WEIGHTS @ self._speeds.rows).T
        moved = self._share.largest * force
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
        self._share.add(float(speed[-1]), float(force[-1]))
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
        if self._speeds.count >= STEPS and self._wheels_jumped(rows, after, before):
            return Objection.WHEELS_JUMP
        loads = float(after[3].sum() / before[3].sum()) if before[3].sum() > 0.0 else 1.0
        if abs(loads - 1.0) > LOADS_JUMPED:
            return Objection.LOADS_JUMP
        return self._efforts_jumped(rows, after, before)

    def _wheels_jumped(self, rows: Array, after: Array, before: Array) -> bool:
        """Whether most wheel speeds made one step, away from the curve."""
        if not before[0].min() > 0.0:
            return False
        speed = self._speeds.rows[-STEPS:, 0]
        old, new = speed[-2 * EDGE - GAP : -EDGE - GAP].mean(), speed[-EDGE:].mean()
        step = after[0] * old / (new * before[0]) - 1.0
        common = float(np.median(step))
        size = abs(common)
        if size < max(LEAST_WHEEL_JUMP, self._settings.alarm * sqrt(self._square.item(0)) / new):
            return False
        # Some axle may be moving along the curve by itself.
        most = MOST_AXLES * len(step)
        is_even = np.count_nonzero(np.abs(step - common) <= EVEN * size) >= most
        if is_even and size > ABSURD:
            return True
        curve = self._before[0] if self._before else None
        if curve is None or np.count_nonzero(step * common > 0.5 * size * size) < most:
            return False
        later = np.abs(rows[-1, 0] - rows[-EDGE, 0]) / after[0]
        earlier = np.abs(rows[-EDGE - GAP - 1, 0] - rows[-2 * EDGE - GAP, 0]) / before[0]
        if max(float(np.median(later)), float(np.median(earlier))) > FLAT * size:
            return False
        off = after[1] - np.copysign(adhesion(np.abs(after[2]), *curve.theta), after[2])
        if abs(float(np.median(off))) < OFF_CURVE:
            return False
        along = float(np.median(after[2] * np.sign(after[1])))
        asked = float(np.median(np.abs(curve.slip_at(after[1]))))
        return bool(is_even) or along < ROLLING * asked

    def _efforts_jumped(self, rows: Array, after: Array, before: Array) -> Objection:
        """Whether all efforts made a step that nothing answers; that takes some cycles to see."""
        asked = self._asked
        if asked is None:
            curve = self._before[0] if self._before else None
            step = after[1] - before[1]
            one_way = bool((step > LEAST_EFFORT_JUMP).all() or (step < -LEAST_EFFORT_JUMP).all())
            within = float(np.abs(rows[-1, 1] - rows[-EDGE, 1]).mean())
            if curve is not None and one_way and within < float(np.abs(step).mean()):
                self._asked = _Asked(0, curve, before[1], rows[0, 2].copy())
            return Objection.NONE
        asked = self._asked = asked._replace(cycles=asked.cycles + 1)
        if asked.cycles == ANSWER_CYCLES:
            known = len(asked.slip) == after.shape[1]
            if not known or asked.curve.is_answered(asked, after[1], after[2]):
                self._asked = None
        elif asked.cycles >= FORCE_CYCLES:
            self._asked = None
            if self._speeds.is_full and not self._is_driven():
                return Objection.EFFORTS_JUMP
        return Objection.NONE

    def _is_driven(self) -> bool:
        """Whether the vehicle moves as the forces of the last second say, or nobody can tell."""
        speed, _, force = (_WEIGHTS[-1] @ self._speeds.rows).tolist()
        expected = self._share.value * force
        if abs(expected) < TELLING * sqrt(self._square.item(-1)):
            return True
        return speed * np.sign(expected) > ANSWERED * abs(expected)

    def _load_share(self) -> float:
        """Sum of the axle loads over the static ones."""
        live = [i for i, age in enumerate(self._age) if age < EDGE]
        static = sum(self._static[i] for i in live)
        return float(sum(self._latest[3, i] for i in live)) / static if static > 0.0 else 1.0


_WEIGHTS = extrapolation(COURSE, WINDOWS)
