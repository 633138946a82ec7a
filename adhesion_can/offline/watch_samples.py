"""The plausibility watch over a recording: when the service would object to the readings."""

from bisect import bisect_right
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from adhesion_can.estimation.batch_result import Segment
from adhesion_can.estimation.plausibility.settings import PlausibilitySettings
from adhesion_can.estimation.plausibility.watch import PlausibilityWatch
from adhesion_can.offline.extract_samples import UPDATE_US
from adhesion_can.physics.objection import WORDINGS, Objection
from adhesion_can.physics.samples import Samples
from adhesion_can.physics.vehicle import Locomotive
from adhesion_can.result_text import TimeScale


class ObjectionSpan(NamedTuple):
    """Time in which the readings are objected to.

    Attributes:
        objection: What the readings cannot be.
        from_us: Stamp of the first sample with the objection, µs.
        to_us: Stamp of the last one, µs.

    """

    objection: Objection
    from_us: int
    to_us: int

    def sentence(self, times: TimeScale) -> str:
        """What is objected to, with the times."""
        what = WORDINGS[self.objection].what
        return (
            f"{times.span(self.from_us, self.to_us)} s: {what}; during this time no peak is known"
        )

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "objection": self.objection.json_name,
            "from_s": self.from_us / 1e6,
            "to_s": self.to_us / 1e6,
        }


def watch_samples(
    samples: Samples,
    segments: Sequence[Segment],
    vehicle: Locomotive,
    settings: PlausibilitySettings,
) -> list[ObjectionSpan]:
    """Find the times in which the service would object to the readings.

    Jumps and deviations alone, by the same watch; a batch fit means the service's estimate.

    Args:
        samples: Samples of a recording in the order of their collection.
        segments: Segments of their batch fit, ascending.
        vehicle: Vehicle with its static loads.
        settings: Limits of the watch.

    """
    if not len(samples):
        return []
    watch = PlausibilityWatch(vehicle, settings)
    begins = [segment.from_us for segment in segments]
    numbers = (samples.t_us - samples.t_us[0]) // UPDATE_US
    order = np.argsort(numbers, kind="stable")
    updates = np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)
    spans: list[ObjectionSpan] = []
    for rows in updates:
        update = samples.select(rows)
        t_us = int(update.t_us[-1])
        place = bisect_right(begins, t_us) - 1
        before = watch.jump
        watch.add(update, segments[place].estimate if place >= 0 else None)
        if watch.jump is Objection.NONE:
            continue
        if before is watch.jump:
            spans[-1] = spans[-1]._replace(to_us=t_us)
        else:
            spans.append(ObjectionSpan(watch.jump, t_us, t_us))
    return spans
