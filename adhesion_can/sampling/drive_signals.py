"""Signals of a drive thinned over time: every extreme stays, and the memory is bounded.

The time since the first reading is divided into spans of one width. Of each signal a span keeps the
first of its smallest and of its largest readings, and its first 'not available', all at their own
stamps. What is kept is thinned again when the drive becomes longer and the spans become wider.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.samples import Samples

WIDTH_US = 10_000
"""First width of a span, µs: a usual cycle, so that a short drive loses nothing."""
MOST_SPANS = 1000
"""Number of spans of a page with one drive: one for each pixel of a wide figure."""
CHUNK = 8192
"""Number of readings of a signal, or of slips, that wait before they are thinned."""
SLIP = "slip"
"""Quantity of a slip ratio, beside the roles of readings."""

Signal = tuple[str, int]
"""Role of a reading or `SLIP`, and the axle or the number of the user's channel; 0 without one."""
_AnySignal = TypeVar("_AnySignal", bound=Signal)
Stamps = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class SignalSeries:
    """Thinned readings of a signal.

    Attributes:
        t_us: Stamps of the readings that are kept, µs, not descending; shape (n,).
        values: Readings, SI unit of the role, NaN where not available; shape (n,).
        readings: Number of all readings.
        not_available: Number of readings that carry 'not available'.

    """

    t_us: Stamps
    values: Array
    readings: int
    not_available: int

    @property
    def lowest(self) -> float:
        """Smallest reading; NaN where none is available."""
        return float(np.fmin.reduce(self.values, initial=np.nan))

    @property
    def highest(self) -> float:
        """Largest reading; NaN where none is available."""
        return float(np.fmax.reduce(self.values, initial=np.nan))


class DriveSignals:
    """Collects readings and slips of a drive.

    Args:
        most_spans: Number of spans beyond which they become twice as wide.

    """

    def __init__(self, most_spans: int = MOST_SPANS) -> None:
        self._most_spans = most_spans
        self.width_us = WIDTH_US
        """Width of a span, µs."""
        self.first_us: int | None = None
        """Stamp of the first reading, µs; None before it."""
        self.last_us = 0
        self._kept: dict[Signal, tuple[Stamps, Array]] = {}
        self._waiting: dict[Signal, list[tuple[Stamps, Array]]] = defaultdict(list)
        self._sizes: dict[Signal, int] = defaultdict(int)
        self._readings: dict[Signal, int] = defaultdict(int)
        self._missing: dict[Signal, int] = defaultdict(int)
        self._samples: list[tuple[Stamps, NDArray[np.int64], Array]] = []
        self._sample_count = 0

    def add(self, readings: Mapping[_AnySignal, tuple[Stamps, Array]]) -> None:
        """Add stamps, µs, and values (NaN: not available) of signals, in the order of time."""
        for signal, (t_us, values) in readings.items():
            if not len(t_us):
                continue
            first_us = int(t_us[0])
            self.first_us = first_us if self.first_us is None else min(self.first_us, first_us)
            self.last_us = max(self.last_us, int(t_us[-1]))
            while (self.last_us - self.first_us) // self.width_us >= self._most_spans:
                self.width_us *= 2
            self._readings[signal] += len(values)
            self._missing[signal] += int(np.isnan(values).sum())
            self._waiting[signal].append((t_us, values))
            self._sizes[signal] += len(t_us)
            if self._sizes[signal] >= CHUNK:
                self._thin(signal)

    def add_samples(self, samples: Samples) -> None:
        """Add the slips of samples, of each axle in the order of time."""
        if not len(samples):
            return
        self._samples.append((samples.t_us, samples.axle, samples.slip))
        self._sample_count += len(samples)
        if self._sample_count >= CHUNK:
            self._sort_in()

    def series(self) -> dict[Signal, SignalSeries]:
        """All signals that had a reading, in the order of their first one; more may follow."""
        self._sort_in()
        for signal in self._readings:
            self._thin(signal)
        # A wider span may have come with a later signal.
        return {
            signal: SignalSeries(*self._thinned(*kept), self._readings[signal],
                                 self._missing[signal])
            for signal, kept in self._kept.items()
        }  # fmt: skip

    def _sort_in(self) -> None:
        """Put the slips that wait to their axles."""
        if not self._samples:
            return
        t_us, axle, slip = (np.concatenate(column) for column in zip(*self._samples, strict=True))
        self._samples, self._sample_count = [], 0
        rows_by_axle = {number: axle == number for number in np.unique(axle).tolist()}
        self.add(
            {(SLIP, number): (t_us[rows], slip[rows]) for number, rows in rows_by_axle.items()}
        )

    def _thin(self, signal: Signal) -> None:
        parts = self._waiting.pop(signal, [])
        if not parts:
            return
        self._sizes[signal] = 0
        if signal in self._kept:
            parts.insert(0, self._kept[signal])
        t_us, values = (np.concatenate(column) for column in zip(*parts, strict=True))
        self._kept[signal] = self._thinned(t_us, values)

    def _thinned(self, t_us: Stamps, values: Array) -> tuple[Stamps, Array]:
        """Smallest, largest and first missing reading of each span, in the order of time."""
        order = np.argsort(t_us, kind="stable")
        t_us, values = t_us[order], values[order]
        number = (t_us - (self.first_us or 0)) // self.width_us
        begins = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
        span = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(number))))
        # Both are NaN, and equal nothing, in a span without an available reading.
        lowest = np.fmin.reduceat(values, begins)[span]
        highest = np.fmax.reduceat(values, begins)[span]
        kept = np.zeros(len(values), dtype=np.bool_)
        for rows in (values == lowest, values == highest, np.isnan(values)):
            indices = np.flatnonzero(rows)
            kept[indices[np.diff(span[indices], prepend=-1) > 0]] = True
        return t_us[kept], values[kept]
