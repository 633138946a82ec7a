"""Layout of a vector of sums, and of what the kernels give; `curve_sums` defines the sums.

Apart from them, so that both implementations of the kernels share it.
"""

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.estimation.tracker.settings import C2_RANGE

NODES = 40
X_RANGE = (float(np.log(C2_RANGE[0])), float(np.log(C2_RANGE[1])))

CHEBYSHEV: Array = np.cos(np.pi * (2 * np.arange(NODES) + 1) / (2 * NODES))
"""Chebyshev nodes in −1..1, descending."""
X_NODES: Array = X_RANGE[0] + (X_RANGE[1] - X_RANGE[0]) * (CHEBYSHEV + 1) / 2
"""ln c2 of the nodes, descending."""
C2_NODES: Array = np.exp(X_NODES)
C2_SQUARES: Array = C2_NODES * C2_NODES

A, B, C = slice(0, NODES), slice(NODES, 2 * NODES), slice(2 * NODES, 3 * NODES)
D, E, Z, DOF, COUNT = range(3 * NODES, 3 * NODES + 5)
"""Indices in a vector of sums. DOF is the number of degrees of freedom of J, a little less than
COUNT where slips are not exact."""
BINS = 64
HISTOGRAM = slice(COUNT + 1, COUNT + 1 + BINS)
"""Number of samples by the slip that they surely reached, from 0 to the model's largest slip."""
LENGTH = COUNT + 1 + BINS
CORRECTED, MEASURED = 0, 1
"""Rows of an increment: sums with corrected scores, and with the slips as measured."""

CERTAIN_STDS = 4.0
"""Standard deviations beyond which the sign of a measured slip is its true one."""
LARGEST_EXPONENT = 8.0
"""Largest exponent of e^(−c2 λ): a slip below zero is an error, which must not become 1e20."""
WIDE_ERROR, TOO_WIDE = 0.02, 0.1
"""c2² p from which the private error is as wide as the bend of the curve: the correction of the
slope is limited there, and that of the sums."""

SUMMARY_MEDIANS, SUMMARY_HEIGHT, SUMMARY_PLACE = slice(0, 3), slice(3, 6), slice(6, 9)
SUMMARY_COVARIANCE = slice(9, 18)
SUMMARY_FALL, SUMMARY_HEIGHT_VAR, SUMMARY_PLACE_VAR, SUMMARY_EFFECTIVE = range(18, 22)
SUMMARY_LENGTH = 22
"""Indices in the summary of weighted curves: medians of (μ_m, λ_m, s), quantiles of μ_max and of
λ_m, covariance of (c1, c2, c3) row by row, mean of c3, variances of μ_max and λ_m, and the
effective number of curves."""
QUANTILES = (0.05, 0.5, 0.95)
"""Probabilities of the quantiles in a summary."""

NEW_MEAN, NEW_STD = (0.3, 0.15), (0.4, 0.4)
"""Prior mean and standard deviation of (c1, c3) of a new surface."""
NEW_PRECISION = (NEW_STD[0] ** -2.0, NEW_STD[1] ** -2.0)
NEW_SQUARE = (NEW_MEAN[0] / NEW_STD[0]) ** 2 + (NEW_MEAN[1] / NEW_STD[1]) ** 2
"""Inverse variances, and square of the mean in its standard deviations."""
