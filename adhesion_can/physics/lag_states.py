"""First-order lags, axle by axle, over a whole drive or a step at a time.

The input of a lag is a straight line between its samples: the first-order-hold (ramp-invariant)
discretisation of Franklin, Powell and Workman, Digital Control of Dynamic Systems, 3rd ed. 1998,
ch. 6, which is exact for any step.
"""

from collections import OrderedDict
from copy import copy as shallow_copy
from itertools import pairwise
from math import expm1, inf
from typing import NamedTuple, Self

import numpy as np

from adhesion_can.arrays import Array

PAUSE_S = 1.0
"""Pause in an axle's samples after which they do not follow each other: lags start again, s."""
FEW = 48
"""Number of rows up to which a loop over the rows is faster than arrays."""
REMEMBERED = 32
"""Number of responses that are kept."""
_RANGE = 300.0
"""Largest exponent of a running sum; its exponential stays finite, and so do products with it."""


class LagRequest(NamedTuple):
    """What a lag follows, as `LagStates.follow` is asked.

    Attributes:
        name: Name of the lag.
        axle: Number of each row's axle, shape (n,).
        time_s: Time of each row, s, ascending for each axle; shape (n,).
        target: Value that is followed, in any unit; shape (n,).
        rate: Rate of the lag, 1/s, not negative; shape (n,) or one number.
        start: Value at an axle's first row and after a pause; None: the target there.

    """

    name: str
    axle: Array
    time_s: Array
    target: Array
    rate: Array | float
    start: float | None = None


class LagStates:
    """Latest stamps, states and targets of first-order lags, by name and axle.

    Args:
        pause_s: Pause in an axle's rows after which its lags start again, s.

    """

    few: float = FEW
    """Number of rows up to which they are taken one by one."""

    def __init__(self, pause_s: float = PAUSE_S) -> None:
        self._pause_s = pause_s
        self._states: dict[tuple[str, int], tuple[float, float, float]] = {}

    def follow(
        self,
        name: str,
        axle: Array,
        time_s: Array,
        target: Array,
        rate: Array | float,
        start: float | None = None,
    ) -> Array:
        """Response x of dx/dt = rate · (target − x), the target a straight line over each step.

        Args:
            name: Name of the lag.
            axle: Number of each row's axle, shape (n,).
            time_s: Time of each row, s, ascending for each axle; shape (n,).
            target: Value that x follows, in any unit; shape (n,).
            rate: Rate of the lag, 1/s, not negative; shape (n,) or one number.
            start: Value of x at an axle's first row and after a pause; None: the target there.

        Returns:
            Lagging value x, in the unit of the target; shape (n,).

        """
        return self._respond(LagRequest(name, axle, time_s, target, rate, start))

    def _respond(self, asked: LagRequest) -> Array:
        """Response as in `follow`; what a subclass does otherwise or besides."""
        name, axle, time_s, target, rate, start = asked
        rates = np.broadcast_to(np.asarray(rate, dtype=np.float64), np.shape(target))
        if len(target) <= self.few:
            return self._one_by_one(asked, rates)
        x = np.empty(len(target))
        for number in np.unique(axle):
            rows = np.flatnonzero(axle == number)
            key = (name, int(number))
            times, targets = time_s[rows], target[rows]
            known = self._states.get(key)
            steps = _steps(times, times[0] if known is None else known[0])
            begins = {int(row) for row in np.flatnonzero((steps > self._pause_s) | (steps < 0))}
            if known is None:
                begins.add(0)
            state, before = (0.0, 0.0) if known is None else known[1:]
            bounds = sorted(begins | {0, len(rows)})
            for first, last in pairwise(bounds):
                if first in begins:
                    before = float(targets[first])
                    state = before if start is None else start
                    steps[first] = 0.0
                part = slice(first, last)
                exponents = steps[part] * rates[rows[part]]
                x[rows[part]] = _lag(targets[part], before, exponents, state)
                state, before = float(x[rows[last - 1]]), float(targets[last - 1])
            self._states[key] = (float(times[-1]), state, before)
        return x

    def copy(self) -> Self:
        """Independent copy of the states."""
        other = shallow_copy(self)
        vars(other).update(_states=dict(self._states))
        return other

    def _one_by_one(self, asked: LagRequest, rates: Array) -> Array:
        """Response as in `follow`, row by row."""
        name, axle, time_s, target, _, start = asked
        x = []
        columns = (column.tolist() for column in (axle, time_s, target, rates))
        for number, time, wanted, rate in zip(*columns, strict=True):
            key = (name, int(number))
            since, state, before = self._states.get(key, (-inf, 0.0, 0.0))
            step = time - since
            if key not in self._states or not 0.0 <= step <= self._pause_s:
                state = wanted if start is None else start
            elif (exponent := step * rate) > 0.0:
                gone = -expm1(-exponent)
                share = 1.0 - gone - gone / exponent
                state += gone * (wanted - state) + share * (wanted - before)
            self._states[key] = (time, state, wanted)
            x.append(state)
        return np.array(x)


class SequentialLagStates(LagStates):
    """Lags whose response does not depend, to the last bit, on how the rows are divided.

    Args:
        pause_s: Pause in an axle's rows after which its lags start again, s.

    """

    few = inf

    def __deepcopy__(self, _: dict[int, object]) -> "SequentialLagStates":
        return self.copy()


class RememberedLagStates(LagStates):
    """Lags over the rows of one drive, the latest responses of which are kept.

    A search tries many effects on the same rows, and most trials leave the targets as they were.
    Axles and times are the same in every call, and every lag starts again in it.

    Args:
        pause_s: Pause in an axle's rows after which its lags start again, s.

    """

    def __init__(self, pause_s: float = PAUSE_S) -> None:
        super().__init__(pause_s)
        self._known: OrderedDict[tuple[object, ...], Array] = OrderedDict()

    def _respond(self, asked: LagRequest) -> Array:
        """Response as in `follow`, from the first row on."""
        rate = np.asarray(asked.rate, dtype=np.float64)
        key = (asked.name, asked.start, asked.target.tobytes(), rate.tobytes())
        response = self._known.get(key)
        if response is None:
            response = LagStates(self._pause_s).follow(*asked)
            response.flags.writeable = False
            self._known[key] = response
            if len(self._known) > REMEMBERED:
                self._known.popitem(last=False)
        return response


def _steps(values: Array, before: float) -> Array:
    """Increase of each value over the one in front of it, shape (n,)."""
    steps = np.empty(len(values))
    steps[0] = values[0] - before
    np.subtract(values[1:], values[:-1], out=steps[1:])
    return steps


def _lag(target: Array, before: float, exponent: Array, state: float) -> Array:
    """Response of a lag to straight lines between its targets, as pieces of a prefix sum.

    x_n = a x_(n-1) + b_n with a = e^(−E), b_n = u_n − a u_(n-1) − (u_n − u_(n-1)) (1 − a)/E. With S
    the running sum of the exponents E, x_n e^(S_n) is a running sum of b_n e^(S_n).
    """
    rise = _steps(target, before)
    gone = -np.expm1(-exponent)
    mean = np.divide(gone, exponent, out=np.ones_like(gone), where=exponent > 0)
    taken = gone * target + rise * (1.0 - gone - mean)
    total = np.cumsum(np.minimum(exponent, _RANGE / 4))
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
