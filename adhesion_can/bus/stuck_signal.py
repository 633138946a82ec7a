"""Detection of a stuck signal: its frames are valid, and its value has stopped to change.

A measured quantity carries noise, so its readings change again and again, whatever it does. Noise
shows itself by changes of the slope that are large beside the resolution and reverse; a trend, and
the rounding of a smooth signal, do neither. How long a run of equal readings may be, two things say
that were seen in a window of changes:

- the longest run: where runs end at random, one of more than `LIMIT_FACTOR` times that length comes
  with a probability of about `WINDOW ** -LIMIT_FACTOR`;
- the noise: a trend makes runs shorter, and noise alone with the standard deviation s, in steps of
  the resolution, gives equal neighbours with the probability 1 / (2 sqrt(pi) s).

A longer run is taken for a fault. A signal without noise (a command, a filtered speed) may stand
still for long, and is not judged.
"""

from dataclasses import dataclass, field
from math import ceil, log, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

WINDOW = 256
"""Number of changes from which noise and the longest run are known."""
LIMIT_FACTOR, LIMIT_MARGIN = 4, 4
"""Limit of a run of equal readings by the longest run: factor, and readings added."""
FALSE_ALARM = 1e-10
"""Probability of a run beyond the limit by the noise alone."""
MOST_EQUAL, LEAST_EQUAL = 0.5, 0.02
"""Range of the probability of equal neighbours that the noise gives."""
MOST_READINGS = 64
"""Mean length of a run up to which a signal is judged: one that changes more seldom is a command,
or measured too seldom to say within seconds that it is stuck."""
STRONG_STEPS = 2.5
"""Size of a strong change of the slope, in steps of the signal's resolution."""
LEAST_REVERSALS = 48
"""Number of reversals between strong changes of the slope, in a window, from which a signal is
noisy. White noise of half a step of the resolution gives 27 at most, of 1.5 steps 71 at least, and
a smooth signal none."""
MEDIAN_CHANGE = 0.6745 * sqrt(6.0)
"""Median size of a change of the slope in white noise, in standard deviations."""


@dataclass(slots=True)
class StuckSignalCheck:
    """Supervision of the values of one signal.

    Attributes:
        resolution: Step of one raw bit, SI; 0 for floating point.
        rest: Value that may last, within half a step of the resolution, SI: no speed, no effort.
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
    _changes: list[float] = field(default_factory=list, init=False)
    """Changes of the slope in this window."""
    _reversals: int = field(default=0, init=False)
    _longest: int = field(default=0, init=False)
    _total: int = field(default=0, init=False)
    """Number of readings in the runs of this window."""

    def accept(self, value: float) -> bool:
        """Whether the signal is stuck with this reading, SI."""
        if self._value is None:
            self._value, self._run = value, 1
        elif value == self._value:
            self._run += 1
        else:
            step = value - self._value
            change, strong = step - self._step, STRONG_STEPS * self.resolution
            turn = (change >= strong) - (change <= -strong)
            self._changes.append(change)
            self._reversals += turn * self._turn < 0
            run = self._usual(self._run, self._value)
            self._total += run
            self._longest = max(self._longest, run)
            self._value, self._run, self._step, self._turn = value, 1, step, turn
            if len(self._changes) == WINDOW:
                self._end_window()
        self.is_stuck = 0 < self.limit <= self._run and not self._rests(value)
        return self.is_stuck

    def _rests(self, value: float) -> bool:
        return abs(value - self.rest) <= self.resolution / 2.0

    def _usual(self, run: int, value: float) -> int:
        """Length of a run as far as it says how long one may be.

        A stop says nothing. A fault must not teach that long runs are usual; a sensor that has
        become slower must.
        """
        if self._rests(value):
            return 0
        return min(run, self.limit) if self.limit else run

    def accept_all(self, values: Array) -> NDArray[np.bool_]:
        """Whether the signal is stuck with each reading, as `accept` reports one after another.

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
            changes = np.diff(steps[changed], prepend=self._step)
            rests = np.abs(np.append(self._value, values) - self.rest) <= self.resolution / 2.0
        strong = STRONG_STEPS * self.resolution
        turns = (changes >= strong).astype(np.int64) - (changes <= -strong)
        begins = np.append(-self._run, changed)
        ended = np.diff(begins)
        ended[rests[changed]] = 0
        reversed_ = turns * np.append(self._turn, turns[:-1]) < 0
        limits = self._limits(len(values), changed, changes, ended, reversed_)
        run = np.arange(1, len(values) + 1) - np.repeat(
            begins, np.diff(changed, prepend=0, append=len(values))
        )
        if len(changed):
            self._step, self._turn = steps.item(changed[-1]), turns.item(-1)
        self._value, self._run = values.item(-1), run.item(-1)
        stuck = (limits > 0) & (run >= limits) & ~rests[1:]
        self.is_stuck = bool(stuck[-1])
        return np.asarray(stuck)

    def _limits(
        self,
        size: int,
        changed: NDArray[np.int64],
        changes: Array,
        ended: NDArray[np.int64],
        reversed_: NDArray[np.bool_],
    ) -> NDArray[np.int64]:
        """Limit at each of so many readings, with the windows brought forward; shape (size,).

        Args:
            size: Number of readings, n.
            changed: Readings that differ from the one before, ascending, shape (k,).
            changes: Changes of the slope at these, SI, shape (k,).
            ended: Length of the run that each of them ended, 0 for a stop, shape (k,).
            reversed_: Whether each of them reversed a strong change of the slope, shape (k,).

        """
        limits = np.full(size, self.limit)
        done = 0
        while done < len(changed):
            rows = slice(done, min(done + WINDOW - len(self._changes), len(changed)))
            runs = np.minimum(ended[rows], self.limit) if self.limit else ended[rows]
            self._changes += changes[rows].tolist()
            self._reversals += int(reversed_[rows].sum())
            self._total += int(runs.sum())
            self._longest = max(self._longest, int(runs.max()))
            done = rows.stop
            if len(self._changes) == WINDOW:
                self._end_window()
                limits[changed[done - 1] :] = self.limit
        return limits

    def _end_window(self) -> None:
        by_runs = LIMIT_FACTOR * self._longest + LIMIT_MARGIN
        by_noise = ceil(self._most_equal() * max(self._total / WINDOW, 1.0))
        judged = self._reversals >= LEAST_REVERSALS and self._total <= MOST_READINGS * WINDOW
        self.limit = max(by_runs, by_noise) if judged else 0
        self._changes.clear()
        self._reversals = self._longest = self._total = 0

    def _most_equal(self) -> float:
        """Number of equal neighbours in a row that noise gives with the set probability."""
        changes = np.abs(self._changes)
        steps = float(np.median(changes)) / MEDIAN_CHANGE
        # Where equal neighbours have the probability that the noise gives to a signal at rest.
        equal = self.resolution / (2.0 * sqrt(pi) * steps) if steps > 0.0 else MOST_EQUAL
        return 1.0 + log(FALSE_ALARM) / log(min(max(equal, LEAST_EQUAL), MOST_EQUAL))
