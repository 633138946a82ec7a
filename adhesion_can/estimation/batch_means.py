"""Inflation of a variance by errors that last, from means over batches of several lengths.

Batch means (Glynn & Whitt, Operations Research Letters 10, 1991), of the length that scatters most.
"""

from adhesion_can.arrays import Array

FEWEST = 6
"""Number of blocks below which their scatter says nothing."""
FITTED = 1.5
"""Coefficients that the blocks' scores lose to the fit."""


def batch_inflation(score: Array, noise: Array) -> float:
    """Largest variance of batch sums over the expected one, for batches of 1, 2, 4, .. blocks.

    Args:
        score: Sum of weighted errors of each block, shape (n,).
        noise: Expected square of each by independent errors, shape (n,).

    Returns:
        Ratio of variances, at least 1; 1 where there are too few blocks.

    """
    inflation = 1.0
    while len(score) >= FEWEST and noise.sum() > 0.0:
        few = len(score) / (len(score) - FITTED)
        inflation = max(inflation, float(score @ score) / float(noise.sum()) * few)
        pairs = len(score) // 2 * 2
        score = score[0:pairs:2] + score[1:pairs:2]
        noise = noise[0:pairs:2] + noise[1:pairs:2]
    return inflation
