"""How much more errors that last scatter the means of a residual than independent ones would."""

from typing import NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.batch_means import FEWEST, batch_inflation
from adhesion_can.estimation.doubt.blocks import ReducedBlocks

LASTING = 4.0
"""Inflation of the variance from which errors last beyond chance."""


class LastingErrors(NamedTuple):
    """Errors of the residual that last.

    Attributes:
        inflation: Variance of a mean residual over that by independent errors; at least 1.
        level_std: Standard deviation of the curve's level c1 from block to block, beyond
            independent errors.

    """

    inflation: float
    level_std: float

    @property
    def beyond_chance(self) -> float:
        """Inflation where it is beyond chance, else 1."""
        return self.inflation if self.inflation > LASTING else 1.0


NONE = LastingErrors(1.0, 0.0)
"""Independent errors."""


def estimate_lasting_errors(
    blocks: ReducedBlocks, known: int, change: Array | None = None
) -> LastingErrors | None:
    """Lasting errors along the level of the curve, from the scatter of blocks of several lengths.

    By batch means, of the length that scatters most.

    Args:
        blocks: Blocks at the pooled curve.
        known: Number of the first blocks that are used.
        change: Coefficients that are estimated besides the pooled curve, shape (k,); None: zeros.

    Returns:
        Lasting errors; None where there are too few blocks.

    """
    if known < FEWEST:
        return None
    score = blocks.scores[:known, 0]
    if change is not None:
        score = score - blocks.grams[:known, 0] @ change
    information = blocks.grams[:known, 0, 0]
    noise = blocks.level_noise[:known]
    total = float(information.sum())
    if not total > 0.0:
        return None
    fluctuation = float(score @ (score / np.maximum(information, 1e-3 * total / known)))
    expected = float(noise @ (1.0 / np.maximum(information, 1e-3 * total / known)))
    level_std = np.sqrt(max(fluctuation - expected, 0.0) / total)
    return LastingErrors(batch_inflation(score, noise), float(level_std))


def slip_inflation(blocks: ReducedBlocks, scale: int) -> float:
    """Inflation of the variance by errors of the vehicle speed that last; 1 by chance.

    Args:
        blocks: Blocks at the pooled curve.
        scale: Index of the coefficient of the speed's scale.

    """
    current = slice(0, blocks.current)
    information = blocks.grams[current, scale, scale]
    total = float(information.sum())
    if not total > 0.0:
        return 1.0
    # What errors of the slips add counts as noise here. By them a block may show less than nothing.
    noise = np.maximum(information, 0.0) * (1.0 + float(blocks.dilution[scale, scale]) / total)
    inflation = batch_inflation(blocks.scores[current, scale], noise)
    return inflation if inflation > LASTING else 1.0
