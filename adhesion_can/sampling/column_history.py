"""Recent readings of one signal as columns, block after block: `SignalHistory` in columns."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

Stamps = NDArray[np.int64]
NEVER = np.iinfo(np.int64).max
"""Stamp of a reading that has not come."""


class Bracketed(NamedTuple):
    """Values of a signal at given stamps, interpolated between the readings that bracket them.

    Attributes:
        value: Values, SI, shape (n,); NaN across a gap, beside a missing value, and where the
            bracket is not closed yet.
        known_us: Stamps of the messages that close the brackets, µs, shape (n,); `NEVER` where
            none has come.
        bracket_end_us: Times of the readings that close the brackets, µs, shape (n,); `NEVER` where
            none has come.
        step_std: Standard deviations of the values, had the signal stepped within the bracket, SI,
            shape (n,).
        share: Places of the stamps within their brackets, 0..1, shape (n,): 1 at the readings that
            close them.

    """

    value: Array
    known_us: Stamps
    bracket_end_us: Stamps
    step_std: Array
    share: Array


@dataclass(slots=True)
class ColumnHistory:
    """Readings of one signal that a bracket may still need, in the order of their stamps.

    Attributes:
        max_gap_us: Longest time between two readings that bracket a stamp, µs.
        lag_us: Delay of the readings' stamps behind the measurement, µs.
        t_us: Times of the measurements, µs, strictly ascending, shape (n,).
        value: Values, SI, shape (n,); NaN where not available.

    """

    max_gap_us: float
    lag_us: int = 0
    t_us: Stamps = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    value: Array = field(default_factory=lambda: np.empty(0))
    first_us: int = NEVER
    """Stamp of the first message ever."""

    def extend(self, stamps: Stamps, values: Array) -> None:
        """Add readings; stamps must not run backwards. Of two with one stamp the later counts."""
        if not len(stamps):
            return
        self.first_us = min(self.first_us, int(stamps[0]))
        t_us = np.concatenate([self.t_us, stamps - self.lag_us])
        last = np.append(t_us[1:] > t_us[:-1], True)
        self.t_us, self.value = t_us[last], np.concatenate([self.value, values])[last]

    def forget_before(self, t_us: int) -> None:
        """Drop the readings that no bracket at or after a stamp needs."""
        keep = max(int(np.searchsorted(self.t_us, t_us, side="right")) - 2, 0)
        self.t_us, self.value = self.t_us[keep:].copy(), self.value[keep:].copy()

    def at(self, t_us: Stamps) -> Bracketed:
        """Values at stamps, interpolated between the readings around them."""
        size = len(self.t_us)
        if not size:
            nothing = np.full(len(t_us), np.nan)
            never = np.full(len(t_us), NEVER)
            return Bracketed(nothing, never, never, 0 * nothing, nothing)
        place = np.searchsorted(self.t_us, t_us)
        closed = place < size
        after = np.minimum(place, size - 1)
        before = np.maximum(after - 1, 0)
        t0, t1 = self.t_us[before], self.t_us[after]
        left, right = self.value[before], self.value[after]
        span = t1 - t0
        exact = closed & (t1 == t_us)
        inside = closed & ~exact & (after > 0)
        share = (t_us - t0) / np.where(span > 0, span, 1)
        with np.errstate(invalid="ignore"):
            line = left + (right - left) * share
            # The rounded share of a stamp outside the bracket means nothing.
            step = np.abs(right - left) * np.sqrt(np.where(inside, share * (1.0 - share), 0.0))
        value = np.where(exact, right, np.where(inside & (span <= self.max_gap_us), line, np.nan))
        return Bracketed(
            value=value,
            known_us=np.where(closed, t1 + self.lag_us, NEVER),
            bracket_end_us=np.where(closed, t1, NEVER),
            step_std=np.where(inside & np.isfinite(step), step, 0.0),
            share=np.where(exact, 1.0, share),
        )

    def held_at(self, t_us: Stamps) -> tuple[Stamps, Array]:
        """Stamps and values of the last readings at or before stamps.

        The value is NaN where the reading is older than the gap allowed.
        """
        before = np.searchsorted(self.t_us, t_us, side="right") - 1
        if not len(self.t_us):
            return t_us, np.full(len(t_us), np.nan)
        fresh = (before >= 0) & (t_us - self.t_us[before] <= self.max_gap_us)
        return self.t_us[before], np.where(fresh, self.value[before], np.nan)

    def before(self, t_us: Stamps) -> NDArray[np.int64]:
        """Index of the last reading stamped before each stamp; -1 where there is none."""
        return np.searchsorted(self.t_us, t_us, side="left") - 1
