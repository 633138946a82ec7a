"""Weighted, whitened least squares in blocks, with errors in the slip (steps 3 to 7 use it).

Rows are divided by their standard deviation and pass the whitening filter; their Gram matrices are
summed over blocks. The slip carries an error too, so the Jacobian is taken at the estimated true
slip (errors in variables; Fuller, Measurement Error Models, 1987). Parameters are fitted by damped
Gauss-Newton steps (Levenberg 1944; Marquardt 1963), projected onto their bounds (Bertsekas, SIAM
Journal on Control and Optimization 20 (1982)). Their covariance is a cluster-robust sandwich with
the blocks as clusters (Liang and Zeger, Biometrika 73 (1986)).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf

import numpy as np
import scipy
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.candidate import CHORD_STEP, Candidate
from adhesion_can.diagnosis.regression.effect_derivatives import (
    compute_effect_jacobian,
    compute_signature,
)
from adhesion_can.diagnosis.regression.gram_matrices import (
    BlockGramMatrices,
    solve_normal_equations,
)
from adhesion_can.diagnosis.regression.model import (
    EXCLUDED,
    EvaluatedModel,
    Model,
    RegressionData,
    compute_curve_jacobian,
    evaluate_model,
    remove_effect,
)
from adhesion_can.diagnosis.regression.whitening import Whitener, compute_weights, fit_whitener

ITERATIONS = 10
"""Largest number of steps of a fit."""
CONVERGED = 1e-5
"""A step that lowers the explained square by a smaller share of the sum of squares is the last."""
FIRST_DAMPING, LARGEST_DAMPING = 1e-4, 1e2
"""Damping of the first step, and damping beyond which no further step is tried."""
RACE_STEPS = 3
"""Steps after which a fit that is far behind is given up."""
SHORT_STEP, LEAST_PROGRESS = 1e-2, 0.02
"""Damping from which steps are short, and share of the explained square that one must then remove:
along a flat valley hundreds would follow, and change nothing that the data show."""
LEAST_LEFT = 0.05
"""Share of the information on a combination of parameters that the other blocks must hold for a
block to be predicted by them."""
RIDGE = 1e-10
"""Added to the diagonal of a correlation matrix, so that it can be inverted."""


@dataclass(frozen=True, eq=False)
class WhitenedRegression:
    """Regression data with row weights, whitening filter and blocks.

    Attributes:
        data: Rows of all drives.
        scale: Reciprocal standard deviation of each row's residual, 1/adhesion; shape (n,).
        slip_variance_share: Share of a residual's variance that comes from the wheel speed's noise
            through the slip, 0 to 1; shape (n,).
        speed_error_design: Design matrix of the vehicle speed errors of a block, adhesion per
            standard deviation; all axles share them. Shape (n, q).
        speed_error_std: Standard deviation of the vehicle speed's error in each drive, m/s; shape
            (drives,).
        slip_correction: Correction of the measured slip ratio, for Jacobians alone; shape (n,).
        whitener: Filter that makes scaled residuals white.
        weight: Weight of each whitened row, shape (n,).
        block: Block number of each row, −1 − number in rows that are held out; shape (n,).

    """

    data: RegressionData
    scale: Array
    slip_variance_share: Array
    speed_error_design: Array
    speed_error_std: Array
    slip_correction: Array
    whitener: Whitener
    weight: Array
    block: NDArray[np.int64]

    def whiten(self, columns: Array) -> Array:
        """Scale and whiten columns; zero in rows that take no part; shape (n, p)."""
        scale = (self.data.surface != EXCLUDED) * self.scale
        out = self.whitener(columns * scale[:, None])
        out *= (self.weight * (self.block >= 0))[:, None]
        return out

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """Whether a row takes part: it has a surface and is not held out; shape (n,)."""
        return np.asarray((self.data.surface != EXCLUDED) & (self.block >= 0))

    @property
    def block_number(self) -> NDArray[np.int64]:
        """Block number of each row, held out or not; shape (n,)."""
        return np.where(self.block >= 0, self.block, -1 - self.block)

    @property
    def all_data(self) -> "WhitenedRegression":
        """The same regression with nothing held out."""
        return replace(self, block=self.block_number)

    @property
    def last_fit(self) -> "WhitenedRegression":
        """The regression of what is reported: all rows but those of drives held out whole."""
        parts = self.data.split(self.block)
        return self if any((block < 0).all() for block in parts if len(block)) else self.all_data

    @property
    def held_out(self) -> "WhitenedRegression":
        """The same regression on the held-out rows alone."""
        return replace(self, block=-1 - self.block)

    @cached_property
    def whitened_speed_errors(self) -> Array:
        """Whitened design matrix of the vehicle speed errors, shape (n, q)."""
        return self.whiten(self.speed_error_design)

    def compute_grams(self, columns: Array) -> BlockGramMatrices:
        """Gram matrices of whitened columns; `columns` shape (n, p)."""
        return BlockGramMatrices.from_columns(columns, self.block, self.whitened_speed_errors)

    def evaluate_corrected(self, model: Model) -> EvaluatedModel:
        """A model evaluated at the estimated true slips."""
        effects = model.active_effects
        return evaluate_model(self.data, model.curves, effects, self.slip_correction)

    def residual(self, model: Model) -> Array:
        """Observed less predicted adhesion at the measured slips, shape (n,)."""
        return evaluate_model(self.data, model.curves, model.active_effects).residual

    def without_speed_errors(self, residual: Array) -> Array:
        """Residuals less what errors of the vehicle speed, common to all axles, explain of them.

        The errors of each block are predicted from the block's own residuals (best linear unbiased
        prediction; Henderson, Biometrics 31 (1975)).

        Args:
            residual: Residuals of any model, adhesion; shape (n,).

        """
        out = residual.copy()
        for rows, design, solved in self._speed_error_predictors:
            out[rows] -= design @ (solved @ (residual[rows] * self.scale[rows]))
        return out

    @cached_property
    def _speed_error_predictors(self) -> list[tuple[NDArray[np.intp], Array, Array]]:
        """Rows of each block, their design, and the matrix that predicts the errors from them."""
        design = self.speed_error_design
        rows = np.flatnonzero(self.data.surface != EXCLUDED)
        if not design.shape[1] or not len(rows):
            return []
        number = self.block_number[rows]
        rows = rows[np.argsort(number, kind="stable")]
        starts = np.unique(number, return_counts=True)[1].cumsum()[:-1]
        out = []
        for rows_of_block in np.split(rows, starts):
            scaled = design[rows_of_block] * self.scale[rows_of_block, None]
            gram = scaled.T @ scaled + np.eye(scaled.shape[1])
            out.append(
                (rows_of_block, design[rows_of_block], np.asarray(np.linalg.solve(gram, scaled.T)))
            )
        return out

    def build_columns(self, model: Model) -> Array:
        """Whitened Jacobian of a model's prediction, and its residual last; shape (n, p + 1).

        The Jacobian is taken at the estimated true slip, the residual at the measured one. So the
        error of the slip is not in both, and does not flatten the curve.
        """
        corrected = self.evaluate_corrected(model)
        parts = [compute_curve_jacobian(self.data, model.curves, corrected)]
        parts += [
            compute_effect_jacobian(
                self.data, *remove_effect(model, place), self.slip_correction, corrected
            )
            for place in range(len(model.candidates))
        ]
        return self.whiten(np.column_stack([*parts, self.residual(model)]))

    def compute_signature(
        self,
        model: Model,
        candidate: Candidate,
        start: tuple[float, ...] | None = None,
        chord: float = CHORD_STEP,
        known: EvaluatedModel | None = None,
    ) -> Array:
        """Signature of an effect that a model does not have, as a column.

        Args:
            model: Model without the effect.
            candidate: Effect whose signature is computed.
            start: Values of the candidate's free parameters, with size 0; None: its null values.
            chord: Size of the effect at the chord's end, relative to the typical one.
            known: Evaluation of the model, as `evaluate_corrected` gives it.

        Returns:
            Signature, adhesion per unit of size; shape (n, 1).

        """
        given = candidate.null_values if start is None else start
        column = compute_signature(
            self.data, model, candidate, given, self.slip_correction, chord, known
        )
        return column[:, None]

    def refit_whitening(self, residual: Array) -> "WhitenedRegression":
        """The regression with filter and weights of other residuals, adhesion; shape (n,)."""
        scaled = residual * self.scale * self.used
        whitener = fit_whitener(scaled, self.whitener.runs)
        square = whitener(scaled[:, None])[:, 0] ** 2
        weight = compute_weights(square, self.slip_variance_share, self.used)
        return replace(self, whitener=whitener, weight=weight)


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A fitted model.

    Attributes:
        model: Model with the fitted parameters.
        grams: Gram matrices of the model's whitened Jacobian and residual, the residual last.
        covariance: Covariance of the free parameters, shape (p, p).
        free: Whether a parameter is free to move: not at a bound that the data press it against;
            shape (p,).

    """

    model: Model
    grams: BlockGramMatrices
    covariance: Array
    free: NDArray[np.bool_]

    def size_in_deviations(self, place: int) -> float:
        """Size of an effect, without its sign, in its standard deviations; inf where that is 0."""
        first = self.model.first_parameter(place)
        std = float(np.sqrt(max(self.covariance[first, first], 0.0)))
        size = abs(self.model.values[place][0])
        return size / std if std else (inf if size else 0.0)

    @property
    def cross_validated_square(self) -> float:
        """Sum over the blocks of `cross_validated_squares`."""
        return float(self.cross_validated_squares.sum())

    @cached_property
    def cross_validated_squares(self) -> Array:
        """Whitened sum of squares of each block by the parameters of the others; shape (blocks,).

        Leaving a block out changes the parameters by (G − G_b)⁻¹ X_bᵀ e_b, to first order (case
        deletion of blocks; Cook and Weisberg, Residuals and Influence in Regression, 1982). What
        one block alone knows, as the time of a step, the others cannot predict: it stays.
        """
        moving = np.append(self.free, True)
        matrices = self.grams.matrices[:, moving][:, :, moving]
        total = matrices.sum(axis=0)[:-1, :-1]
        norms = _column_norms(total)
        root = np.linalg.cholesky(total / np.outer(norms, norms) + RIDGE * np.eye(len(total)))
        # Columns in which the information of all blocks together is the unit matrix.
        basis = scipy.linalg.solve_triangular(root, np.diag(1.0 / norms), lower=True).T
        out = np.empty(len(matrices))
        for b, gram in enumerate(matrices):
            information, score = gram[:-1, :-1], gram[:-1, -1]
            leverage, directions = np.linalg.eigh(basis.T @ information @ basis)
            left = 1.0 - leverage
            testable = left > LEAST_LEFT
            scaled = np.where(testable, 1.0 / np.where(testable, left, 1.0), 0.0)
            change = -basis @ (directions @ (scaled * (directions.T @ (basis.T @ score))))
            out[b] = (
                gram[-1, -1] - 2.0 * float(change @ score) + float(change @ information @ change)
            )
        return out


def fit_model(
    regression: WhitenedRegression,
    model: Model,
    iterations: int = ITERATIONS,
    hopeless: float = inf,
) -> FittedModel:
    """Fit the free parameters: afterwards no column of the Jacobian explains any of the residual.

    A damped Gauss-Newton step is taken where it lowers the square that the Jacobian explains. The
    sum of squares itself is no guide: with errors in the slips its minimum is a flattened curve.
    A parameter at a bound that the data press it against stays there and explains nothing; a step
    that brings one there must not raise the sum of squares, for at a corner nothing is explained.

    Args:
        regression: Data, weights and filter.
        model: Model with start values.
        iterations: Largest number of steps.
        hopeless: Whitened sum of squares beyond which the fit is given up after `RACE_STEPS` steps.

    """
    grams = regression.compute_grams(regression.build_columns(model))
    free = _free_parameters(model, grams)
    explained = _explained_square(grams, free)
    damping = FIRST_DAMPING
    for number in range(iterations):
        if number == RACE_STEPS and grams.square > hopeless:
            break
        gram = grams.total
        refused = False
        while True:
            step = np.zeros(len(free))
            right = gram[:-1, -1][free]
            step[free] = _gauss_newton_step(gram[:-1, :-1][np.ix_(free, free)], right, damping)
            tried = model.with_parameters(model.parameter_vector + step)
            tried_grams = regression.compute_grams(regression.build_columns(tried))
            lower = False
            # A law may have no value there, as a logarithm has none below 0: the step is too long.
            if np.isfinite(tried_grams.total).all():
                tried_free = _free_parameters(tried, tried_grams)
                remaining = _explained_square(tried_grams, tried_free)
                cornered = (free & ~tried_free).any() and tried_grams.square > grams.square
                lower = remaining < explained and not cornered
            if lower or damping > LARGEST_DAMPING:
                break
            damping, refused = max(10.0 * damping, 1e-2), True
        if not lower:
            break
        progress = explained - remaining
        converged = progress < CONVERGED * tried_grams.square
        converged |= damping >= SHORT_STEP and progress < LEAST_PROGRESS * explained
        model, grams, free, explained = tried, tried_grams, tried_free, remaining
        if converged:
            break
        if not refused:
            damping /= 10.0
    return FittedModel(model, grams, _sandwich_covariance(grams), free)


def _free_parameters(model: Model, grams: BlockGramMatrices) -> NDArray[np.bool_]:
    """Parameters that are not at a bound beyond which the fit would be better, shape (p,)."""
    vector, uphill = model.parameter_vector, grams.total[:-1, -1]
    lower, upper = model.bounds
    pressed = ((vector <= lower) & (uphill < 0.0)) | ((vector >= upper) & (uphill > 0.0))
    return np.asarray(~pressed)


def _explained_square(grams: BlockGramMatrices, free: NDArray[np.bool_]) -> float:
    """Whitened sum of squares that the Jacobian by the free parameters could still explain."""
    gram, right = grams.total[:-1, :-1][np.ix_(free, free)], grams.total[:-1, -1][free]
    return float(right @ solve_normal_equations(gram, right)) if free.any() else 0.0


def _gauss_newton_step(gram: Array, right: Array, damping: float) -> Array:
    """Damped solution of the normal equations, shape (p,)."""
    norms = _column_norms(gram)
    matrix = gram / np.outer(norms, norms) + (damping + RIDGE) * np.eye(len(gram))
    return np.asarray(np.linalg.solve(matrix, right / norms) / norms)


def _sandwich_covariance(grams: BlockGramMatrices) -> Array:
    """Cluster-robust covariance of the parameters, never below that of white residuals."""
    total = grams.total
    p = len(total) - 1
    inverse = _invert_gram(total[:-1, :-1])
    rows = max(float(grams.rows.sum()) - p, 1.0)
    plain = inverse * (total[-1, -1] / rows)
    scores = grams.matrices[:, :-1, -1]
    blocks = len(scores)
    meat = scores.T @ scores * (blocks / max(blocks - 1, 1))
    robust = inverse @ meat @ inverse
    ratio = np.sqrt(np.maximum(robust.diagonal() / np.maximum(plain.diagonal(), 1e-300), 1.0))
    return np.asarray(plain * np.outer(ratio, ratio))


def _column_norms(gram: Array) -> Array:
    """Norms of the columns of a Gram matrix, 1 for a column of zeros; shape (p,)."""
    diagonal = gram.diagonal()
    return np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))


def _invert_gram(gram: Array) -> Array:
    norms = _column_norms(gram)
    matrix = gram / np.outer(norms, norms) + RIDGE * np.eye(len(gram))
    return np.asarray(np.linalg.inv(matrix) / np.outer(norms, norms))
