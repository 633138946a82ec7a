"""Whether a change of the surface that the tracker declared is one, or an error of the model.

A tracker with a wrong model declares changes wherever its error changes. So a change is confirmed
only when the curve after it differs by more than all directions together could explain.
"""

from collections.abc import Sequence

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.doubt.blocks import CURVE, TANGENTS, BlockSeries, ReducedBlocks
from adhesion_can.estimation.doubt.directions import TIME, ResidualDirection
from adhesion_can.estimation.doubt.pooled_curve import PooledCurve, linearise
from adhesion_can.estimation.doubt.slip_basis import SIZE

LEAST_CHANGE = 0.12
"""Least change of the adhesion, root mean square over the samples, as a share of the adhesion."""
LEAST_CHI_SQUARE = 60.0
"""Least square of the change in its standard errors (three degrees of freedom)."""
BUMP_STD = 0.3
"""Size that a bump of a free shape may have, as a share of the largest adhesion."""
INFLATION = 50.0
"""Factor of the variance by errors that last, before anything is known of them."""
FEWEST_AFTER = 2
"""Number of blocks after a change before it is judged."""
MOST_AFTER_S = 6.0
"""Time after a change from which on it is one of the model's errors, s."""


def find_confirmed_change(
    series: BlockSeries, curve: PooledCurve, directions: Sequence[ResidualDirection]
) -> int | None:
    """Index of the first block after a confirmed change; None where none is.

    Candidates that have waited for too long are removed from the series.
    """
    ready = [k for k in series.candidates if len(series.blocks) - k >= FEWEST_AFTER]
    if not ready:
        return None
    reduced = series.reduced(curve)
    for place in ready:
        if _is_change(series, reduced, place, curve, directions):
            return place
    newest = len(series.blocks) - max(MOST_AFTER_S / series.block_s, FEWEST_AFTER)
    series.candidates = [k for k in series.candidates if k > newest]
    return None


def _is_change(
    series: BlockSeries,
    reduced: ReducedBlocks,
    place: int,
    curve: PooledCurve,
    directions: Sequence[ResidualDirection],
) -> bool:
    """Whether the curve after a block differs, given a free shape and all directions."""
    after = slice(place, reduced.current)
    gram, score = reduced.grams.sum(axis=0), reduced.scores.sum(axis=0)
    known = [k for k in range(len(gram)) if gram[k, k] > 0.0 and not _is_time(k, directions)]
    later_gram = reduced.grams[after].sum(axis=0)[:TANGENTS]
    size = len(known) + TANGENTS
    inner, right = np.zeros((size, size)), np.zeros(size)
    inner[:-TANGENTS, :-TANGENTS], right[:-TANGENTS] = gram[np.ix_(known, known)], score[known]
    inner[-TANGENTS:, :-TANGENTS], inner[-TANGENTS:, -TANGENTS:] = (
        later_gram[:, known],
        later_gram[:, :TANGENTS],
    )
    inner[:-TANGENTS, -TANGENTS:] = later_gram[:, known].T
    right[-TANGENTS:] = reduced.scores[after].sum(axis=0)[:TANGENTS]
    ridge = [INFLATION * _precision(k, directions) for k in known]
    inner += np.diag([*ridge, *[0.0] * TANGENTS])
    scale = np.sqrt(np.maximum(inner.diagonal(), 1e-12))
    normalised = inner / scale / scale[:, None] + 1e-9 * np.eye(size)
    covariance = np.linalg.inv(normalised) / scale / scale[:, None]
    change = (covariance @ right)[-TANGENTS:]
    spread = INFLATION * covariance[-TANGENTS:, -TANGENTS:]
    chi_square = float(change @ np.linalg.lstsq(spread, change, rcond=None)[0])
    return chi_square > LEAST_CHI_SQUARE and _share(series, place, curve, change) > LEAST_CHANGE


def _share(series: BlockSeries, place: int, curve: PooledCurve, change: Array) -> float:
    """Change of the adhesion as a share of the adhesion, root mean square over the samples."""
    linear = linearise(curve)
    gram = np.sum([block.gram[:SIZE, :SIZE] for block in series.blocks[place:]], axis=0)
    moved = linear.changes[:, :TANGENTS] @ change
    whole = float(linear.curve @ gram @ linear.curve)
    return float(np.sqrt(max(float(moved @ gram @ moved), 0.0) / max(whole, 1e-12)))


def _is_time(k: int, directions: Sequence[ResidualDirection]) -> bool:
    """Whether a coefficient is that of the time, which a change of the surface looks like."""
    return k >= CURVE and directions[k - CURVE].name == TIME


def _precision(k: int, directions: Sequence[ResidualDirection]) -> float:
    """Prior precision of a coefficient that is no tangent; 0 for a tangent."""
    if k >= CURVE:
        return 1.0 / directions[k - CURVE].prior_std ** 2
    return 0.0 if k < TANGENTS else BUMP_STD**-2.0
