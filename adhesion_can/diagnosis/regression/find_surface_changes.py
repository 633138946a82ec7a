"""Where the rail changed: a nuisance here, and not to be confused with what effects do.

Candidates come from the segmentation that `identify` uses. A change is kept only where nothing else
explains it: the sum of squares without it must be larger even when every effect of the library may
help, to first order. A change of the rail is sudden and large; what an effect does over a drive
looks like many small ones.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import Course
from adhesion_can.diagnosis.regression.gram_matrices import solve
from adhesion_can.diagnosis.regression.model import (
    EXCLUDED,
    Candidate,
    Model,
    Study,
    Theta,
    curve_slopes,
    evaluate,
    signature,
)
from adhesion_can.estimation.batch_fit import SegmentationSettings, change_points, fit
from adhesion_can.physics import burckhardt
from adhesion_can.physics.samples import Samples

SETTINGS = SegmentationSettings(chunk_s=0.2, shortest_s=6.0, penalty=4.0, noise_gain=0.05)
EXPLAINED = 0.04
"""Share by which the sum of squares must rise without a change for it to be kept."""
MOST_ROWS = 6_000
AROUND_S = 2.0
"""Rows so close to a change are left out: each axle finds it at a time of its own."""
PASSES = 3
FEWEST = 10


def samples_of(course: Course, rows: NDArray[np.int64] | slice = slice(None)) -> Samples:
    """Rows of a course as samples, in the order of their stamps within each axle."""
    seen = course.observe()
    plain = Samples.curve(seen.slip[rows], seen.adhesion[rows])
    t_us = np.round(course.t_s[rows] * 1e6).astype(np.int64)
    return replace(plain, t_us=t_us, axle=course.axle[rows], speed=seen.speed[rows])


def changes(course: Course, candidates: tuple[Candidate, ...]) -> list[float]:
    """Times at which the rail changed, s on the course's clock, ascending."""
    if len(course) < 500:
        return []
    thin = _thinned(course)
    order = np.argsort(thin.t_s, kind="stable")
    samples = samples_of(thin, order)
    rows = change_points(samples, SETTINGS)
    times = [float(samples.t_us[row]) / 1e6 for row in rows]
    if not times:
        return []
    trial = _Trial(thin, times, candidates)
    while times:
        whole = trial.left(times)
        without = [trial.left(times[:i] + times[i + 1 :]) for i in range(len(times))]
        least = int(np.argmin(without))
        if without[least] > (1.0 + EXPLAINED) * whole:
            break
        del times[least]
    return _moved(thin, _moved(thin, times))


def _moved(course: Course, times: list[float]) -> list[float]:
    """Each change where the curves of the stretches around it say that it was."""
    study = study_of((course,), [times])
    theta = start_of(study).values
    adhesion, slip = course.observe().adhesion, course.observe().slip
    order = np.argsort(course.t_s, kind="stable")
    t_s = course.t_s[order]
    bounds = [t_s[0], *times, t_s[-1]]
    found = []
    for number, time in enumerate(times):
        low, high = (bounds[number] + time) / 2, (bounds[number + 2] + time) / 2
        rows = order[(t_s >= low) & (t_s < high)]
        squares = []
        for c1, log_c2, c3 in theta[number : number + 2]:
            curve = burckhardt.adhesion(slip[rows], c1, np.exp(log_c2), c3)
            squares.append((adhesion[rows] - curve) ** 2)
        cost = np.cumsum(squares[0] - squares[1])
        found.append(float(course.t_s[rows[int(np.argmin(cost))]]) if len(rows) else time)
    return sorted(found)


def _thinned(course: Course) -> Course:
    step = max(len(course) // MOST_ROWS, 1)
    return course.rows(slice(None, None, step))


def study_of(courses: tuple[Course, ...], times: list[list[float]]) -> Study:
    """Study with a surface for each stretch between changes.

    Args:
        courses: recordings.
        times: of the changes in each.

    """
    numbers, base = [], 0
    for course, own in zip(courses, times, strict=True):
        number = np.searchsorted(own, course.t_s, side="right") + base
        for time in own:
            number[np.abs(course.t_s - time) < AROUND_S] = EXCLUDED
        numbers.append(number)
        base += len(own) + 1
    surface = np.concatenate(numbers) if numbers else np.empty(0, dtype=np.int64)
    return Study(courses, surface.astype(np.int64), base)


def start_of(study: Study) -> Theta:
    """Curves to begin with: `identify`'s fit of each surface."""
    return Theta(np.array([_curve(study, number) for number in range(study.surfaces)]))


def _curve(study: Study, number: int) -> Array:
    """(c1, ln c2, c3) of one surface by `identify`'s fit to some of its rows."""
    own = np.flatnonzero(study.surface == number)
    if len(own) < FEWEST:
        return np.array([0.3, np.log(40.0), 0.1])
    own = own[:: max(len(own) // 3000, 1)]
    adhesion, slip = (
        np.concatenate([getattr(course.observe(), name) for course in study.courses])[own]
        for name in ("adhesion", "slip")
    )
    estimate = fit(Samples.curve(slip, adhesion))
    return np.array([estimate.c1, np.log(max(estimate.c2, 1.0)), estimate.c3])


class _Trial:
    """Sums of squares with a curve for each stretch, and every effect's help to first order."""

    def __init__(
        self, course: Course, times: list[float], candidates: tuple[Candidate, ...]
    ) -> None:
        self._course = course
        self._curves: dict[tuple[float, float], Array] = {}
        study, model = self._start(times)
        signatures = [signature(study, model, c, c.none)[:, None] for c in candidates]
        self._signatures = np.column_stack([np.empty((len(study), 0)), *signatures])

    def left(self, times: list[float]) -> float:
        """Mean square with these changes."""
        study, model = self._start(times)
        used = study.surface != EXCLUDED
        square = np.inf
        for _ in range(PASSES):
            at = evaluate(study, model.theta)
            slopes = curve_slopes(study, model.theta, at)
            columns = np.column_stack([slopes, self._signatures])[used]
            left = at.residual[used]
            answer = solve(columns.T @ columns, columns.T @ left)
            reached = float(np.sum((left - columns @ answer) ** 2))
            if reached >= square:
                break
            square = reached
            # The effects stay linear; the curves go where the effects want them.
            model = model.at(model.vector + answer[: 3 * study.surfaces])
        return square / max(int(used.sum()), 1)

    def _start(self, times: list[float]) -> tuple[Study, Model]:
        study = study_of((self._course,), [times])
        bounds = list(pairwise([-np.inf, *times, np.inf]))
        for number, ends in enumerate(bounds):
            if ends not in self._curves:
                self._curves[ends] = _curve(study, number)
        return study, Model(Theta(np.array([self._curves[ends] for ends in bounds])))
