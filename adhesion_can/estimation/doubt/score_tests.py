"""Which directions the residual lies in: score tests with standard errors from blocks.

The score of a direction is its remainder after those that are estimated, times the residual.
Its standard error comes from the scatter of the blocks' scores, each block judged without itself
(jackknife, the HC3 of cluster-robust variances; Bell & McCaffrey, Survey Methodology 28, 2002), and
counts what neighbouring blocks share. Few blocks may hold most of a direction's information: the
degrees of freedom of Student's t are those of the blocks that do.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np
import scipy.special
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.estimation.doubt.blocks import CURVE, TANGENTS, ReducedBlocks
from adhesion_can.estimation.doubt.directions import ResidualDirection
from adhesion_can.estimation.doubt.settings import DoubtSettings
from adhesion_can.physics.doubt import Doubt

FEWEST_BLOCKS = 8
"""Number of blocks below which nothing is tested."""
LEAST_FREEDOM = 3.0
"""Degrees of freedom below which a direction is not tested."""
LEAST_INFORMATION = 1e-3
"""Share of a direction's information that the estimated ones must leave."""
MOST_SELECTED = 4
"""Largest number of directions, or groups of them, that are selected."""
_RIDGE = 1e-8
"""Ridge relative to the diagonal, for directions that are nearly the same."""


class ScoreTests(NamedTuple):
    """Tests of all coefficients, given those that are estimated; each of shape (k,).

    Attributes:
        t: Size over its standard error.
        freedom: Degrees of freedom of t.
        p_value: Two-sided probability of a t as large by chance; 1 where it cannot be tested.
        size: Estimated coefficient.
        information: Weighted sum of squares of what is left of the direction.

    """

    t: Array
    freedom: Array
    p_value: Array
    size: Array
    information: Array


def compute_score_tests(blocks: ReducedBlocks, estimated: Sequence[int]) -> ScoreTests:
    """Tests of every coefficient by itself.

    Args:
        blocks: Blocks at the pooled curve.
        estimated: Indices of the coefficients that are estimated in any case.

    """
    grams, scores = blocks.grams, blocks.scores
    gram = grams.sum(axis=0)
    whole = gram.diagonal()
    fitted = [k for k in estimated if whole[k] > 0.0]
    inner = gram[np.ix_(fitted, fitted)] + np.diag(_RIDGE * whole[fitted])
    inverse = np.linalg.inv(inner)
    change, onto = inverse @ scores.sum(axis=0)[fitted], inverse @ gram[fitted]
    residual = scores - grams[:, :, fitted] @ change
    left = residual - residual[:, fitted] @ onto
    by_block = (
        np.einsum("bkk->bk", grams)
        - 2.0 * np.einsum("bka,ak->bk", grams[:, :, fitted], onto)
        + np.einsum("ak,bak->bk", onto, grams[:, fitted][:, :, fitted] @ onto)
    )
    information = by_block.sum(axis=0)
    testable = (whole > 0.0) & (information > LEAST_INFORMATION * whole)
    testable[fitted] = False
    information = np.where(testable, information, 1.0)
    size = left.sum(axis=0) / information
    share = np.clip(by_block / information, 0.0, 1.0)
    scatter = (left - by_block * size) / np.maximum(1.0 - share, 0.2)
    variance = np.maximum((scatter * scatter).sum(axis=0), 1e-300)
    variance = variance * _lasting_factor(scatter, variance)
    t = np.where(testable, left.sum(axis=0) / np.sqrt(variance), 0.0)
    freedom = 1.0 / np.maximum((share * share).sum(axis=0), 1e-9) - 1.0
    testable &= freedom >= LEAST_FREEDOM
    p_value = np.where(
        testable, 2.0 * scipy.special.stdtr(np.maximum(freedom, 1.0), -np.abs(t)), 1.0
    )
    return ScoreTests(t, freedom, p_value, size, information)


def _lasting_factor(scatter: Array, variance: Array) -> Array:
    """Factor of the variance by what neighbouring blocks share, shape (k,); at least 1.

    That of a first-order autoregression, (1 + ρ)/(1 − ρ), with ρ corrected for its bias.
    """
    shared = (scatter[1:] * scatter[:-1]).sum(axis=0) / variance + 1.5 / len(scatter)
    rho = np.clip(shared, 0.0, 0.9)
    return np.asarray((1.0 + rho) / (1.0 - rho))


class Selection(NamedTuple):
    """Directions that the residual lies in.

    Attributes:
        doubt: Condition of the most significant one; NONE where there is none.
        names: Names of the directions that decided, in the order of their significance.
        coefficients: Indices of the coefficients to estimate, the curve's tangents first.

    """

    doubt: Doubt
    names: tuple[str, ...]
    coefficients: tuple[int, ...]


def select_directions(
    blocks: ReducedBlocks, directions: Sequence[ResidualDirection], settings: DoubtSettings
) -> Selection:
    """Significant directions, the most significant one first, each given those before.

    Args:
        blocks: Blocks at the pooled curve.
        directions: Directions of the blocks' coefficients after those of the curve.
        settings: Significance and least size.

    """
    coefficients, names, doubt = list(range(TANGENTS)), list[str](), Doubt.NONE
    # Root mean square of what a direction adds, as a share of that of the curve.
    whole = sqrt(max(blocks.curve_square, 1e-300))
    while len(names) < MOST_SELECTED and len(blocks.grams) >= FEWEST_BLOCKS:
        tests = compute_score_tests(blocks, coefficients)
        share = np.abs(tests.size) * np.sqrt(tests.information) / whole
        p_value = np.where(share >= settings.least_size, tests.p_value, 1.0)
        best = int(np.argmin(p_value))
        if p_value[best] > settings.false_alarm:
            break
        added, name, direction_doubt = _group(best, directions)
        doubt = doubt or direction_doubt
        names.append(name)
        coefficients += [k for k in added if k not in coefficients]
    return Selection(doubt, tuple(names), tuple(coefficients))


def _group(
    best: int, directions: Sequence[ResidualDirection]
) -> tuple[NDArray[np.int64], str, Doubt]:
    """Coefficients that are estimated with one of them, its name and its doubt."""
    if best < CURVE:
        return np.arange(TANGENTS, CURVE), "shape", Doubt.SHAPE
    direction = directions[best - CURVE]
    group = [k for k, other in enumerate(directions) if other.group == direction.group]
    # The members of a group are deviations from their mean: the last one follows from the others.
    group = group[:-1] if len(group) > 1 else group
    return CURVE + np.array(group, dtype=np.int64), direction.name, direction.doubt
