"""Gram matrices of all candidate effects of one drive, the base curve projected out.

They are what a later regression over many drives needs: with the curve's columns projected out of
the signatures and of the residual (Frisch and Waugh 1933; Lovell 1963), sums over drives are the
normal equations of a regression in which every drive has a curve of its own. All effects are
linearised at size 0, on a chord of the same length in each drive, so sizes are comparable. A large
effect has another size than that line gives: `fits` has the sizes of a fit that is not linearised.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.gram_matrices import ROUND_OFF, BlockGramMatrices

TINY = 1e-300
"""Divisor in place of 0."""


@dataclass(frozen=True, slots=True)
class EffectKey:
    """An effect at an axle, with its first parameter.

    Attributes:
        effect: Effect id.
        form: Form of the effect; '' where there is one alone.
        axle: Axle number from 1; 0 for an effect of the whole vehicle.
        parameter: Name of the first parameter, its size.
        unit: Unit of the size, SI.

    """

    effect: str
    form: str
    axle: int
    parameter: str
    unit: str

    @property
    def key(self) -> "EffectKey":
        """The effect alone, also of what is said of one."""
        return EffectKey(self.effect, self.form, self.axle, self.parameter, self.unit)

    @property
    def name(self) -> str:
        """Effect id with form and axle."""
        words = (self.effect, self.form, f"axle {self.axle}" if self.axle else "")
        return " ".join(word for word in words if word)


class SizeEstimate(NamedTuple):
    """Size of an effect with its standard error, both in the effect's unit."""

    value: float
    std: float


@dataclass(frozen=True, eq=False)
class EffectGrams:
    """Gram matrices of the k candidate effects of a drive, in whitened rows.

    A size φ changes the whitened sum of squares by −2 φᵀ score + φᵀ gram φ.

    Attributes:
        keys: Effects in the order of all matrices, k of them.
        gram: Gram matrix of the projected signatures, 1/size²; shape (k, k).
        score: Products of the signatures with the residual, 1/size; shape (k,).
        score_variance: Variance of each score by the spread of its block sums about the effect's
            own fit, never below that of white rows (Liang and Zeger 1986); shape (k,).
        absorbed: Share of each signature that the curve imitates, 0 to 1; shape (k,).
        square: Whitened sum of squares of the projected residual.
        rows: Number of rows.
        blocks: Number of blocks of time.
        rmse: RMSE of the adhesion with the plain curves.
        fits: Size of an effect by the nonlinear fit of it alone beside the curves, by its place in
            `keys`; below two standard errors the size to first order. Effects at the end of their
            range have none.
        typical: Typical size of each effect; () where a data set was read, which nothing asks for.

    """

    keys: tuple[EffectKey, ...]
    gram: Array
    score: Array
    score_variance: Array
    absorbed: Array
    square: float
    rows: float
    blocks: int
    rmse: float
    fits: Mapping[int, SizeEstimate] = field(default_factory=dict)
    typical: tuple[float, ...] = ()

    @property
    def noise_variance(self) -> float:
        """Variance of a whitened row."""
        return self.square / max(self.rows, 1.0)

    @property
    def size(self) -> Array:
        """Size of each effect when it alone is fitted, shape (k,); NaN where the curve has it."""
        diagonal = self.gram.diagonal()
        known = diagonal > 0.0
        return np.asarray(np.where(known, self.score / np.where(known, diagonal, 1.0), np.nan))

    @property
    def std(self) -> Array:
        """Standard error of each size when it alone is fitted, shape (k,)."""
        diagonal = self.gram.diagonal()
        known = diagonal > 0.0
        root = np.sqrt(self.score_variance)
        return np.asarray(np.where(known, root / np.where(known, diagonal, 1.0), np.nan))

    def square_change(self, sizes: Array) -> float:
        """Fall of the whitened sum of squares by given sizes of all effects, shape (k,)."""
        return float(2.0 * sizes @ self.score - sizes @ self.gram @ sizes)


def project_grams(
    grams: BlockGramMatrices, curve: int, keys: Sequence[EffectKey], rmse: float
) -> EffectGrams:
    """Project the curve's columns out of signatures and residual, block by block.

    Args:
        grams: Gram matrices of the curve's columns, the signatures and the residual.
        curve: Number of the curve's columns.
        keys: Effects of the signatures.
        rmse: RMSE of the adhesion with the plain curves.

    """
    k = len(keys)
    weights = grams.project_out(range(curve), range(curve, curve + k + 1))
    raw = grams.total.diagonal()[curve:]
    blocks = np.einsum("pi,bpq,qj->bij", weights, grams.matrices, weights, optimize=True)
    total = blocks.sum(axis=0)
    left = np.maximum(total.diagonal(), 0.0)
    # What the curve imitates completely leaves round-off, which is no evidence.
    gone = left < ROUND_OFF * np.maximum(raw, TINY)
    gone[k] = False
    total[gone], total[:, gone] = 0.0, 0.0
    blocks[:, gone], blocks[:, :, gone] = 0.0, 0.0
    gram, score = total[:k, :k], total[:k, k]
    rows = float(grams.rows.sum())
    diagonal = np.maximum(gram.diagonal(), TINY)
    of_parameter = np.einsum("bii->bi", blocks)[:, :k] * (score / diagonal)
    number = len(blocks)
    spread = np.sum((blocks[:, :k, k] - of_parameter) ** 2, axis=0) * number / max(number - 1, 1)
    white = (total[k, k] - score**2 / diagonal) / max(rows, 1.0) * gram.diagonal()
    return EffectGrams(
        keys=tuple(keys),
        gram=gram,
        score=score,
        score_variance=np.maximum(spread, white),
        absorbed=np.clip(1.0 - left[:k] / np.maximum(raw[:k], TINY), 0.0, 1.0),
        square=float(total[k, k]),
        rows=rows,
        blocks=number,
        rmse=rmse,
    )
