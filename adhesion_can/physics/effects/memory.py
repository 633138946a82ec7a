"""What lags behind: first-order lags, axle by axle, over a whole drive or a step at a time."""

from itertools import pairwise

import numpy as np

from adhesion_can.physics.burckhardt import Array

PAUSE_S = 1.0
"""After a pause this long in an axle's samples, what lags behind begins anew."""
_RANGE = 300.0
"""Exponents that stay finite, and with room for the products with them."""


class Memory:
    """States of first-order lags by name and axle, and the stamps at which they stood so."""

    def __init__(self) -> None:
        self._states: dict[tuple[str, int], tuple[float, float]] = {}

    def follow(
        self,
        name: str,
        axle: Array,
        time_s: Array,
        target: Array,
        rate: Array | float,
        start: float | None = None,
    ) -> Array:
        """X of dx/dt = rate · (target − x), the target held over each step.

        Args:
            name: of the lag.
            axle: of each row, shape (n,).
            time_s: of each row, ascending for each axle, shape (n,).
            target: shape (n,).
            rate: 1/s, not negative, shape (n,) or a number.
            start: x at an axle's first row and after a pause; None: the target there.

        Returns:
            x, shape (n,).

        """
        rates = np.broadcast_to(np.asarray(rate, dtype=np.float64), np.shape(target))
        x = np.empty(len(target))
        for number in np.unique(axle):
            rows = np.flatnonzero(axle == number)
            key = (name, int(number))
            times, targets = time_s[rows], target[rows]
            known = self._states.get(key)
            steps = np.diff(times, prepend=times[0] if known is None else known[0])
            begins = np.flatnonzero((steps > PAUSE_S) | (steps < 0))
            if known is None:
                begins = np.union1d(begins, [0])
            state = 0.0 if known is None else known[1]
            bounds = np.union1d(begins, [0, len(rows)]).astype(np.int64)
            for first, last in pairwise(bounds):
                if first in begins:
                    state = float(targets[first]) if start is None else start
                    steps[first] = 0.0
                part = slice(first, last)
                x[rows[part]] = _lag(targets[part], steps[part] * rates[rows[part]], state)
                state = float(x[rows[last - 1]])
            self._states[key] = (float(times[-1]), state)
        return x


def _lag(target: Array, exponent: Array, state: float) -> Array:
    """x_n = x_(n-1) + (1 − e^(−exponent_n)) (target_n − x_(n-1)), in stretches of one sum each.

    With S the running sum of the exponents, x_n e^(S_n) is a running sum of the inputs' e^(S_n).
    """
    exponent = np.minimum(exponent, _RANGE / 4)
    total = np.cumsum(exponent)
    taken = -np.expm1(-exponent) * target
    x = np.empty(len(target))
    first = 0
    while first < len(target):
        base = total[first - 1] if first else 0.0
        last = int(np.searchsorted(total, base + _RANGE, side="right"))
        grown = np.exp(total[first:last] - base)
        x[first:last] = (state + np.cumsum(taken[first:last] * grown)) / grown
        state = float(x[last - 1])
        first = last
    return x
