"""Step 4, detect effects: test whether the plain curves leave anything unexplained.

Without an effect, the product of its signature and the residual, summed over a block, is as likely
positive as negative. Random signs on all block sums give the distribution under that hypothesis.
The same signs are used for all effects, so their dependence is kept, and the largest statistic is
compared with the largest under chance (the max-T test of Romano and Wolf, JASA 100 (2005)). It
needs no assumption on the noise but symmetry and independent blocks, and counts all effects tested.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.gram_matrices import (
    ROUND_OFF,
    BlockGramMatrices,
    solve_normal_equations,
)
from adhesion_can.diagnosis.regression.prepare_regression import PreparedRegression
from adhesion_can.diagnosis.regression.whitened_regression import FittedModel, WhitenedRegression

FLIPS = 1999
"""Number of random sign patterns."""
BLOCKS_PER_DIRECTION = 3
"""Least number of blocks for each direction of a group that is tested."""


@dataclass(frozen=True, eq=False)
class SignFlipTest:
    """Result of a sign-flip test of groups of columns.

    Attributes:
        statistic: Statistic of each group: |t| for one column, the root of a sum of squares of t
            for several; shape (groups,).
        p_value: P-value of each group, all groups counted; shape (groups,).
        gain: Share of the whitened sum of squares that each group explains, shape (groups,).
        independent: Effective number of independent tests among the groups.

    """

    statistic: Array
    p_value: Array
    gain: Array
    independent: float


class Detection(NamedTuple):
    """Sign-flip test of groups of columns against a fitted model's residual.

    Attributes:
        test: Statistics, p-values and gains of the groups.
        absorbed: Share of each group's first column that the model imitates, 0 to 1; (groups,).
        cosines: Cosines between the remainders of the first columns; shape (groups, groups).

    """

    test: SignFlipTest
    absorbed: Array
    cosines: Array


def detect_effects(prepared: PreparedRegression, rng: np.random.Generator) -> Detection:
    """Test the signature of every candidate against the residual of the plain model.

    Args:
        prepared: Whitened regression with signatures.
        rng: Random generator of the signs.

    """
    return detect_groups(prepared.regression, prepared.plain, prepared.signatures, rng)


def detect_groups(
    regression: WhitenedRegression,
    fitted: FittedModel,
    groups: Sequence[Array],
    rng: np.random.Generator,
) -> Detection:
    """Test groups of columns against a fitted model's residual, its Jacobian projected out.

    Args:
        regression: Data with weights, filter and blocks.
        fitted: Fitted model whose residual is tested.
        groups: Columns of each group, adhesion; shape (n, size) each.
        rng: Random generator of the signs.

    """
    columns = regression.build_columns(fitted.model)
    p = columns.shape[1] - 1
    ends = np.cumsum([p, *(group.shape[1] for group in groups)])
    places = [list(range(a, b)) for a, b in pairwise(ends)]
    white = regression.whiten(np.column_stack(groups))
    grams = regression.compute_grams(np.column_stack([columns[:, :-1], white, columns[:, -1]]))
    nuisance = list(range(p))
    firsts = [place[0] for place in places]
    weights, total = grams.project_out(nuisance, firsts), grams.total
    remaining_gram = weights.T @ total @ weights
    remaining = np.maximum(remaining_gram.diagonal(), 0.0)
    square = np.maximum(total[firsts, firsts], 1e-300)
    norm = np.sqrt(np.maximum(remaining, 1e-12 * square))
    cosines = remaining_gram / np.outer(norm, norm)
    test = sign_flip_test(grams, nuisance, places, rng)
    # What the model imitates completely is no test.
    tested = remaining > ROUND_OFF * square
    independent = count_independent(cosines[np.ix_(tested, tested)])
    return Detection(replace(test, independent=independent), 1.0 - remaining / square, cosines)


def count_independent(cosines: Array) -> float:
    """Effective number of independent tests, from the cosines between their columns.

    It takes the place of the number of tests in Bonferroni's bound, which many tests of nearly the
    same raise for nothing (Li and Ji, Heredity 95 (2005)).
    """
    values = np.abs(np.linalg.eigvalsh(cosines)) if cosines.size else np.empty(0)
    return max(float(np.sum((values >= 1.0) + values - np.floor(values))), 1.0)


def sign_flip_test(
    grams: BlockGramMatrices,
    nuisance: list[int],
    groups: list[list[int]],
    rng: np.random.Generator,
) -> SignFlipTest:
    """Test groups of columns against the residual, the nuisance columns projected out of both.

    Args:
        grams: Gram matrices with the residual as last column.
        nuisance: Indices of the columns that may be there without being an effect.
        groups: Indices of the columns of each group.
        rng: Random generator of the signs.

    """
    residual = grams.matrices.shape[1] - 1
    remainder = grams.project_out(nuisance, [residual])[:, 0]
    blocks = len(grams.rows)
    signs = np.where(rng.random((FLIPS, blocks)) < 0.5, -1.0, 1.0)
    observed, chance, gain = [], [], []
    total = grams.total
    square = float(remainder @ total @ remainder)
    for group in groups:
        v = grams.project_out(nuisance, group)
        # What the nuisance imitates completely leaves round-off, which is no evidence.
        imitated = np.einsum("ij,ij->j", v, total @ v) < ROUND_OFF * total[group, group]
        v[:, imitated] = 0.0
        sums = np.einsum("bij,j->bi", grams.matrices, remainder) @ v
        gram = v.T @ total @ v
        root = _inverse_root(sums)
        observed.append(float(np.linalg.norm(sums.sum(axis=0) @ root)))
        chance.append(np.linalg.norm(signs @ (sums @ root), axis=1))
        score = sums.sum(axis=0)
        gain.append(float(score @ solve_normal_equations(gram, score)) / max(square, 1e-300))
    statistic = np.array(observed)
    # Groups of several columns have larger norms: each is compared on its own scale.
    scale = np.array([np.quantile(c, 0.95) for c in chance])
    scale = np.where(scale > 0, scale, 1.0)
    largest = (np.array(chance) / scale[:, None]).max(axis=0)
    # The pattern without any flip must count, whatever its rounding.
    reached = largest[None, :] >= (1.0 - 1e-9) * (statistic / scale)[:, None]
    p_value = (1.0 + reached.sum(axis=1)) / (FLIPS + 1.0)
    return SignFlipTest(statistic, p_value, np.array(gain), float(len(groups)))


def _inverse_root(sums: Array) -> Array:
    """R with R Rᵀ the inverse of Σ_b s_b s_bᵀ, as far as the blocks determine it; (k, k)."""
    values, vectors = np.linalg.eigh(sums.T @ sums)
    good = values > max(1e-10 * float(values[-1]), 1e-300)
    # With few blocks the smallest directions are chance alone.
    most = max(len(sums) // BLOCKS_PER_DIRECTION, 1)
    good &= np.arange(len(values))[::-1] < most
    inverse = np.where(good, 1.0 / np.sqrt(np.maximum(values, 1e-300)), 0.0)
    return np.asarray(vectors * inverse)
