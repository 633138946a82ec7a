"""A bounded rolling record of the service's readings, in columns."""

from collections.abc import Iterable
from math import inf

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.sampling.column_former import Readings, Signal

WINDOW_S = 480.0
"""Time that a record covers, s: about 10 MB of the packaged message set."""
MOST_READINGS = 100_000
"""Largest number of readings of one signal that are kept: 480 s at 200 Hz. Signals that come more
often shorten the record, not the memory of the machine."""
_FIRST_CAPACITY = 1024


def join_readings(parts: Iterable[Readings]) -> Readings:
    """Readings of several blocks, one behind the other."""
    columns: dict[Signal, tuple[list[NDArray[np.int64]], list[Array]]] = {}
    for part in parts:
        for key, (stamps, values) in part.items():
            column = columns.setdefault(key, ([], []))
            column[0].append(stamps)
            column[1].append(values)
    return {key: (np.concatenate(s), np.concatenate(v)) for key, (s, v) in columns.items()}


class _SignalColumn:
    """Readings of one signal in arrays with room at their end."""

    def __init__(self) -> None:
        self._t_us = np.empty(_FIRST_CAPACITY, dtype=np.int64)
        self._value = np.empty(_FIRST_CAPACITY)
        self._first = self._end = 0

    def __len__(self) -> int:
        return self._end - self._first

    @property
    def nbytes(self) -> int:
        """Memory of the arrays, bytes."""
        return self._t_us.nbytes + self._value.nbytes

    @property
    def t_us(self) -> NDArray[np.int64]:
        """Stamps, µs, a view."""
        return self._t_us[self._first : self._end]

    @property
    def value(self) -> Array:
        """Values, SI, NaN where not available; a view."""
        return self._value[self._first : self._end]

    def extend(self, t_us: NDArray[np.int64], value: Array) -> None:
        """Add readings behind the others."""
        added = len(t_us)
        if self._end + added > len(self._t_us):
            self._make_room(added)
        self._t_us[self._end : self._end + added] = t_us
        self._value[self._end : self._end + added] = value
        self._end += added

    def forget_before(self, t_us: int) -> None:
        """Drop readings stamped before a time, µs."""
        self._first += int(np.searchsorted(self.t_us, t_us))

    def keep_latest(self, number: int) -> None:
        """Drop all but so many of the latest readings."""
        self._first = max(self._first, self._end - number)

    def _make_room(self, added: int) -> None:
        kept_us, kept = self.t_us.copy(), self.value.copy()
        capacity = max(len(self._t_us), _FIRST_CAPACITY)
        while capacity < 1.5 * (len(kept) + added):
            capacity *= 2
        self._t_us, self._value = np.empty(capacity, dtype=np.int64), np.empty(capacity)
        self._first, self._end = 0, len(kept)
        self._t_us[: self._end], self._value[: self._end] = kept_us, kept


class ReadingRecord:
    """The latest readings of every signal.

    Args:
        window_s: Time that is kept, s.
        hole_s: Time without any reading after which the record starts again, s, as the service
            does; inf: never.
        most_readings: Largest number of readings of one signal that are kept.

    """

    def __init__(
        self,
        window_s: float = WINDOW_S,
        hole_s: float = inf,
        most_readings: int = MOST_READINGS,
    ) -> None:
        self._window_us = round(window_s * 1e6)
        self._hole_us = hole_s * 1e6
        self._most = most_readings
        self._columns: dict[Signal, _SignalColumn] = {}
        self._latest_us: int | None = None

    @property
    def nbytes(self) -> int:
        """Memory of the readings, bytes."""
        return sum(column.nbytes for column in self._columns.values())

    @property
    def end_us(self) -> int | None:
        """Latest stamp, µs; None where the record is empty."""
        return self._latest_us

    @property
    def begin_us(self) -> int | None:
        """Earliest stamp, µs; None where the record is empty."""
        firsts = [int(column.t_us[0]) for column in self._columns.values() if len(column)]
        return min(firsts, default=None)

    @property
    def length_s(self) -> float:
        """Time from the earliest to the latest stamp, s; 0 where the record is empty."""
        begin_us, end_us = self.begin_us, self._latest_us
        return 0.0 if begin_us is None or end_us is None else (end_us - begin_us) / 1e6

    def add(self, readings: Readings) -> None:
        """Add readings; stamps of a signal do not run backwards."""
        given = {key: pair for key, pair in readings.items() if len(pair[0])}
        if not given:
            return
        begin_us = min(int(stamps[0]) for stamps, _ in given.values())
        if self._latest_us is not None and begin_us - self._latest_us > self._hole_us:
            self.clear()
        for key, (stamps, values) in given.items():
            self._columns.setdefault(key, _SignalColumn()).extend(stamps, values)
        latest_us = max(int(stamps[-1]) for stamps, _ in given.values())
        self._latest_us = max(latest_us, self._latest_us or latest_us)
        self._forget()

    def clear(self) -> None:
        """Forget all readings."""
        self._columns.clear()
        self._latest_us = None

    def between(self, from_us: int, to_us: int) -> Readings:
        """Copies of the readings stamped from one time on and before another, µs."""
        readings = {}
        for key, column in self._columns.items():
            stamps = column.t_us
            rows = slice(*np.searchsorted(stamps, (from_us, to_us)).tolist())
            if rows.start < rows.stop:
                readings[key] = stamps[rows].copy(), column.value[rows].copy()
        return readings

    def whole(self) -> Readings:
        """Copies of all readings."""
        if self._latest_us is None:
            return {}
        return self.between(self.begin_us or 0, self._latest_us + 1)

    def _forget(self) -> None:
        """Drop what is too old, or too much."""
        oldest_us = (self._latest_us or 0) - self._window_us
        for column in self._columns.values():
            if len(column) > self._most:
                column.keep_latest(self._most)
                # What one signal has lost, all have: the record begins at one time.
                oldest_us = max(oldest_us, int(column.t_us[0]))
        for column in self._columns.values():
            column.forget_before(oldest_us)
