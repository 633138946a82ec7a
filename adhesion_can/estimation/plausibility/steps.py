"""Steps of all axles at once, and the curve from before one."""

from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.burckhardt import CurveParameters, adhesion, slip_at

STEPS = 12
"""Number of cycles of wheels, adhesion, slips and loads in which steps are looked for."""
EDGE = 3
"""Number of cycles on either side of a step whose means are compared."""
GAP = 2
"""Number of cycles between them, within which a step happens."""
EVEN, MOST_AXLES = 0.05, 0.65
"""Distance from the median step, as a share of it, within which axles made the same step, and share
of the axles that did."""
ROLLING = 0.15
"""Slip over that of the curve below which pulled wheels roll as if they were free."""
RAMP_SHARE = 0.15
"""Change within either side, as a share of the step, below which it is a step and no ramp."""
LEAST_EFFORT_STEP, EFFORT_RAMP_SHARE = 0.05, 0.25
"""Step of the adhesion of all axles that is looked at, and change within either side, as a share of
it, below which it is a step and no ramp."""
LEAST_AXLES = 3
"""Number of axles that agree on a step by no chance."""
STANDING = 0.01
"""Rim speed over vehicle speed below which a wheel stands still."""
ABSURD = 0.3
"""Step of a wheel speed within a cycle, as a share, that no wheelset makes."""
LEAST_ANSWER = 0.0015
"""Slip below which no answer to a step of the efforts can be asked for."""
ANSWERED = 0.4
"""Share of the answer that is asked for by which wheels or vehicle have answered."""
OFF_CURVE = 0.015
"""Distance from the curve that a step of all wheels adds, and that no curve explains."""


class Window(NamedTuple):
    """The latest cycles of the axles that are received; a row a cycle, the oldest first.

    Attributes:
        rim: Rim speed r ω of each axle, m/s, shape (STEPS, n).
        adhesion: Adhesion coefficient, shape (STEPS, n).
        slip: Slip ratio, shape (STEPS, n).
        load: Axle load, N, shape (STEPS, n).
        speed: Vehicle speed, m/s, shape (STEPS,).

    """

    rim: Array
    adhesion: Array
    slip: Array
    load: Array
    speed: Array

    def select(self, axles: NDArray[np.bool_]) -> "Window":
        """Some of the axles; shape (n,)."""
        rim, adhesion, slip, load, speed = self
        return Window(rim[:, axles], adhesion[:, axles], slip[:, axles], load[:, axles], speed)


def after(column: Array) -> Array:
    """Mean of the latest `EDGE` cycles."""
    # Not `mean`, whose checks cost more than the sum, at every update.
    return np.asarray(np.add.reduce(column[-EDGE:]) / EDGE)


def before(column: Array) -> Array:
    """Mean of as many cycles, `GAP` before those."""
    return np.asarray(np.add.reduce(column[-2 * EDGE - GAP : -EDGE - GAP]) / EDGE)


class CurveBefore(NamedTuple):
    """The curve from before a step.

    Attributes:
        theta: (c1, c2, c3).
        mu_max: Largest adhesion, 1.
        lambda_m: Slip ratio of it, 1.

    """

    theta: CurveParameters
    mu_max: float
    lambda_m: float

    def distance(self, mu: Array, slip: Array) -> float:
        """Median distance of axles from the curve, 1; arrays of shape (n,)."""
        return float(np.median(mu - adhesion(slip, *self.theta)))

    def slip_at(self, mu: Array) -> Array:
        """Slip of the rising branch with these adhesions, that of its top beyond; shape (n,)."""
        top = adhesion(self.lambda_m, *self.theta)
        return slip_at(np.clip(mu, -top, top), *self.theta, self.lambda_m)


class Asked(NamedTuple):
    """A step of the efforts whose answer is awaited.

    Attributes:
        cycles: Cycles since the step was seen.
        curve: The curve from before it.
        adhesion: Adhesion of the axles before it, shape (n,).
        slip: Slip of the axles before it, shape (n,).

    """

    cycles: int
    curve: CurveBefore
    adhesion: Array
    slip: Array

    def is_answered(self, mu: Array, slip: Array) -> bool:
        """Whether slips have moved as the curve says, or nothing shows it.

        Args:
            mu: Adhesion of the axles after the step, shape (n,).
            slip: Slip ratio of the axles after it, shape (n,).

        """
        if len(slip) != len(self.slip):
            return True
        wanted = float(np.median(self.curve.slip_at(mu) - self.curve.slip_at(self.adhesion)))
        got = float(np.median(slip - self.slip))
        return abs(wanted) < LEAST_ANSWER or got * float(np.sign(wanted)) > ANSWERED * abs(wanted)


def is_wheel_jump(window: Window, curve: CurveBefore | None, least: float) -> bool:
    """Whether most wheel speeds made a step that no wheelset makes.

    That is one large factor on all wheels, or wheels that are pulled and roll as if they were free.
    A small factor may be a rail that changed under all axles at once.

    Args:
        window: The latest cycles.
        curve: The curve from before the step; None where none is known.
        least: Least step, as a share of the wheel speed.

    """
    old, new = before(window.rim), after(window.rim)
    turning = old > STANDING * before(window.speed)
    if not turning.all():
        # A wheel that stood still before hides nothing of the others.
        if np.count_nonzero(turning) < LEAST_AXLES:
            return False
        window = window.select(turning)
        old, new = old[turning], new[turning]
    moved = abs(median((new / old).tolist()) - 1.0)
    if moved < least / 2.0:
        return False
    step = new * before(window.speed) / (after(window.speed) * old) - 1.0
    common = float(np.median(step))
    size = abs(common)
    if moved < size / 2.0:
        return False  # it was the vehicle speed that moved
    # Some axle may be moving along the curve by itself.
    most = MOST_AXLES * len(step)
    is_even = np.count_nonzero(np.abs(step - common) <= EVEN * size) >= most
    if size < least or (is_even and size > ABSURD):
        return size >= least
    one_way = np.count_nonzero(step * common > 0.5 * size * size) >= most
    if curve is None or not one_way or not _is_flat(window.rim, size):
        return False
    mu, slip = after(window.adhesion), after(window.slip)
    off = abs(curve.distance(mu, slip))
    along = float(np.median(slip * np.sign(mu)))
    rolls = along < ROLLING * float(np.median(np.abs(curve.slip_at(mu))))
    off -= abs(curve.distance(before(window.adhesion), before(window.slip)))
    return off > OFF_CURVE and rolls


def _is_flat(rim: Array, size: float) -> bool:
    """Whether wheels run on evenly on both sides of a step."""
    later = np.abs(rim[-1] - rim[-EDGE]) / after(rim)
    earlier = np.abs(rim[-EDGE - GAP - 1] - rim[-2 * EDGE - GAP]) / before(rim)
    return max(float(np.median(later)), float(np.median(earlier))) <= RAMP_SHARE * size


def is_effort_step(window: Window) -> bool:
    """Whether the efforts of all axles made a step one way, and stand there."""
    mu = window.adhesion
    step = after(mu) - before(mu)
    if not ((step > LEAST_EFFORT_STEP).all() or (step < -LEAST_EFFORT_STEP).all()):
        return False
    later = abs(float((mu[-1] - mu[-EDGE]).mean()))
    earlier = abs(float((mu[-EDGE - GAP - 1] - mu[-2 * EDGE - GAP]).mean()))
    return max(later, earlier) < EFFORT_RAMP_SHARE * abs(float(step.mean()))
