"""The data as every fit and test sees them: scaled, whitened, in blocks, a part kept back."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.gram_matrices import Ledger, solve
from adhesion_can.diagnosis.regression.model import (
    CHORD_STEP,
    EXCLUDED,
    Candidate,
    Model,
    Study,
    curve_slopes,
    effect_slopes,
    evaluate,
    signature,
    without,
)
from adhesion_can.diagnosis.regression.whitening import Whitener, fitted

ITERATIONS = 10
SETTLED = 1e-5
"""A step that lowers the sum of squares by a smaller share is the last one."""


@dataclass(frozen=True, eq=False)
class Stage:
    """A study with the weights and the whitening of its residuals.

    Attributes:
        study: see there.
        scale: 1 over the standard deviation of a row's residual, shape (n,).
        doubt: variance from the wheel speed over that of the rest, shape (n,).
        shared: what errors of the vehicle speed, of variance 1 each, do to the residual of a row;
            they last some time and meet all axles alike. Shape (n, q), q errors a block.
        shift: what the slip is likely to be wrong by, for slopes alone; shape (n,).
        whitener: see there.
        weight: of whitened rows, shape (n,).
        block: number of each row's block, negative in rows that are kept back; shape (n,).

    """

    study: Study
    scale: Array
    doubt: Array
    shared: Array
    shift: Array
    whitener: Whitener
    weight: Array
    block: NDArray[np.int64]

    def white(self, columns: Array) -> Array:
        """Columns scaled and whitened, zero in rows that take no part; shape (n, p)."""
        of_surface = (self.study.surface != EXCLUDED) * self.scale
        out = self.whitener(columns * of_surface[:, None])
        return np.asarray(out * (self.weight * (self.block >= 0))[:, None])

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """Rows that decide: of a surface, and not kept back; shape (n,)."""
        return np.asarray((self.study.surface != EXCLUDED) & (self.block >= 0))

    @property
    def number(self) -> NDArray[np.int64]:
        """Number of each row's block, kept back or not; shape (n,)."""
        return np.where(self.block >= 0, self.block, -1 - self.block)

    @property
    def whole(self) -> "Stage":
        """With nothing kept back."""
        return replace(self, block=self.number)

    @property
    def turned(self) -> "Stage":
        """With what was kept back, and nothing else."""
        return replace(self, block=-1 - self.block)

    @cached_property
    def shared_white(self) -> Array:
        """`shared`, whitened."""
        return self.white(self.shared)

    def ledger(self, columns: Array) -> Ledger:
        """Sums of whitened columns, block by block."""
        return Ledger.of(columns, self.block, self.shared_white)

    def columns(self, model: Model) -> Array:
        """Whitened slopes of a model's prediction and its residual last, shape (n, p + 1).

        The slopes are taken at the likely slip, the residual at the measured one: so the error of
        the slip is not in both, and does not flatten the curve (orthogonal regression).
        """
        likely = evaluate(self.study, model.theta, model.actives, self.shift)
        parts = [curve_slopes(self.study, model.theta, likely)]
        parts += [
            effect_slopes(self.study, *without(model, place), self.shift)
            for place in range(len(model.candidates))
        ]
        left = evaluate(self.study, model.theta, model.actives).residual
        return self.white(np.column_stack([*parts, left]))

    def signature(
        self,
        model: Model,
        candidate: Candidate,
        start: tuple[float, ...] | None = None,
        chord: float = CHORD_STEP,
    ) -> Array:
        """See `model.signature`; shape (n, 1)."""
        given = candidate.none if start is None else start
        return signature(self.study, model, candidate, given, self.shift, chord)[:, None]

    def rewhitened(self, residual: Array) -> "Stage":
        """With the filter and the weights that other residuals ask for, adhesion, shape (n,)."""
        scaled = residual * self.scale * self.used
        whitener = fitted(scaled, self.whitener.stretches)
        square = whitener(scaled[:, None])[:, 0] ** 2
        return replace(self, whitener=whitener, weight=_weights(square, self.doubt, self.used))


def _weights(square: Array, doubt: Array, used: NDArray[np.bool_]) -> Array:
    """1 over the standard deviation of whitened residuals, as it grows with the doubt of the slip.

    A filter that leaves little of a slow noise leaves the slip's own error as it was.
    """
    rows = np.flatnonzero(used & (square > 0.0))
    if len(rows) < 200:
        return np.ones_like(square)
    order = rows[np.argsort(doubt[rows], kind="stable")]
    parts = np.array_split(order, 20)
    level = np.array([float(np.mean(square[part])) for part in parts])
    at = np.array([float(np.mean(doubt[part])) for part in parts])
    matrix = np.column_stack([np.ones_like(at), at]) / level[:, None]
    (base, growth), _ = scipy.optimize.nnls(matrix, np.ones_like(level))
    variance = np.maximum(base + growth * doubt, 1e-3 * level.min())
    return np.asarray(1.0 / np.sqrt(variance))


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted model and what is left.

    Attributes:
        model: see there.
        ledger: products of its whitened slopes and residual, the residual last.
        covariance: of the parameters, from the scatter of the blocks, shape (p, p).

    """

    model: Model
    ledger: Ledger
    covariance: Array

    @property
    def square(self) -> float:
        """Sum of squares, over all blocks, each by the parameters of the others."""
        return float(self.squares.sum())

    @cached_property
    def squares(self) -> Array:
        """Sum of squares in each block by the parameters of the others, shape (blocks,).

        Leaving a block out moves the parameters by (G − G_b)⁻¹ X_bᵀ e_b, to first order.
        """
        grams = self.ledger.grams
        whole = self.ledger.total[:-1, :-1]
        out = np.empty(len(grams))
        for b, gram in enumerate(grams):
            slope, own = gram[:-1, :-1], gram[:-1, -1]
            moved = -_step(whole - slope, own, 0.0)
            out[b] = gram[-1, -1] - 2.0 * float(moved @ own) + float(moved @ slope @ moved)
        return out


def fit(stage: Stage, model: Model, iterations: int = ITERATIONS) -> Fit:
    """Parameters at which no slope explains anything of the residual any more.

    A damped Gauss-Newton step is taken where it lowers the square of what the slopes explain. The
    sum of squares itself is no guide: with errors in the slips its minimum is a flattened curve.
    """
    ledger = stage.ledger(stage.columns(model))
    explained = _explained(ledger)
    damping = 1e-4
    for _ in range(iterations):
        gram = ledger.total
        while True:
            step = _step(gram[:-1, :-1], gram[:-1, -1], damping)
            tried = model.at(model.vector + step)
            tried_ledger = stage.ledger(stage.columns(tried))
            left = _explained(tried_ledger)
            if left < explained or damping > 1e2:
                break
            damping = max(10.0 * damping, 1e-2)
        if left >= explained:
            break
        model, ledger = tried, tried_ledger
        settled = explained - left < SETTLED * float(ledger.total[-1, -1])
        explained, damping = left, damping / 10.0
        if settled:
            break
    return Fit(model, ledger, _covariance(ledger))


def _explained(ledger: Ledger) -> float:
    """Sum of squares that the slopes could still explain."""
    gram = ledger.total
    return float(gram[:-1, -1] @ solve(gram[:-1, :-1], gram[:-1, -1]))


def _step(gram: Array, right: Array, damping: float) -> Array:
    scale = _sizes(gram)
    matrix = gram / np.outer(scale, scale) + (damping + 1e-10) * np.eye(len(gram))
    return np.asarray(np.linalg.solve(matrix, right / scale) / scale)


def _covariance(ledger: Ledger) -> Array:
    """Sandwich: what the blocks scatter, or what white residuals would, whichever is larger."""
    whole = ledger.total
    p = len(whole) - 1
    inverse = _inverse(whole[:-1, :-1])
    rows = max(float(ledger.rows.sum()) - p, 1.0)
    plain = inverse * (whole[-1, -1] / rows)
    scores = ledger.grams[:, :-1, -1]
    blocks = len(scores)
    meat = scores.T @ scores * (blocks / max(blocks - 1, 1))
    robust = inverse @ meat @ inverse
    ratio = np.sqrt(np.maximum(robust.diagonal() / np.maximum(plain.diagonal(), 1e-300), 1.0))
    return np.asarray(plain * np.outer(ratio, ratio))


def _sizes(gram: Array) -> Array:
    """Norms of columns, 1 where a column is nothing."""
    diagonal = gram.diagonal()
    return np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def _inverse(gram: Array) -> Array:
    scale = _sizes(gram)
    matrix = gram / np.outer(scale, scale) + 1e-10 * np.eye(len(gram))
    return np.asarray(np.linalg.inv(matrix) / np.outer(scale, scale))
