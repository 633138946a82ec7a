"""Noise of the slips of a table, which states none.

A slip that reads high by ε leaves a residual lower by slope · ε. High differences of both, in which
slips that wheels can follow vanish, are correlated by that alone: a moment estimate of errors in
variables (Fuller, Measurement Error Models, 1987, ch. 1).
"""

from math import comb

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.regression.whitening import ContiguousRuns

ORDER = 3
"""Order of the differences: of a sweep of 5 s, read every 50 ms, 3e-4 of its amplitude remain."""
WHITE = comb(2 * ORDER, ORDER)
"""Variance of a difference of white noise of variance 1."""
OVERLAP = sum((comb(2 * ORDER, ORDER + k) / WHITE) ** 2 for k in range(-ORDER, ORDER + 1))
"""Variance of a mean of products of two such differences, which overlap, over that of as many that
do not: the sum of their squared autocorrelations."""
FEWEST = 200
"""Least number of differences that give an estimate."""
CERTAIN = 3.0
"""Estimate of the variance in its standard errors below which there is no noise."""


def estimate_slip_noise(
    slip: Array, residual: Array, slope: Array, runs: ContiguousRuns, rows: NDArray[np.bool_]
) -> float:
    """Standard deviation of the slips' white noise; 0 where none shows.

    Args:
        slip: Slip ratios, shape (n,).
        residual: Measured less predicted adhesion, shape (n,).
        slope: Slope dμ/dλ of the curve, shape (n,).
        runs: Runs of rows that follow each other.
        rows: Rows that count, shape (n,).

    """
    inside = rows[ORDER:].copy()
    inside &= np.logical_and.reduce([rows[k : len(rows) - ORDER + k] for k in range(ORDER)])
    first = np.zeros(len(rows), dtype=np.bool_)
    first[runs.starts] = True
    # A difference over the begin of a run joins what does not follow each other.
    for k in range(1, ORDER + 1):
        inside &= ~first[k : len(rows) - ORDER + k]
    if np.count_nonzero(inside) < FEWEST:
        return 0.0
    size = np.diff(slip, ORDER)[inside]
    change = np.diff(residual, ORDER)[inside]
    weight = slope[ORDER:][inside]
    products = -weight * size * change
    explained = float(np.sum(products))
    error = float(np.sqrt(OVERLAP * np.sum(products**2)))
    scale = float(np.sum(weight**2)) * WHITE
    if scale == 0.0 or explained < CERTAIN * error:
        return 0.0
    # No more of it is noise than there is.
    largest = float(np.mean(size**2)) / WHITE
    return float(np.sqrt(min(explained / scale, largest)))
