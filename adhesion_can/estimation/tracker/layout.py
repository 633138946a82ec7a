"""Layout of a vector of sums, which `curve_sums` defines."""

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
