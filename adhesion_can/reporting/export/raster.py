"""Signals of many messages on one time base: the value that each one had last."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from math import inf
from typing import NamedTuple

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.bus.database import cycle_us
from adhesion_can.errors import InputError
from adhesion_can.plurals import counted
from adhesion_can.reporting.export.layout import FLOAT, Field, FieldColumn, GroupRows

UNITS_NS = {"us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}
"""Nanoseconds by unit of time."""
LONGEST_EMPTY_NS = 60_000_000_000
"""Time without a reading of any signal beyond which a hole has no rows but those that hold, ns."""
MOST_ROWS = 1 << 16
"""Largest number of rows that are in memory at once."""
LONGEST_HOLD = 3.0
"""Cycles of a message after which its last value is no longer held."""


class _Held(NamedTuple):
    """Latest value of a signal, and its stamp, ns."""

    value: float
    t_ns: int


class Raster:
    """Values of signals at even times; each holds until its next reading.

    A value is held for at most three cycles of its message, where the database gives the cycle:
    what was lost is a gap, and not what was there before.

    Args:
        step_ns: Time between two rows, ns.

    """

    def __init__(self, step_ns: int) -> None:
        self._step_ns = step_ns
        self._limits: dict[str, float] = {}
        self._held: dict[str, _Held] = {}
        self._fields: dict[str, Field] = {}
        self._next_ns = self._last_ns = -1
        self._holes = 0
        self._longest_ns = 0

    def expect(self, messages: Iterable[Message], rows: Sequence[GroupRows]) -> None:
        """Note the signals of rows that will be added, for the fields of the table.

        Args:
            messages: Messages of the rows, in their order.
            rows: Rows of some messages.

        """
        for message, part in zip(messages, rows, strict=True):
            stated_us = cycle_us(message)
            limit = LONGEST_HOLD * stated_us * 1e3 if stated_us else inf
            for field in part.group.fields:
                name = f"{part.group.name}.{field.name}"
                self._limits[name] = limit
                self._fields.setdefault(
                    name, replace(field, name=name, dtype=FLOAT, optional=True, raw=None)
                )

    @property
    def fields(self) -> tuple[Field, ...]:
        """A field for each signal that is expected."""
        return tuple(self._fields.values())

    def problems(self) -> list[str]:
        """Sentence about the holes that have no rows, in a list; [] where there is none."""
        if not self._holes:
            return []
        holes = f"{counted(self._holes, 'hole')} of more than {LONGEST_EMPTY_NS / 1e9:g} s"
        longest = f"the longest {self._longest_ns / 1e9:.0f} s"
        return [f"no rows in {holes} without a frame of a selected signal, {longest}"]

    def add(
        self, rows: Sequence[GroupRows]
    ) -> Iterator[tuple[NDArray[np.int64], list[FieldColumn]]]:
        """Stamps, ns, shape (n,), and columns of the even times up to the last of more rows.

        They come in pieces, so that memory is bounded however small the step is. Even times long
        after the latest reading and before the next one are left out.

        Args:
            rows: Rows of some messages; those of one call follow those of the calls before.

        """
        stamps = np.unique(np.concatenate([np.empty(0, np.int64), *(p.t_ns for p in rows)]))
        if not len(stamps):
            return
        if self._last_ns < 0:
            self._next_ns = self._last_ns = int(stamps[0])
        readings = self._readings(rows)
        for last_ns in self._ends_of_stretches(stamps):
            while self._next_ns <= last_ns:
                end_ns = min(self._next_ns + MOST_ROWS * self._step_ns, last_ns + 1)
                even = np.arange(self._next_ns, end_ns, self._step_ns, dtype=np.int64)
                yield even, [self._hold(name, even, *readings[name]) for name in self._fields]
                self._next_ns = int(even[-1]) + self._step_ns
        for name, (t_ns, values) in readings.items():
            if len(t_ns):
                self._held[name] = _Held(float(values[-1]), int(t_ns[-1]))

    def _ends_of_stretches(self, stamps: NDArray[np.int64]) -> Iterator[int]:
        """End of each stretch of time that has rows, ns; behind it the next row is moved on.

        Args:
            stamps: Stamps of readings, ns, ascending.

        """
        at_ns = np.concatenate([[self._last_ns], stamps])
        self._last_ns = max(self._last_ns, int(stamps[-1]))
        for place in np.flatnonzero(np.diff(at_ns) > LONGEST_EMPTY_NS).tolist():
            from_ns, until_ns = int(at_ns[place]), int(at_ns[place + 1])
            self._holes += 1
            self._longest_ns = max(self._longest_ns, until_ns - from_ns)
            held_ns = max((limit for limit in self._limits.values() if limit < inf), default=0.0)
            yield from_ns + round(min(held_ns, LONGEST_EMPTY_NS))
            steps = max(-((self._next_ns - until_ns) // self._step_ns), 0)
            self._next_ns += steps * self._step_ns
        yield int(at_ns[-1])

    def _readings(self, rows: Sequence[GroupRows]) -> dict[str, tuple[NDArray[np.int64], Array]]:
        """Stamps, ns, ascending, and values of each signal, its latest one before them first."""
        by_name = {
            name: (np.array([held.t_ns], dtype=np.int64), np.array([held.value]))
            for name, held in self._held.items()
        }
        nothing = np.empty(0, dtype=np.int64), np.empty(0)
        for part in rows:
            for field, column in zip(part.group.fields, part.columns, strict=True):
                name = f"{part.group.name}.{field.name}"
                there = slice(None) if column.missing is None else ~column.missing
                order = np.argsort(part.t_ns[there], kind="stable")
                t_ns, values = by_name.get(name, nothing)
                by_name[name] = (
                    np.concatenate([t_ns, part.t_ns[there][order]]),
                    np.concatenate([values, column.values[there][order].astype(np.float64)]),
                )
        return {name: by_name.get(name, nothing) for name in self._fields}

    def _hold(
        self, name: str, even: NDArray[np.int64], stamps: NDArray[np.int64], values: Array
    ) -> FieldColumn:
        """Values of a signal at even times, by its readings."""
        if not len(stamps):
            return FieldColumn(np.zeros(len(even)), np.ones(len(even), dtype=np.bool_))
        place = np.searchsorted(stamps, even, side="right") - 1
        known = place >= 0
        held = values[np.maximum(place, 0)]
        age = even - stamps[np.maximum(place, 0)]
        return FieldColumn(held, ~(known & (age <= self._limits[name])))


def parse_raster(text: str) -> int:
    """Nanoseconds of a time with its unit, such as '10ms'.

    Raises:
        InputError: The text is not a time, or not above 0.

    """
    number = text.strip().rstrip("usm")
    unit = text.strip()[len(number) :]
    try:
        step_ns = round(float(number) * UNITS_NS[unit])
    except (ValueError, KeyError, OverflowError):
        step_ns = 0
    if step_ns <= 0:
        raise InputError(
            f"--raster {text}", "is not a time", "give a number with us, ms or s, such as 10ms"
        )
    return step_ns
