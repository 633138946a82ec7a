"""Signals of many messages on one time base: the value that each one had last."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import inf
from typing import NamedTuple

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from adhesion_can.bus.database import cycle_us
from adhesion_can.errors import InputError
from adhesion_can.reporting.export.layout import FLOAT, Column, Field, Rows

UNITS_NS = {"us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}
"""Nanoseconds by unit of time."""
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
        self._next_ns: int | None = None

    def expect(self, messages: Iterable[Message], rows: Sequence[Rows]) -> None:
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

    def add(self, rows: Sequence[Rows]) -> tuple[NDArray[np.int64], list[Column]]:
        """Stamps, ns, shape (n,), and columns of the even times up to the last of more rows.

        Args:
            rows: Rows of some messages; those of one call follow those of the calls before.

        """
        stamps = [part.t_ns for part in rows if len(part.t_ns)]
        if not stamps:
            return np.empty(0, dtype=np.int64), [Column(np.empty(0)) for _ in self._fields]
        if self._next_ns is None:
            self._next_ns = int(min(t_ns.min() for t_ns in stamps))
        last_ns = int(max(t_ns.max() for t_ns in stamps))
        even = np.arange(self._next_ns, last_ns + 1, self._step_ns, dtype=np.int64)
        if len(even):
            self._next_ns = int(even[-1]) + self._step_ns
        given = {
            f"{part.group.name}.{field.name}": (part.t_ns, column)
            for part in rows
            for field, column in zip(part.group.fields, part.columns, strict=True)
        }
        return even, [
            self._hold(name, even, *given.get(name, (None, None))) for name in self._fields
        ]

    def _hold(
        self, name: str, even: NDArray[np.int64], t_ns: NDArray[np.int64] | None, new: Column | None
    ) -> Column:
        """Values of a signal at even times, by its latest one and new readings."""
        before = self._held.get(name)
        stamps = np.array([before.t_ns] if before else [], dtype=np.int64)
        values = np.array([before.value] if before else [], dtype=np.float64)
        if t_ns is not None and new is not None:
            there = slice(None) if new.missing is None else ~new.missing
            order = np.argsort(t_ns[there], kind="stable")
            stamps = np.concatenate([stamps, t_ns[there][order]])
            values = np.concatenate([values, new.values[there][order].astype(np.float64)])
        limit = self._limits[name]
        if not len(stamps):
            return Column(np.zeros(len(even)), np.ones(len(even), dtype=np.bool_))
        self._held[name] = _Held(float(values[-1]), int(stamps[-1]))
        place = np.searchsorted(stamps, even, side="right") - 1
        known = place >= 0
        held = values[np.maximum(place, 0)]
        age = even - stamps[np.maximum(place, 0)]
        return Column(held, ~(known & (age <= limit)))


def parse_raster(text: str) -> int:
    """Nanoseconds of a time with its unit, such as '10ms'.

    Raises:
        InputError: The text is no time, or not above 0.

    """
    number = text.strip().rstrip("usm")
    unit = text.strip()[len(number) :]
    try:
        step_ns = round(float(number) * UNITS_NS[unit])
    except (ValueError, KeyError, OverflowError):
        step_ns = 0
    if step_ns <= 0:
        raise InputError(
            f"--raster {text}", "is no time", "give a number with us, ms or s, such as 10ms"
        )
    return step_ns
