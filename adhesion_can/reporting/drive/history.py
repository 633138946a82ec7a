"""History of the setpoints in bins of time, whose number is bounded however long the drive is.

A bin keeps the smallest and the largest value of each series and the counts of status and doubt, so
that nothing that was sent is left out of a figure, and two neighbours merge without a loss.
"""

from dataclasses import dataclass, fields
from math import inf

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.normal_quantiles import NORMAL_95
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.status import Status
from adhesion_can.service.outputs import Outputs

WIDTH_US = 20_000
"""First width of a bin, µs: the cycle of the setpoints."""
MOST_BINS = 2000
"""Number of bins beyond which two at a time are merged: two for each pixel of a wide figure."""
CHUNK = 4000
"""Number of setpoints that wait before they are put into bins."""
LONGEST_STEP_S = 1.0
"""Time between two setpoints beyond which nothing is known of the way between them, s."""
DOUBTS = tuple(Doubt)
STATUSES = tuple(Status)


@dataclass(frozen=True, slots=True)
class History:
    """Setpoints in bins; shape (n,) or (n, series) each, NaN where not available.

    Attributes:
        index: Number of each bin, ascending; a bin without a setpoint is left out.
        first_us: Stamp of the first setpoint, µs.
        last_us: Stamp of the last setpoint, µs.
        distance: Distance travelled up to the last setpoint, m.
        lowest: Smallest μ_max, λ_m and vehicle speed (m/s), shape (n, 3).
        highest: Largest of each of them, shape (n, 3).
        lower: Smallest lower end of the 95 % interval of μ_max and λ_m, shape (n, 2).
        upper: Largest upper end of the 95 % interval of μ_max and λ_m, shape (n, 2).
        statuses: Number of setpoints by status, shape (n, 6).
        doubts: Number of setpoints by doubt, in the order of `DOUBTS`, shape (n, 10).

    """

    index: NDArray[np.int64]
    first_us: NDArray[np.int64]
    last_us: NDArray[np.int64]
    distance: Array
    lowest: Array
    highest: Array
    lower: Array
    upper: Array
    statuses: NDArray[np.int64]
    doubts: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.index)

    def merged(self, index: NDArray[np.int64]) -> "History":
        """Bins merged where they have the same new number, ascending, shape (n,)."""
        starts = np.flatnonzero(np.diff(index, prepend=index[0] - 1)) if len(index) else index
        if len(starts) == len(index):
            return History(index, *(getattr(self, name) for name in _COLUMNS[1:]))
        ends = np.append(starts[1:], len(index)) - 1
        return History(
            index[starts],
            self.first_us[starts],
            self.last_us[ends],
            self.distance[ends],
            # fmin and fmax pass over what is not available.
            np.fmin.reduceat(self.lowest, starts),
            np.fmax.reduceat(self.highest, starts),
            np.fmin.reduceat(self.lower, starts),
            np.fmax.reduceat(self.upper, starts),
            np.add.reduceat(self.statuses, starts),
            np.add.reduceat(self.doubts, starts),
        )

    def followed_by(self, later: "History") -> "History":
        """These bins and later ones."""
        pairs = ((getattr(self, name), getattr(later, name)) for name in _COLUMNS)
        return History(*(np.concatenate(pair) for pair in pairs))


_COLUMNS = tuple(field.name for field in fields(History))

_Row = tuple[float, ...]
"""Stamp, distance, status, place of the doubt, μ_max, λ_m, speed, and standard deviations."""


class HistoryRecorder:
    """Puts setpoints into bins of time."""

    def __init__(self) -> None:
        self.width_us = WIDTH_US
        self.distance = 0.0
        self._rows: list[_Row] = []
        self._bins = _as_bins([], 0, WIDTH_US)
        self._origin_us = 0
        self._before: tuple[int, float | None] | None = None

    def add(self, t_us: int, outputs: Outputs) -> None:
        """Add the setpoint of a due time, µs."""
        speed = outputs.speed
        if self._before is None:
            self._origin_us = t_us
        else:
            since_us, before = self._before
            step = (t_us - since_us) / 1e6
            if speed is not None and before is not None and step <= LONGEST_STEP_S:
                self.distance += 0.5 * (speed + before) * step
        self._before = (t_us, speed)
        point = outputs.setpoint
        numbers = (point.mu_max, point.lambda_m, speed, outputs.mu_max_std, outputs.lambda_m_std)
        known = [np.nan if number is None else number for number in numbers]
        place = DOUBTS.index(outputs.doubt)
        self._rows.append((t_us, self.distance, int(outputs.status), place, *known))
        if len(self._rows) >= CHUNK:
            self.result()

    def result(self) -> History:
        """The bins so far; more may follow."""
        if self._rows:
            new = _as_bins(self._rows, self._origin_us, self.width_us)
            self._rows = []
            both = self._bins.followed_by(new)
            self._bins = both.merged(both.index)
        while len(self._bins) > MOST_BINS:
            self.width_us *= 2
            self._bins = self._bins.merged(self._bins.index // 2)
        return self._bins


def _as_bins(rows: list[_Row], origin_us: int, width_us: int) -> History:
    """Bins of a setpoint each, some of them with the same number."""
    stamps = np.array([row[0] for row in rows], dtype=np.int64)
    table = np.array([row[1:] for row in rows], dtype=np.float64).reshape(len(rows), 8)
    values, spread = table[:, 3:6], NORMAL_95 * table[:, 6:8]
    # An interval without a bound reaches over all that there is.
    spread = np.where(np.isnan(values[:, :2]), np.nan, np.nan_to_num(spread, nan=inf))
    lower, upper = values[:, :2] - spread, values[:, :2] + spread
    return History(
        (stamps - origin_us) // width_us,
        stamps,
        stamps,
        table[:, 0],
        values,
        values,
        np.clip(lower, 0.0, 1.0),
        np.clip(upper, 0.0, 1.0),
        (table[:, 1:2] == np.array(STATUSES, dtype=np.float64)).astype(np.int64),
        (table[:, 2:3] == np.arange(len(DOUBTS))).astype(np.int64),
    )
