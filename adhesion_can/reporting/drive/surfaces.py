"""Surfaces of a drive as the service distinguished them, each with its last curve and its data."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.samples import Samples
from adhesion_can.service.outputs import Outputs

SLIP_BINS, A_BIN = 48, 50
"""Ranges of slip, and largest number of samples of a surface that are kept in each."""
MOST_CLOUDS = 24
"""Number of surfaces of which samples are kept: those with the most of them, and the latest."""
CHUNK = 4096
"""Number of samples that wait before they are sorted in."""
SETTLED_US = 5_000_000
"""Time for which samples wait: a change of the surface is reported after it happened, µs."""


@dataclass(frozen=True, slots=True)
class SampleCloud:
    """Some samples of a surface; shape (n,) each.

    Attributes:
        slip: Slip ratio with its sign.
        adhesion: Adhesion coefficient with its sign.
        priority: Number at random from 0 to 1; of a range of slip the smallest are kept.
        total: Number of samples of the surface, those that were not kept included.

    """

    slip: Array
    adhesion: Array
    priority: Array
    total: int

    @classmethod
    def empty(cls) -> "SampleCloud":
        """Cloud without a sample."""
        none = np.empty(0)
        return cls(none, none, none, 0)

    def with_samples(
        self, slip: Array, adhesion: Array, priority: Array, slip_max: float
    ) -> "SampleCloud":
        """The cloud with further samples; in each range of slip a part stays, drawn evenly."""
        total = self.total + len(slip)
        slip = np.concatenate([self.slip, slip])
        adhesion = np.concatenate([self.adhesion, adhesion])
        priority = np.concatenate([self.priority, priority])
        number = np.minimum(np.abs(slip) / slip_max * SLIP_BINS, SLIP_BINS).astype(np.int64)
        order = np.lexsort((priority, number))
        in_order = number[order]
        begins = np.flatnonzero(np.diff(in_order, prepend=-1))
        lengths = np.diff(np.append(begins, len(order)))
        rank = np.arange(len(order)) - np.repeat(begins, lengths)
        kept = np.sort(order[rank < A_BIN])
        return SampleCloud(slip[kept], adhesion[kept], priority[kept], total)


@dataclass(frozen=True, slots=True)
class SurfaceSpan:
    """Span of a drive on one surface.

    Attributes:
        from_us: Stamp of its start, as the service dated it, µs.
        to_us: Stamp of its last setpoint, µs.
        to_m: Distance travelled at its last setpoint, m.
        last: Outputs of its last setpoint with a curve.
        cloud: Some of its samples; None where they were not kept.

    """

    from_us: int
    to_us: int
    to_m: float
    last: Outputs
    cloud: SampleCloud | None = None


class SurfaceRecorder:
    """Reports the surfaces of a drive by the age that the setpoints state, and keeps their samples.

    Args:
        slip_max: Largest slip ratio that the estimator uses.

    """

    def __init__(self, slip_max: float) -> None:
        self._slip_max = slip_max
        self._surfaces: list[SurfaceSpan] = []
        self._clouds: dict[int, SampleCloud] = {}
        self._since_us: int | None = None
        self._told_us = 0
        self._waiting: list[Samples] = []
        self._size = 0
        # Which samples are drawn must not differ between two runs.
        self._random = np.random.default_rng(0)

    def add(self, t_us: int, outputs: Outputs, distance: float) -> None:
        """Add the setpoint of a due time, µs, at a distance, m."""
        age = outputs.surface_age_s
        if age is None or outputs.theta is None:
            self._since_us = None
            return
        since_us = t_us - round(age * 1e6)
        if since_us != self._since_us:
            self._begin(since_us, t_us)
        self._since_us = since_us
        begin_us = self._surfaces[-1].from_us
        self._surfaces[-1] = SurfaceSpan(begin_us, t_us, distance, outputs)

    def _begin(self, since_us: int, t_us: int) -> None:
        """Start a surface, or date the present one again.

        A change is reported some time after it happened, and its date may be corrected by the next
        setpoints. So a date before the present surface was reported is one of the present surface;
        the start of the surface before it takes that one up again.
        """
        known, continued = self._surfaces, self._since_us is not None
        if continued and since_us <= self._told_us:
            if len(known) > 1 and since_us <= known[-2].from_us:
                self._clouds.pop(len(known) - 1, None)
                known.pop()
            else:
                known[-1] = replace(known[-1], from_us=since_us)
            return
        floor_us = known[-1].from_us if known else since_us
        known.append(SurfaceSpan(max(since_us, floor_us), t_us, 0.0, Outputs()))
        self._told_us = t_us

    def add_samples(self, samples: Samples) -> None:
        """Add samples, in the order of their collection."""
        if not len(samples):
            return
        self._waiting.append(samples)
        self._size += len(samples)
        if self._size >= CHUNK:
            self._sort_in(int(samples.t_us[-1]) - SETTLED_US)

    def result(self) -> list[SurfaceSpan]:
        """The surfaces in their order."""
        self._sort_in(None)
        # A change is told after it happened: until then the surface before it was sent.
        begins = [surface.from_us for surface in self._surfaces[1:]]
        ends = [min(s.to_us, begin) for s, begin in zip(self._surfaces, begins, strict=False)]
        ends += [surface.to_us for surface in self._surfaces[-1:]]
        return [
            replace(surface, to_us=end, cloud=self._clouds.get(number))
            for number, (surface, end) in enumerate(zip(self._surfaces, ends, strict=True))
        ]

    def _sort_in(self, until_us: int | None) -> None:
        """Put samples up to a time, µs, into the clouds of their surfaces; None: all of them."""
        if not self._waiting:
            return
        t_us, slip, adhesion = (
            np.concatenate([getattr(part, name) for part in self._waiting])
            for name in ("t_us", "slip", "adhesion")
        )
        ready = np.ones(len(t_us), dtype=np.bool_) if until_us is None else t_us <= until_us
        self._keep_waiting(~ready)
        usable = ready & np.isfinite(slip) & np.isfinite(adhesion)
        number = self._number(t_us[usable])
        slip, adhesion = slip[usable], adhesion[usable]
        priority = self._random.random(len(slip))
        for surface in np.unique(number[number >= 0]).tolist():
            on_surface = number == surface
            cloud = self._clouds.get(surface, SampleCloud.empty())
            self._clouds[surface] = cloud.with_samples(
                slip[on_surface], adhesion[on_surface], priority[on_surface], self._slip_max
            )
        self._forget_small_ones()

    def _keep_waiting(self, rows: NDArray[np.bool_]) -> None:
        left, first = [], 0
        for part in self._waiting:
            part_rows = rows[first : first + len(part)]
            first += len(part)
            if part_rows.any():
                left.append(part.select(np.flatnonzero(part_rows)))
        self._waiting, self._size = left, sum(map(len, left))

    def _number(self, t_us: NDArray[np.int64]) -> NDArray[np.int64]:
        """Number of the surface at each time, µs; -1 before the first and between two."""
        begins = np.array([surface.from_us for surface in self._surfaces], dtype=np.int64)
        ends = np.array([surface.to_us for surface in self._surfaces], dtype=np.int64)
        number = np.searchsorted(begins, t_us, side="right") - 1
        if not len(begins):
            return number
        # The samples of a setpoint are older than it; those after the last one are still its own.
        inside = t_us <= ends[number] + 1_000_000
        return np.where((number >= 0) & inside, number, -1)

    def _forget_small_ones(self) -> None:
        latest = len(self._surfaces) - 1
        while len(self._clouds) > MOST_CLOUDS:
            others = [number for number in self._clouds if number != latest]
            del self._clouds[min(others, key=lambda number: self._clouds[number].total)]


def longest(surfaces: Sequence[SurfaceSpan], most: int) -> list[SurfaceSpan]:
    """The surfaces with the most samples, at most so many, in the order of their times."""
    with_data = [surface for surface in surfaces if surface.cloud is not None]
    ranked = sorted(with_data, key=lambda surface: -(surface.cloud or SampleCloud.empty()).total)
    return sorted(ranked[:most], key=lambda surface: surface.from_us)
