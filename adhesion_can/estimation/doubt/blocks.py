"""Blocks of a drive: Gram matrices of some seconds each, and what is carried over a surface change.

Errors of neighbouring samples are not independent, those of blocks nearly are: standard errors come
from the scatter between blocks (batch means; Glynn & Whitt, Operations Research Letters 10, 1991).
Where there are many blocks, neighbours are merged, so that they are longer than what lasts.

When a surface ends, its curve is projected out of its blocks (Frisch, Waugh & Lovell). What is left
concerns the directions alone, which the next surface shares.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.curves.binned_samples import EMPTY, BinnedSamples, join_binned
from adhesion_can.estimation.doubt.pooled_curve import BUMPS, PooledCurve, fit_curve, linearise
from adhesion_can.estimation.doubt.rows import Rows
from adhesion_can.estimation.doubt.slip_basis import SIZE
from adhesion_can.physics.burckhardt import CurveParameters
from adhesion_can.values import Stateful, Value

FIRST_S = 0.5
"""Duration of the first blocks, s."""
LONGEST_S = 8.0
"""Longest duration of a block, s."""
MOST = 64
"""Number of blocks from which neighbours are merged."""
TANGENTS = 3
"""Number of the curve's tangents, which come first in reduced blocks; then the bumps."""
CURVE = TANGENTS + len(BUMPS)
"""Number of coefficients of the curve in reduced blocks; then the directions."""
CANDIDATES = 4
"""Largest number of changes that wait to be confirmed."""


class BlockError(NamedTuple):
    """Error that all rows of a block share, independent from block to block.

    Attributes:
        place: Index of its column.
        variance: Variance of its coefficient.

    """

    place: int
    variance: float

    def level_square(self, rows: Rows) -> float:
        """Expected square of the score along the level of the curve, by this error alone."""
        along = rows.weight * rows.level @ rows.columns[:, self.place]
        return self.variance * float(along) ** 2


@dataclass(frozen=True, slots=True)
class BlockSums(Value):
    """Sums over some seconds of a drive.

    Attributes:
        gram: Weighted Gram matrix of the columns, less the share of the slips' errors, (k, k).
        dilution: That share: what errors of the slips add to the Gram matrix, (k, k).
        score: Weighted sums of columns times response, shape (k,).
        level_noise: Expected square of the score along the level of the curve, by noise alone.
        curve_square: Weighted sum of squares of the curve.
        binned: Samples in bins of slip and speed, for curves of any family.

    """

    gram: Array
    dilution: Array
    score: Array
    level_noise: float
    curve_square: float
    binned: BinnedSamples = EMPTY

    @classmethod
    def from_rows(
        cls, rows: Rows, binned: BinnedSamples = EMPTY, error: BlockError | None = None
    ) -> "BlockSums":
        """Sums of rows, with corrected scores for the errors of the slips.

        With a shared error they are those of generalised least squares: the inverse of W⁻¹ + σ²ggᵀ
        takes the place of the weights W (Sherman & Morrison), so that rows count the less, the more
        they depend on that error.

        Args:
            rows: Rows of the block.
            binned: Their samples in bins, without the shared error.
            error: Error that all rows share.

        """
        weighted = rows.columns * rows.weight[:, None]
        diluted = rows.slopes * (rows.weight * rows.slip_var)[:, None]
        dilution = diluted.T @ rows.slopes
        gram = weighted.T @ rows.columns - dilution
        score, noise = weighted.T @ rows.response, rows.level_noise
        if error is not None:
            k, level = error.place, rows.weight * rows.level
            total = max(gram[k, k], 0.0) + 1.0 / error.variance
            share = gram[:, k] / total
            gram = gram - np.outer(share, gram[:, k])
            score = score - share * score[k]
            # A column keeps what errors of its slips add, less its share in the error's column.
            crossed = np.outer(share, dilution[k])
            dilution = dilution - crossed - crossed.T + dilution[k, k] * np.outer(share, share)
            along, square = float(level @ rows.columns[:, k]), float(level @ rows.level)
            if square > 0.0:
                noise *= max(1.0 - along * along / (total * square), 0.0)
        return cls(gram, dilution, score, noise, rows.curve_square, binned)

    def joined(self, other: "BlockSums") -> "BlockSums":
        """Both blocks as one."""
        return BlockSums(
            self.gram + other.gram,
            self.dilution + other.dilution,
            self.score + other.score,
            self.level_noise + other.level_noise,
            self.curve_square + other.curve_square,
            join_binned((self.binned, other.binned)),
        )


@dataclass(frozen=True, slots=True)
class ReducedBlocks(Value):
    """Blocks in coefficients of a curve's change (tangents, bumps) and of the directions.

    Attributes:
        grams: Gram matrix of each block, shape (b, k, k).
        dilution: What errors of the slips would add to the sum of the Gram matrices, (k, k).
        scores: Score of each block at the curve itself, shape (b, k).
        current: Number of the first blocks that belong to the current surface.
        level_noise: Expected square of each current block's score along the level of the curve, by
            noise alone, shape (current,).
        curve_square: Weighted sum of squares of the curve, over all blocks.

    """

    grams: Array
    dilution: Array
    scores: Array
    current: int
    level_noise: Array
    curve_square: float


class BlockSeries(Stateful):
    """Blocks of the current surface, and reduced ones of those before.

    Args:
        directions: Number of directions.
        per_surface: Indices of directions that start again with each surface.

    """

    def __init__(self, directions: int, per_surface: Sequence[int] = ()) -> None:
        self._directions = directions
        self._per_surface = np.array([CURVE - TANGENTS + k for k in per_surface], dtype=np.int64)
        self.blocks: list[BlockSums] = []
        """Blocks of the current surface."""
        self._earlier: list[BlockSums] = []
        self.candidates: list[int] = []
        """Index of the first block after each change that waits to be confirmed."""
        self.block_s = FIRST_S
        """Duration of the next block, s."""

    def __len__(self) -> int:
        return len(self.blocks) + len(self._earlier)

    def append(self, block: BlockSums) -> None:
        """Add the latest block."""
        self.blocks.append(block)
        if len(self) < MOST:
            return
        if self.block_s >= LONGEST_S:
            if self._earlier:
                del self._earlier[0]
                return
            del self.blocks[0]
            # A change before all blocks that are kept has nothing to end.
            self.candidates = [k - 1 for k in self.candidates if k > 1]
            return
        # What comes after a possible change must not be merged with what came before.
        kept = self.candidates[0] if self.candidates else len(self.blocks)
        before = _merge_neighbours(self.blocks[:kept])
        self.candidates = [k - (kept - len(before)) for k in self.candidates]
        self.blocks = [*before, *self.blocks[kept:]]
        self._earlier = _merge_neighbours(self._earlier)
        self.block_s *= 2.0

    def add_candidate(self) -> None:
        """Note that the surface may have changed before the next block."""
        place = len(self.blocks)
        if place and place not in self.candidates:
            self.candidates = [*self.candidates, place][-CANDIDATES:]

    @property
    def awaits_change(self) -> bool:
        """Whether the latest block alone is after a change that waits to be confirmed."""
        return bool(self.candidates) and self.candidates[-1] == len(self.blocks) - 1

    def reduced(self, curve: PooledCurve) -> ReducedBlocks:
        """Blocks linearised at a curve."""
        linear = linearise(curve)
        size = CURVE + self._directions
        grams, scores = np.zeros((len(self), size, size)), np.zeros((len(self), size))
        dilution = np.zeros((size, size))
        for k, block in enumerate(self.blocks):
            gram, score = block.gram, block.score - block.gram[:, :SIZE] @ linear.curve
            grams[k] = _in_changes(gram, linear.changes)
            scores[k, :CURVE] = score[:SIZE] @ linear.changes
            scores[k, CURVE:] = score[SIZE:]
        for k, block in enumerate(self._earlier, start=len(self.blocks)):
            grams[k, TANGENTS:, TANGENTS:] = block.gram
            scores[k, TANGENTS:] = block.score
        if self.blocks:
            whole = np.sum([block.dilution for block in self.blocks], axis=0)
            dilution += _in_changes(whole, linear.changes)
        for block in self._earlier:
            dilution[TANGENTS:, TANGENTS:] += block.dilution
        noise = np.array([block.level_noise for block in self.blocks])
        square = sum(block.curve_square for block in (*self.blocks, *self._earlier))
        return ReducedBlocks(grams, dilution, scores, len(self.blocks), noise, square)

    def end_surface(self, place: int, curve: PooledCurve) -> None:
        """End the surface before a block: its curve is projected out of its blocks.

        Args:
            place: Index of the first block of the new surface.
            curve: Curve of the surface that ends.

        """
        after = self.blocks[place:]
        self.blocks = self.blocks[:place]
        reduced = self.reduced(curve)
        grams, scores = reduced.grams[:place], reduced.scores[:place]
        tangents, rest = slice(0, TANGENTS), slice(TANGENTS, None)
        gram, score = grams.sum(axis=0), scores.sum(axis=0)
        inverse = np.linalg.pinv(gram[tangents, tangents], hermitian=True)
        onto, change = inverse @ gram[tangents, rest], inverse @ score[tangents]
        changes = linearise(curve).changes
        for gram, score, block in zip(grams, scores, self.blocks, strict=True):
            left = _project_out(gram, onto)
            diluted = _project_out(_in_changes(block.dilution, changes), onto)
            at_fit = score - gram[:, tangents] @ change
            score_left = at_fit[rest] - onto.T @ at_fit[tangents]
            for matrix in (left, diluted):
                matrix[self._per_surface], matrix[:, self._per_surface] = 0.0, 0.0
            score_left[self._per_surface] = 0.0
            self._earlier.append(
                replace(block, gram=left, dilution=diluted, score=score_left, binned=EMPTY)
            )
        self.blocks = after
        self.candidates = [k - place for k in self.candidates if k > place]


def _in_changes(gram: Array, changes: Array) -> Array:
    """Gram matrix in coefficients of a curve's changes, from one in those of the slip basis.

    Args:
        gram: Gram matrix of the basis and the directions, shape (SIZE + d, SIZE + d).
        changes: Coefficients of the tangents and bumps, shape (SIZE, CURVE).

    """
    onto = changes.T @ gram[:SIZE]
    edge = onto[:, SIZE:]
    size = CURVE + edge.shape[1]
    gram_in_changes = np.empty((size, size))
    gram_in_changes[:CURVE, :CURVE] = onto[:, :SIZE] @ changes
    gram_in_changes[:CURVE, CURVE:], gram_in_changes[CURVE:, :CURVE] = edge, edge.T
    gram_in_changes[CURVE:, CURVE:] = gram[SIZE:, SIZE:]
    return gram_in_changes


def _project_out(gram: Array, onto: Array) -> Array:
    """Gram matrix of what is left of the other columns without the tangents.

    Args:
        gram: Gram matrix of the tangents and the others, shape (TANGENTS + k, TANGENTS + k).
        onto: Regression of the others on the tangents, shape (TANGENTS, k).

    """
    tangents, rest = slice(0, TANGENTS), slice(TANGENTS, None)
    crossed = gram[rest, tangents] @ onto
    return np.asarray(
        gram[rest, rest] - crossed - crossed.T + onto.T @ gram[tangents, tangents] @ onto
    )


def _merge_neighbours(blocks: Sequence[BlockSums]) -> list[BlockSums]:
    """Blocks two by two, the odd one at the end as it is."""
    pairs = zip(blocks[0::2], blocks[1::2], strict=False)
    merged = [earlier.joined(later) for earlier, later in pairs]
    return merged + list(blocks[len(merged) * 2 :])


def fit_blocks(blocks: Sequence[BlockSums], start: CurveParameters) -> PooledCurve:
    """Curve that fits the blocks of a surface best, from the parameters (c1, c2, c3) of another."""
    gram = np.sum([block.gram[:SIZE, :SIZE] for block in blocks], axis=0)
    score = np.sum([block.score[:SIZE] for block in blocks], axis=0)
    return fit_curve(gram, score, start)
