"""From recordings to a stage: weights, shared errors, and a filter that knows all that may be."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.inference.channel_splines import channels_of
from adhesion_can.diagnosis.regression.gram_matrices import solve
from adhesion_can.diagnosis.regression.model import (
    Candidate,
    Model,
    Study,
    Theta,
    curve_slopes,
    evaluate,
)
from adhesion_can.diagnosis.regression.whitened_regression import Fit, Stage, fit
from adhesion_can.diagnosis.regression.whitening import Stretches, Whitener
from adhesion_can.physics.burckhardt import adhesion_slope

FLAT = 2.0
"""Slope dμ/dλ below which the slip's errors say little: the noise of the effort is read there."""
WINDOWS_A_BLOCK = 2.0
BLOCK_S = 4.0
KNOTS = (4, 14)
PARTS, TABLE_BLOCK_S = 120, (0.2, 4.0)


@dataclass(frozen=True, eq=False)
class Prepared:
    """A stage, the plain model on it, and what may be tested.

    Attributes:
        stage: see there.
        base: curves alone.
        candidates: effects that can be tested.
        signatures: of each, adhesion per size, shape (n, 1).

    """

    stage: Stage
    base: Fit
    candidates: tuple[Candidate, ...]
    signatures: tuple[Array, ...]


def block_seconds(study: Study) -> float:
    """Length of a block: errors of the vehicle speed do not reach far beyond it.

    The rows of a TABLE have no such errors, and often there are few: it is cut into `PARTS`.
    """
    if all(course.table for course in study.courses):
        steps = np.concatenate([np.diff(course.t_s) for course in study.courses])
        steps = steps[(steps > 0) & (steps <= 1.0)]
        return float(np.clip(steps.sum() / PARTS, *TABLE_BLOCK_S)) if len(steps) else BLOCK_S
    windows = [course.speed_doubt[1] for course in study.courses]
    return max(BLOCK_S, WINDOWS_A_BLOCK * max(windows, default=0.0))


def prepare(
    study: Study,
    start: Theta,
    block: NDArray[np.int64],
    candidates: tuple[Candidate, ...],
    length_s: float,
) -> Prepared:
    """Stage of a study, whitened by what the fullest model leaves.

    Args:
        study: see there.
        start: curves to begin with.
        block: number of each row's block, negative: kept back; shape (n,).
        candidates: effects to test.
        length_s: of a block.

    """
    n = len(study)
    zero = np.zeros(n)
    stage = Stage(
        study, np.ones(n), zero, np.zeros((n, 0)), zero,
        Whitener(np.array([1.0]), _stretches(study)), np.ones(n), block,
    )  # fmt: skip
    model = fit(stage, Model(start), 30).model
    stage = _weighed(stage, model, length_s)
    model = fit(stage, model).model
    stage = replace(stage, shift=_likely_shift(stage, model, _saturated(stage, model, candidates)))
    stage = stage.rewhitened(_saturated(stage, model, candidates))
    base = fit(stage, model)
    signatures = tuple(stage.signature(base.model, candidate) for candidate in candidates)
    return Prepared(stage, base, candidates, signatures)


def _stretches(study: Study) -> Stretches:
    lengths = [len(course) for course in study.courses]
    starts = np.cumsum([0, *lengths])[:-1]
    breaks = np.zeros(len(study), dtype=np.bool_)
    breaks[starts[np.array(lengths) > 0]] = True
    return Stretches.of(study.column("t_s"), study.column("axle"), breaks)


def _weighed(stage: Stage, model: Model, length_s: float) -> Stage:
    """With each row's standard deviation, and what errors of the vehicle speed do to it."""
    study = stage.study
    at = evaluate(study, model.theta)
    slope = _slope(study, model, at.slip)
    flat = stage.used & (np.abs(slope) < FLAT)
    if flat.sum() < 0.02 * stage.used.sum():
        flat = stage.used
    noise = max(float(np.sqrt(np.mean(at.residual[flat] ** 2))), 1e-9)
    doubt = (slope * study.column("wheel_slip_std") / noise) ** 2
    speeds = np.concatenate([course.observe().speed for course in study.courses])
    doubts = [course.speed_doubt for course in study.courses]
    std = np.concatenate(
        [np.full(len(c), s) for c, (s, _) in zip(study.courses, doubts, strict=True)]
    )
    window_s = max((w for s, w in doubts if s > 0.0), default=0.0)
    reach = slope * (1.0 + at.slip) / speeds * std
    shared = np.zeros((len(study), 0))
    if window_s > 0.0:
        knots = int(np.clip(np.ceil(2.0 * length_s / window_s) + 1, *KNOTS))
        place = (study.column("t_s") / length_s) % 1.0 * (knots - 1)
        hats = np.maximum(1.0 - np.abs(place[:, None] - np.arange(knots)), 0.0)
        shared = hats * reach[:, None]
    return replace(
        stage,
        scale=1.0 / (noise * np.sqrt(1.0 + doubt)),
        doubt=doubt / (1.0 + doubt),
        shared=shared,
    )


def _slope(study: Study, model: Model, slip: Array) -> Array:
    """dμ/dλ of the plain curve in each row."""
    return adhesion_slope(slip, *model.theta.rows(study.surface))


def _saturated(stage: Stage, model: Model, candidates: tuple[Candidate, ...]) -> Array:
    """Residual, adhesion, of curves, all effects and all splines together, to first order."""
    study = stage.study
    likely = evaluate(study, model.theta, (), stage.shift)
    columns = [curve_slopes(study, model.theta, likely)]
    columns += [stage.signature(model, candidate) for candidate in candidates]
    columns += [channel.basis(likely) for channel in channels_of(study, likely)]
    raw = np.column_stack(columns)
    left = evaluate(study, model.theta).residual
    total = stage.ledger(stage.white(np.column_stack([raw, left]))).total
    return np.asarray(left - raw @ solve(total[:-1, :-1], total[:-1, -1]))


def _likely_shift(stage: Stage, model: Model, residual: Array) -> Array:
    """By what the measured slips are likely to be wrong, given residuals of a full model.

    The error of the vehicle speed shows in all axles at once, most where the curve is steep; what
    is left of a residual then goes to the wheel speed by its share of the variance.
    """
    study = stage.study
    at = evaluate(study, model.theta)
    slope = _slope(study, model, at.slip)
    moved = np.zeros(len(study))
    # A rail that is kept back whole had no part in the full model, which may say anything of it.
    known = np.isin(study.surface, study.surface[stage.used])
    residual = np.where(known, residual, at.residual)
    if stage.shared.shape[1]:
        scaled = stage.shared * stage.scale[:, None]
        left = residual * stage.scale
        order = np.argsort(stage.number, kind="stable")
        starts = np.unique(stage.number[order], return_index=True)[1]
        for rows in np.split(order, starts[1:]):
            part = scaled[rows]
            gram = part.T @ part + np.eye(part.shape[1])
            moved[rows] = stage.shared[rows] @ np.linalg.solve(gram, part.T @ left[rows])
    safe = np.where(np.abs(slope) > 1e-3, slope, np.inf)
    by_wheel = stage.doubt * (residual - moved) / safe
    # A residual of s·δ means that the slip reads low by δ.
    return np.asarray(moved / safe + by_wheel)
