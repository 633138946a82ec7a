"""Sums in an order that is written down: of samples one after the other, of curves in lanes.

An estimate rests on long sums of rounded numbers, and another order rounds otherwise. In these the
order is that of the text, whatever the processor's vector unit and however NumPy splits its own.
"""

import numpy as np

from adhesion_can.arrays import Array

LANES = 16
"""Number of partial sums over curves: curve k goes to sum k modulo `LANES`, and they are added up
one after the other."""


def sum_in_order(values: Array) -> Array:
    """Sums over the last axis, one value after the other; shape (..) from (.., n)."""
    return np.asarray(np.add.accumulate(values, axis=-1)[..., -1])


def sum_in_lanes(values: Array) -> Array:
    """Sums over the last axis in partial sums, as `LANES` says; shape (rows,) from (rows, n)."""
    rows, size = values.shape
    whole = size - size % LANES
    lanes = np.add.reduce(values[:, :whole].reshape(rows, -1, LANES), axis=1)
    lanes[:, : size - whole] += values[:, whole:]
    return sum_in_order(lanes)
