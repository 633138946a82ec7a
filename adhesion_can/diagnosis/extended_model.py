"""The extended model, and the curves of every stretch with and without it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import Course
from adhesion_can.diagnosis.inference.find_residual_channels import Left
from adhesion_can.diagnosis.regression.model import Evaluation, Model, Study, evaluate
from adhesion_can.diagnosis.regression.prepare_regression import Prepared
from adhesion_can.diagnosis.regression.whitened_regression import Fit, fit
from adhesion_can.diagnosis.result import Surface
from adhesion_can.estimation.batch_fit import fit as fit_curve
from adhesion_can.estimation.extended.model import ExtendedModel, Matrix
from adhesion_can.physics.effects import ActiveEffect
from adhesion_can.physics.effects.empirical import Empirical
from adhesion_can.physics.estimate import Estimate
from adhesion_can.physics.samples import Samples

ONLINE = {"slip": "slip", "speed": "speed", "axle_load": "load", "time": "time_s"}
"""Channels of ours that a spline of an extended model can have, beside the covariates."""
OFFLINE = frozenset({"position", "slip_rate", "tractive_effort", "axle"})
"""Channels that a model online does not have."""
FEWEST, MOST_ROWS = 10, 20_000
LEAST_CLEAR = 0.05
"""Factor of the adhesion below which it says nothing of the curve."""


def spline_of(left: Left) -> Empirical | None:
    """An unexplained channel as a part of a model; None where a model cannot have it."""
    channel = left.channel
    known = ONLINE.get(channel.name)
    if known is None and (channel.period or channel.name in OFFLINE):
        return None
    knots = tuple(map(float, channel.knots))
    coefficients = left.weights[-left.columns.shape[1] :]
    if channel.levels is not None or len(coefficients) != len(knots) - 4:
        return None
    found = Empirical(known or channel.name, "factor", knots, tuple(map(float, coefficients)))
    # A constant factor is the curve's affair: the spline is 0 on average.
    mean = float(np.mean(found.at(channel.values)))
    if mean <= LEAST_CLEAR - 1.0:
        return None
    return replace(
        found, coefficients=tuple(float((c - mean) / (1.0 + mean)) for c in coefficients)
    )


def with_spline(prepared: Prepared, model: Model, spline: Empirical) -> Model:
    """Curves fitted anew with a spline in front of them."""
    curves = Model(model.theta, fixed=(ActiveEffect(spline, ()),))
    return fit(prepared.stage.whole, curves).model


def surfaces_of(
    study: Study, times: list[list[float]], extended: Model
) -> tuple[tuple[Surface, ...], tuple[int, int]]:
    """Every stretch of one rail, and course and number of the longest."""
    at = evaluate(study, extended.theta, extended.actives)
    found: list[Surface] = []
    longest, most = (0, 0), -1
    first = number = 0
    for place, (course, own) in enumerate(zip(study.courses, times, strict=True)):
        rows = slice(first, first + len(course))
        first += len(course)
        for _ in range(len(own) + 1):
            mine = np.flatnonzero(study.surface[rows] == number) + rows.start
            if len(mine) >= FEWEST:
                if len(mine) > most:
                    longest, most = (place, number), len(mine)
                found.append(_surface(course, mine, rows.start, at))
            number += 1
    return tuple(found), longest


def _surface(course: Course, mine: NDArray[np.int64], start: int, at: Evaluation) -> Surface:
    mine = mine[:: max(len(mine) // MOST_ROWS, 1)]
    seen = course.observe()
    own = mine - start
    clear = np.abs(at.factor[mine]) > LEAST_CLEAR
    plain = _estimate(seen.slip[own], seen.adhesion[own])
    corrected = at.adhesion[mine][clear] / at.factor[mine][clear]
    return Surface(
        course.name,
        course.first_us / 1e6 + float(course.time_s[own].min()),
        course.first_us / 1e6 + float(course.time_s[own].max()),
        plain,
        _estimate(at.slip[mine][clear], corrected) if clear.sum() >= FEWEST else plain,
    )


def _estimate(slip: Array, adhesion: Array) -> Estimate:
    return fit_curve(Samples.curve(slip, adhesion))


def extension(
    whole: Model, final: Fit, surface: int, spline: Empirical | None
) -> ExtendedModel | None:
    """The model as a file has it; None where the data give no curve with a peak."""
    c1, log_c2, c3 = whole.theta.values[surface]
    c2 = float(np.exp(log_c2))
    if not (c1 > 0 and c3 >= 0 and c1 * c2 > c3):
        return None
    turn = np.diag([1.0, c2, 1.0])
    own = slice(3 * surface, 3 * surface + 3)
    covariances: list[Matrix | None] = []
    first = final.model.theta.values.size
    for candidate in final.model.candidates:
        part = final.covariance[first : first + candidate.size, first : first + candidate.size]
        first += candidate.size
        full = np.zeros((len(candidate.effect.parameters),) * 2)
        free = [i for i, p in enumerate(candidate.effect.parameters) if not p.axle]
        full[np.ix_(free, free)] = part
        covariances.append(_matrix(full))
    return ExtendedModel(
        base=(float(c1), c2, float(c3)),
        base_covariance=_matrix(turn @ final.covariance[own, own] @ turn),
        effects=tuple(
            c.active(v) for c, v in zip(final.model.candidates, final.model.values, strict=True)
        ),
        covariances=tuple(covariances),
        splines=() if spline is None else (spline,),
    )


def _matrix(values: Array) -> Matrix | None:
    """A covariance as a model has it; None where the data give none."""
    if not np.isfinite(values).all():
        return None
    even = (values + values.T) / 2
    return tuple(tuple(float(x) for x in row) for row in even)
