"""Lags of the slip, and what they make of the errors of the speeds behind it.

The slip that the contact follows has its errors smoothed by the same lag: they are smaller, and
last from sample to sample. With the vehicle speed smoothed alike a sample is consistent again:
speed and slip have the same errors, and these are as large as its variances say.
"""

from dataclasses import replace
from itertools import pairwise
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.effects import LagStates
from adhesion_can.physics.lag_states import LagRequest
from adhesion_can.physics.samples import Samples

CYCLES = 64
"""Number of times between two stamps whose median is taken for their cycle."""


class _SlipLag(NamedTuple):
    """Lag that has the slip as its target.

    Attributes:
        name: Name of the lag.
        rate: Rate of the lag, 1/s, shape (n,).

    """

    name: str
    rate: Array


class SlipLags(LagStates):
    """Lag states that know which of the lags smooth the slip."""

    def __init__(self) -> None:
        super().__init__()
        self._slip: Array | None = None
        self._found: list[_SlipLag] = []
        self._cycle, self._frame = _Cycle(), _Cycle()

    def watch(self, slip: Array) -> None:
        """Look for lags of this slip, and of what lags make of it, in the calls that follow."""
        self._slip = slip
        self._found = []

    def _respond(self, asked: LagRequest) -> Array:
        """Response of a lag to its targets, as `LagStates.follow` defines it."""
        x = super()._respond(asked)
        if asked.target is self._slip:
            rate = np.broadcast_to(asked.rate, np.shape(asked.target))
            self._found.append(_SlipLag(asked.name, rate))
            self._slip = x
        return x

    def smooth_errors(self, samples: Samples, time_s: Array) -> Samples:
        """Samples whose speed and variances of the slip are those behind the smoothed slip.

        Args:
            samples: Samples with the slips that are watched, at least one.
            time_s: Time of each sample as the lags have it, s, shape (n,).

        """
        if not self._found:
            return samples
        axle = samples.axle.astype(np.float64)
        speed, private, common = samples.speed, samples.slip_var, samples.slip_common_var
        cycle_s = self._cycle.add(samples.t_us[samples.axle == samples.axle[0]])
        frame_s = self._frame.add(samples.speed_us)
        for lag in self._found:
            name = f"{lag.name} of speed"
            speed = super()._respond(LagRequest(name, axle, time_s, speed, lag.rate))
            private = private * noise_gain(lag.rate * cycle_s)
            common = common * noise_gain(lag.rate * frame_s)
        return replace(samples, speed=speed, slip_var=private, slip_common_var=common)


class _Cycle:
    """Time between the stamps of a signal, by the first of them."""

    def __init__(self) -> None:
        self._latest_us: int | None = None
        self._steps_us: list[int] = []
        self._cycle_s = 0.0

    def add(self, stamps_us: NDArray[np.int64]) -> float:
        """Cycle after further stamps, s; 0 while there are fewer than two."""
        if len(self._steps_us) >= CYCLES:
            return self._cycle_s
        stamps = sorted(set(stamps_us.tolist()))
        before = stamps[0] if self._latest_us is None else self._latest_us
        self._steps_us += [
            step for earlier, later in pairwise([before, *stamps]) if (step := later - earlier) > 0
        ]
        self._latest_us = stamps[-1]
        self._cycle_s = 1e-6 * median(self._steps_us) if self._steps_us else 0.0
        return self._cycle_s


def noise_gain(exponent: Array) -> Array:
    """Variance of a lag's response to independent errors over theirs, shape (n,).

    The lag is that of `LagStates`: x_n = a x_(n-1) + b u_n + c u_(n-1) with a = e^(−E). Without
    a step (E = 0) it is not known, and taken as 1.

    Args:
        exponent: Rate of the lag times the time E between two errors, 1, shape (n,).

    """
    size = np.where(exponent > 0.0, exponent, 1.0)
    kept, mean = np.exp(-size), -np.expm1(-size) / size
    now, before = 1.0 - mean, mean - kept
    gain = (now * now + before * before + 2.0 * kept * now * before) / -np.expm1(-2.0 * size)
    return np.asarray(np.where(exponent > 0.0, gain, 1.0))
