"""Readings to frames on the bus: cycles, places and factors are those of the database."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tests.faults.rail import Floats
from tests.faults.sensors import EFFORT_S, LOAD_S, SPEED_S, WHEEL_S, Readings
from tests.worlds.encoding import database, packed

SLOT_US = 240
"""Time from one message to the next within a cycle, µs."""


class Frame(NamedTuple):
    """A frame on the bus.

    Attributes:
        t_us: Stamp, µs.
        arbitration_id: Identifier.
        data: Payload.

    """

    t_us: int
    arbitration_id: int
    data: bytes


@dataclass(frozen=True, eq=False)
class Queue:
    """One message's frames before they are packed.

    Attributes:
        t_us: Time of each frame, µs, (n,).
        signals: Physical values by name, (n,) each.

    """

    t_us: NDArray[np.int64]
    signals: dict[str, Floats]

    def rows(self, chosen: NDArray[np.bool_]) -> "Queue":
        """Some of the frames."""
        return Queue(self.t_us[chosen], {n: v[chosen] for n, v in self.signals.items()})


@dataclass(frozen=True, eq=False)
class Sent:
    """One message's frames.

    Attributes:
        t_us: Stamp of each frame, µs, (n,).
        data: Payloads, (n, 8).

    """

    t_us: NDArray[np.int64]
    data: NDArray[np.uint8]

    def rows(self, chosen: NDArray[np.bool_]) -> "Sent":
        """Some of the frames."""
        return Sent(self.t_us[chosen], self.data[chosen])


def queues(readings: Readings) -> dict[str, Queue]:
    """Frames that will be sent, by message."""

    def axles(signal: str, values: Floats, first: int) -> dict[str, Floats]:
        return {f"{signal}_Ax{k + 1}": values[:, k] for k in range(first, first + 3)}

    r = readings
    steady = np.ones(len(r.speed))
    all_signals = {
        "WheelSpeeds1": (WHEEL_S, axles("WheelSpeed", r.wheel, 0)),
        "WheelSpeeds2": (WHEEL_S, axles("WheelSpeed", r.wheel, 3)),
        "VehicleSpeed": (
            SPEED_S,
            {"VehicleSpeed": r.speed, "VehicleSpeedSource": steady, "Direction": steady},
        ),
        "TractiveEffort1": (EFFORT_S, axles("TractiveEffort", r.effort, 0)),
        "TractiveEffort2": (EFFORT_S, axles("TractiveEffort", r.effort, 3)),
        "AxleLoads1": (LOAD_S, axles("AxleLoad", r.load, 0)),
        "AxleLoads2": (LOAD_S, axles("AxleLoad", r.load, 3)),
        "TrackGeometry": (
            LOAD_S,
            {"Gradient": 1e3 * r.gradient, "Curvature": np.zeros(len(r.gradient))},
        ),
    }
    found = {}
    for slot, (name, (cycle_s, signals)) in enumerate(all_signals.items()):
        rows = len(next(iter(signals.values())))
        t_us = np.rint(np.arange(rows) * cycle_s * 1e6).astype(np.int64) + slot * SLOT_US
        found[name] = Queue(t_us, signals)
    return found


def pack(queue: Queue, name: str) -> Sent:
    """Frames of a message: values beyond the range of a signal stand at its end."""
    message = database().get_message_by_name(name)
    limited = {}
    for signal in message.signals:
        if signal.name in queue.signals:
            values = queue.signals[signal.name]
            low, high = signal.minimum, signal.maximum
            limited[signal.name] = np.clip(values, low, high)
    return Sent(queue.t_us, packed(message, limited))


def frames(sent: dict[str, Sent]) -> list[Frame]:
    """All frames in the order of their stamps."""
    stamps = np.concatenate([one.t_us for one in sent.values()])
    ids = np.concatenate(
        [
            np.full(len(one.t_us), database().get_message_by_name(name).frame_id)
            for name, one in sent.items()
        ]
    )
    data = np.concatenate([one.data for one in sent.values()])
    order = np.lexsort((ids, stamps))
    rows = data[order].tobytes()
    pairs = zip(stamps[order].tolist(), ids[order].tolist(), strict=True)
    return [
        Frame(t_us, number, rows[8 * place : 8 * place + 8])
        for place, (t_us, number) in enumerate(pairs)
    ]
