"""Detection of a stuck signal: its frames are valid, and its value has stopped to change.

A measured quantity carries noise, so its readings change again and again, whatever it does. Noise
shows itself by changes of the slope that are large beside the resolution and reverse; a trend, and
the rounding of a smooth signal, do neither. How long a run of equal readings may be, the longest of
`WINDOW` runs says: one of more than `LIMIT_FACTOR` times that length comes by chance with a
probability of about `WINDOW ** -LIMIT_FACTOR` where runs end at random, and is taken for a fault.

A signal without noise (a command, a filtered speed) may stand still for long, and is not judged.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

WINDOW = 256
"""Number of changes from which noise and the longest run are known."""
LIMIT_FACTOR, LIMIT_MARGIN, LEAST_LIMIT = 4, 4, 24
"""Limit of a run of equal readings: factor on the longest run of a window, readings added, and
least limit: where a signal moves fast, its runs are shorter than noise alone makes them."""
STRONG_STEPS = 2.5
"""Size of a strong change of the slope, in steps of the signal's resolution."""
LEAST_REVERSALS = 48
"""Number of reversals between strong changes of the slope, in a window, from which a signal is
noisy. White noise of half a step of the resolution gives 27 at most, of 1.5 steps 71 at least, and
a smooth signal none."""


@dataclass(slots=True)
class StuckSignalCheck:
    """Supervision of the values of one signal.

    Attributes:
        resolution: Step of one raw bit, SI; 0 for floating point.
        rest: Value that may last, SI: that of the raw value 0, as of a train that stands.
        limit: Number of equal readings from which the signal is stuck; 0 while it is not judged.
        is_stuck: Whether it is stuck with the latest reading.

    """

    resolution: float
    rest: float
    limit: int = field(default=0, init=False)
    is_stuck: bool = field(default=False, init=False)
    _value: float | None = field(default=None, init=False)
    _run: int = field(default=0, init=False)
    """Number of equal readings up to the latest one."""
    _step: float = field(default=0.0, init=False)
    """Latest change of the value."""
    _turn: int = field(default=0, init=False)
    """Sign of the latest change of the slope; 0 where it was not strong."""
    _changes: int = field(default=0, init=False)
    _reversals: int = field(default=0, init=False)
    _longest: int = field(default=0, init=False)

    def accept(self, value: float) -> bool:
        """Whether the signal is stuck with this reading, SI."""
        if self._value is None:
            self._value, self._run = value, 1
        elif value == self._value:
            self._run += 1
        else:
            step = value - self._value
            bend, strong = step - self._step, STRONG_STEPS * self.resolution
            turn = (bend >= strong) - (bend <= -strong)
            run = 0 if self._value == self.rest else self._run  # a stop teaches nothing
            self._add_changes(1, run, int(turn * self._turn < 0))
            self._value, self._run, self._step, self._turn = value, 1, step, turn
            if self._changes == WINDOW:
                self._end_window()
        self.is_stuck = 0 < self.limit <= self._run and value != self.rest
        return self.is_stuck

    def accept_all(self, values: Array) -> NDArray[np.bool_]:
        """Whether the signal is stuck with each reading, as `accept` tells one after another.

        Args:
            values: Readings, SI, finite, shape (n,).

        """
        if not len(values):
            return np.zeros(0, dtype=np.bool_)
        if self._value is None:
            return np.append(self.accept(values.item(0)), self.accept_all(values[1:]))
        with np.errstate(over="ignore", invalid="ignore"):
            steps = np.diff(values, prepend=self._value)
            changed = np.flatnonzero(steps != 0.0)
            bends = np.diff(steps[changed], prepend=self._step)
        strong = STRONG_STEPS * self.resolution
        turns = (bends >= strong).astype(np.int64) - (bends <= -strong)
        reversed_ = turns * np.append(self._turn, turns[:-1]) < 0
        begins = np.append(-self._run, changed)
        runs = np.diff(begins)
        runs[np.append(self._value, values)[changed] == self.rest] = 0
        limits = self._limits(len(values), changed, runs, reversed_)
        run = np.arange(1, len(values) + 1) - np.repeat(
            begins, np.diff(changed, prepend=0, append=len(values))
        )
        if len(changed):
            self._step, self._turn = float(steps[changed[-1]]), int(turns[-1])
        self._value, self._run = values.item(-1), int(run[-1])
        stuck = (limits > 0) & (run >= limits) & (values != self.rest)
        self.is_stuck = bool(stuck[-1])
        return np.asarray(stuck)

    def _limits(
        self,
        size: int,
        changed: NDArray[np.int64],
        runs: NDArray[np.int64],
        reversed_: NDArray[np.bool_],
    ) -> NDArray[np.int64]:
        """Limit at each of so many readings, with the windows brought forward; shape (size,).

        Args:
            size: Number of readings, n.
            changed: Readings that differ from the one before, ascending, shape (k,).
            runs: Length of the run that each of them ended, shape (k,).
            reversed_: Whether each of them reversed a strong change of the slope, shape (k,).

        """
        limits = np.full(size, self.limit)
        done = 0
        while done < len(changed):
            end = min(done + WINDOW - self._changes, len(changed))
            rows = slice(done, end)
            self._add_changes(end - done, int(runs[rows].max()), int(reversed_[rows].sum()))
            if self._changes == WINDOW:
                self._end_window()
                limits[changed[end - 1] :] = self.limit
            done = end
        return limits

    def _add_changes(self, count: int, longest: int, reversals: int) -> None:
        """Count changes of one window, the longest run that they ended, and their reversals."""
        self._changes += count
        self._reversals += reversals
        # A fault must not teach that long runs are usual; a sensor that has become slower must.
        self._longest = max(self._longest, min(longest, self.limit) if self.limit else longest)

    def _end_window(self) -> None:
        limit = max(LIMIT_FACTOR * self._longest + LIMIT_MARGIN, LEAST_LIMIT)
        self.limit = limit if self._reversals >= LEAST_REVERSALS else 0
        self._changes = self._reversals = self._longest = 0
