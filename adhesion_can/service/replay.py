"""The service over recordings: what it would have said, and how well its curve fits the data."""

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.bus.candump import ReadReport
from adhesion_can.bus.frame import ADVANCE, Frame, Mark
from adhesion_can.bus.recordings import Recording
from adhesion_can.config import Configuration
from adhesion_can.errors import RecordingError
from adhesion_can.identification.batch import SegmentationSettings, change_points, fit
from adhesion_can.identification.correction import without_effects
from adhesion_can.physics.burckhardt import Array, adhesion
from adhesion_can.physics.data import Samples
from adhesion_can.physics.effects import Memory
from adhesion_can.service.core import ServiceCore


@dataclass(slots=True)
class ReplaySummary:
    """What a replay met.

    Attributes:
        frames: of the recordings, within the times asked for.
        own_skipped: of these, frames with the ids of our own outputs.
        sent: frames that the service answered.
        first_us: stamp of the first frame.
        last_us: stamp of the last frame.
        kinds: lines of the files by kind.

    """

    frames: int = 0
    own_skipped: int = 0
    sent: int = 0
    first_us: int | None = None
    last_us: int | None = None
    kinds: Counter[str] = field(default_factory=Counter)


STRAY_US = 60_000_000
"""A stamp this far ahead, taken back by the next one, is a broken stamp and not a hole in time."""


def _without_strays(items: Iterable[Frame | Mark], report: ReadReport) -> Iterator[Frame | Mark]:
    """Items but for frames with a broken stamp far ahead, which would hold up all that follow."""
    last: int | None = None
    held: Frame | Mark | None = None
    for item in items:
        if held is not None:
            if item.t_us > held.t_us - STRAY_US:
                yield held
                last = held.t_us
            else:
                report.kinds["stray"] += 1
                if report.kinds["stray"] == 1:
                    report.notes.append(
                        f"frames with a broken stamp far ahead are left out, the first of "
                        f"{held.t_us / 1e6:.6f} s"
                    )
            held = None
        if last is not None and item.t_us - last > STRAY_US:
            held = item
            continue
        last = item.t_us
        yield item
    if held is not None:
        yield held


def in_sequence(recordings: Sequence[Recording]) -> Iterator[Frame | Mark]:
    """Recordings one after another.

    Raises:
        RecordingError: one begins before the one in front of it ended.

    """
    last = None
    for recording in recordings:
        begins = True
        for item in _without_strays(recording, recording.report):
            if begins and last is not None and item.t_us < last:
                raise RecordingError(
                    str(recording.path),
                    "begins before the recording in front of it ends",
                    "name the recordings in the order of their times, or replay them one by one",
                )
            begins = False
            last = item.t_us if last is None else max(last, item.t_us)
            yield item


def replay(
    items: Iterable[Frame | Mark],
    core: ServiceCore,
    send: Callable[[Frame], None],
    *,
    from_s: float = 0.0,
    to_s: float | None = None,
    realtime: bool = False,
) -> ReplaySummary:
    """Run recorded frames through a core.

    Args:
        items: frames and marks in the order of the recording.
        core: a fresh one.
        send: takes each frame that the service sends.
        from_s: begin so long after the first frame, s.
        to_s: end so long after the first frame, s; None: at the last one.
        realtime: at the speed of the recording, rather than as fast as it goes.

    """
    summary = ReplaySummary()
    own = core.messages.ids
    origin: int | None = None
    began = time.monotonic()
    for item in items:
        if origin is None:
            origin = item.t_us
        since_s = (item.t_us - origin) / 1e6
        if since_s < from_s:
            continue
        if to_s is not None and since_s > to_s:
            break
        if realtime:
            time.sleep(max(0.0, since_s - from_s - (time.monotonic() - began)))
        for frame in _step(item, core, own, summary):
            summary.sent += 1
            send(frame)
    return summary


def _step(
    item: Frame | Mark,
    core: ServiceCore,
    own: frozenset[tuple[int, bool]],
    summary: ReplaySummary,
) -> list[Frame]:
    if isinstance(item, Mark):
        if item.name == ADVANCE:
            return core.advance(item.t_us)
        core.second_sender(item.t_us)
        return []
    summary.frames += 1
    if summary.first_us is None:
        summary.first_us = item.t_us
    summary.last_us = item.t_us
    if (item.arbitration_id, item.is_extended) in own:
        summary.own_skipped += 1
        return []
    return core.feed(item)


# ------------------------------------------------------------------ how well the curve fits

SMOOTH_US = 50_000
"""To either side: the noise of the vehicle speed fades, a sweep of the slip stays as it is."""
AROUND_US = 2_000_000
"""Samples so close to a change of the rail are left out: each axle finds it at its own time."""
CHUNK = 4096
"""Samples that the effects are taken out of at a time."""
FEWEST = 200


class Misfit(NamedTuple):
    """How far measured adhesion lies from the curve.

    Attributes:
        rmse: of the measured adhesion.
        samples: that it is of.
        stretches: of constant rail, each with a curve of its own.

    """

    rmse: float
    samples: int
    stretches: int


class CurveFit:
    """Root mean square of the measured adhesion about factor · curve(slip').

    Both replays of a drive, without and with an extended model, have such a figure:
    100 (1 − with/without) is the gain of the model, which agrees with that of the diagnosis.

    The curve is the best one for each stretch of constant rail, found and fitted as `identify`
    does. It is not what the estimator held: that follows a slow effect, or takes a fast one for
    another rail, so that its own error hides what a model gains. Slips are means over a tenth of a
    second: the noise of the vehicle speed, which the steep branch makes large, is not the model's.

    Args:
        configuration: with the model, where there is one.
        most: samples that are kept; a longer recording is told by a part of its seconds.

    """

    def __init__(self, configuration: Configuration, most: int = 500_000) -> None:
        model = configuration.model
        self._actives = () if model is None else model.in_contact
        self._axles = configuration.vehicle.axles
        self._settings = configuration.identifiability
        self._memory = Memory()
        self._waiting: list[Samples] = []
        self._count = 0
        self._origin_us: int | None = None
        self._most, self._stride = most, 1
        self._kept: list[Array] = []
        self._rows = 0

    def take(self, samples: Samples) -> None:
        """Samples of an update, not empty, as the service formed them."""
        if self._origin_us is None:
            self._origin_us = int(samples.t_us[0])
        # Columns that come or go with a signal: what is put together has the same ones.
        if self._waiting and self._waiting[-1].covariates.keys() != samples.covariates.keys():
            self._correct()
        self._waiting.append(samples)
        self._count += len(samples)
        if self._count >= CHUNK:
            self._correct()

    def result(self) -> Misfit | None:
        """The figure; None where there are too few samples to speak of one."""
        self._correct()
        if self._rows < FEWEST:
            return None
        rows = np.concatenate(self._kept)
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
        columns = _Kept(*rows.T)
        t_us = columns.since_us.astype(np.int64)
        slip = _smooth(columns.slip, t_us, columns.axle)
        samples = Samples.curve(slip, columns.adhesion / columns.factor, t_us)
        edges = change_points(samples, SegmentationSettings())
        left, steady = np.empty(len(rows)), np.ones(len(rows), dtype=np.bool_)
        for first, last in pairwise([0, *edges, len(rows)]):
            own = slice(first, last)
            theta = fit(samples.select(own), self._settings).theta
            left[own] = columns.adhesion[own] - columns.factor[own] * adhesion(slip[own], *theta)
        for edge in edges:
            steady &= np.abs(t_us - t_us[edge]) > AROUND_US
        left = left[steady]
        if len(left) < FEWEST:
            return None
        return Misfit(float(np.sqrt(np.mean(left * left))), len(left), len(edges) + 1)

    def _correct(self) -> None:
        """Take the effects out of what waits, and keep it."""
        if not self._waiting or self._origin_us is None:
            return
        samples = Samples.concatenate(self._waiting)
        self._waiting, self._count = [], 0
        factor = np.ones(len(samples))
        if self._actives:
            # A variance of 1 comes back as 1/factor².
            unit = replace(samples, adhesion_var=factor)
            samples = without_effects(
                unit, self._actives, self._origin_us, self._axles, self._memory
            ).samples
            factor = 1.0 / np.sqrt(samples.adhesion_var)
        since_us = (samples.t_us - self._origin_us).astype(np.float64)
        usable = np.isfinite(samples.adhesion) & (np.abs(samples.slip) <= self._settings.slip_max)
        columns = _Kept(
            since_us,
            samples.axle.astype(np.float64),
            samples.slip,
            samples.adhesion * factor,
            factor,
        )
        self._keep(np.column_stack(columns)[usable])

    def _keep(self, rows: Array) -> None:
        """Keep rows, of every second, or of one in two, four, .. where they become too many."""
        self._kept.append(rows[rows[:, 0] // 1e6 % self._stride == 0])
        self._rows += len(self._kept[-1])
        while self._rows > self._most:
            self._stride *= 2
            whole = np.concatenate(self._kept)
            self._kept = [whole[whole[:, 0] // 1e6 % self._stride == 0]]
            self._rows = len(self._kept[0])


class _Kept(NamedTuple):
    """Columns that are kept of the samples, shape (n,) each: measured adhesion, slip'."""

    since_us: Array
    axle: Array
    slip: Array
    adhesion: Array
    factor: Array


def _smooth(slip: Array, t_us: NDArray[np.int64], axle: Array) -> Array:
    """Means over ±SMOOTH_US, axle by axle; the same number to either side, shape (n,)."""
    out = slip.copy()
    for number in np.unique(axle):
        own = np.flatnonzero(axle == number)
        at, place = t_us[own], np.arange(len(own))
        before = place - np.searchsorted(at, at - SMOOTH_US, side="left")
        after = np.searchsorted(at, at + SMOOTH_US, side="right") - 1 - place
        reach = np.minimum(before, after)
        sums = np.concatenate([[0.0], np.cumsum(slip[own])])
        out[own] = (sums[place + reach + 1] - sums[place - reach]) / (2 * reach + 1)
    return out
