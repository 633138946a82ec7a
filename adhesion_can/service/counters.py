"""Counters of the running service: the same ones in `run --json` and for Prometheus."""

from collections.abc import Callable
from typing import NamedTuple

from adhesion_can.service.live import LiveService

LATE_US = 20_000
"""Time after its due time from which a setpoint counts as late, µs: one cycle."""


class Counter(NamedTuple):
    """One counter.

    Attributes:
        key: Name in the JSON of `run`.
        metric: Name for Prometheus, without the prefix and `_total`.
        meaning: What is counted.
        read: Function that reads it.

    """

    key: str
    metric: str
    meaning: str
    read: Callable[[LiveService], int]


COUNTERS = (
    Counter("received", "frames_received", "frames received", lambda s: s.counts.received),
    Counter("sent", "frames_sent", "frames that the bus accepted", lambda s: s.bus.sent),
    Counter(
        "send_errors", "send_errors", "frames that the bus refused", lambda s: s.bus.send_errors
    ),
    Counter(
        "unsent",
        "frames_unsent",
        "frames that the interface dropped instead of sending",
        lambda s: s.bus.unsent,
    ),
    Counter("echoes", "echoes", "echoes of our own frames", lambda s: s.counts.echoes),
    Counter(
        "foreign_outputs",
        "foreign_outputs",
        "frames of another sender with our ids",
        lambda s: s.counts.foreign_outputs,
    ),
    Counter(
        "overdue",
        "frames_overdue",
        "frames dropped because they were overdue",
        lambda s: s.counts.overdue,
    ),
    Counter(
        "late_setpoints",
        "late_setpoints",
        "setpoints sent more than 20 ms after their due time",
        lambda s: s.lateness.count_beyond(LATE_US),
    ),
    Counter(
        "bus_off",
        "bus_off",
        "times that the controller left the bus after errors (bus-off)",
        lambda s: s.counts.bus_off,
    ),
    Counter(
        "reopened", "bus_reopened", "times that the bus was reopened", lambda s: s.bus.reopened
    ),
    Counter("clock_steps", "clock_steps", "steps of the bus's clock", lambda s: s.stamps.steps),
    Counter(
        "frames_lost",
        "frames_lost",
        "input frames lost, from their counters and the kernel",
        lambda s: s.core.receiver.lost + s.core.counts.receive_drops,
    ),
    Counter(
        "frames_clamped",
        "frames_clamped",
        "frames stamped earlier than the frame before",
        lambda s: s.core.counts.clamped,
    ),
    Counter(
        "readings_stuck",
        "readings_stuck",
        "readings dropped because their signal was stuck",
        lambda s: s.core.receiver.stuck,
    ),
    Counter(
        "samples",
        "samples",
        "samples of slip and adhesion",
        lambda s: s.core.counts.samples,
    ),
)


def read_counters(service: LiveService) -> dict[str, int]:
    """Value of each counter by its name in JSON."""
    return {counter.key: counter.read(service) for counter in COUNTERS}
