"""Whether anything is there at all: sign flips of block sums, the largest of all statistics.

Under 'nothing' the sum of signature times residual over a block is as likely of either sign. The
same random signs are put on all effects' sums, so that their dependence is in the null as well, and
the largest statistic is compared with the largest under chance (Romano and Wolf, JASA 100 (2005)).
"""

from dataclasses import dataclass

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.gram_matrices import Ledger, solve

FLIPS = 1999
NOTHING = 1e-9
"""Share of a column's square that is round-off."""


@dataclass(frozen=True, eq=False)
class Detection:
    """Statistics of groups of columns, and how likely chance makes one as large.

    Attributes:
        statistic: of each group: the share of its block sums that has one sign, as a t-like
            number for a single column, the root of a sum of squares for several; shape (groups,).
        p_value: with all groups counted, shape (groups,).
        gain: share of the whitened sum of squares that a group explains, shape (groups,).

    """

    statistic: Array
    p_value: Array
    gain: Array


def detect(
    ledger: Ledger, nuisance: list[int], groups: list[list[int]], rng: np.random.Generator
) -> Detection:
    """Test groups of columns against the residual, the nuisance projected out of both.

    Args:
        ledger: with the residual as last column.
        nuisance: columns of what may be there without being an effect.
        groups: columns of each group.
        rng: for the signs.

    """
    residual = ledger.grams.shape[1] - 1
    left = ledger.weights(nuisance, [residual])[:, 0]
    blocks = len(ledger.rows)
    signs = np.where(rng.random((FLIPS, blocks)) < 0.5, -1.0, 1.0)
    seen, chance, gain = [], [], []
    total = ledger.total
    square = float(left @ total @ left)
    for group in groups:
        v = ledger.weights(nuisance, group)
        # What the nuisance imitates altogether leaves round-off, which says nothing.
        imitated = np.einsum("ij,ij->j", v, total @ v) < NOTHING * total[group, group]
        v[:, imitated] = 0.0
        sums = np.einsum("bij,j->bi", ledger.grams, left) @ v
        own = v.T @ total @ v
        root = _whitening_root(sums)
        seen.append(float(np.linalg.norm(sums.sum(axis=0) @ root)))
        chance.append(np.linalg.norm(signs @ (sums @ root), axis=1))
        whole = sums.sum(axis=0)
        gain.append(float(whole @ solve(own, whole)) / max(square, 1e-300))
    statistic = np.array(seen)
    # Groups of several columns have larger norms: each is compared on its own scale.
    scale = np.array([np.quantile(c, 0.95) for c in chance])
    scale = np.where(scale > 0, scale, 1.0)
    largest = (np.array(chance) / scale[:, None]).max(axis=0)
    # The flip that flips nothing must count, whatever its rounding.
    reached = largest[None, :] >= (1.0 - 1e-9) * (statistic / scale)[:, None]
    p_value = (1.0 + reached.sum(axis=1)) / (FLIPS + 1.0)
    return Detection(statistic, p_value, np.array(gain))


def _whitening_root(sums: Array) -> Array:
    """R with R Rᵀ the inverse of Σ_b s_b s_bᵀ, as far as the blocks can tell it."""
    values, vectors = np.linalg.eigh(sums.T @ sums)
    good = values > max(1e-10 * float(values[-1]), 1e-300)
    # With few blocks the smallest directions are chance alone: no more than a third of the blocks.
    good &= np.arange(len(values))[::-1] < max(len(sums) // 3, 1)
    inverse = np.where(good, 1.0 / np.sqrt(np.maximum(values, 1e-300)), 0.0)
    return np.asarray(vectors * inverse)
