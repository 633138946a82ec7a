"""What the inputs of a history were worth: which frames were good, and which readings usable.

A frame is good with its seal, a new counter and values. A reading is usable when it also can be
true: of a vehicle that moves, a wheel neither stands still nor runs at more than twice the speed,
and nothing stands at the end of its range. The service has other and sharper rules; these are what
nobody can doubt.
"""

from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from typing import NamedTuple

from adhesion_can.bus.frame import Frame
from tests.histories.traffic import NOT_AVAILABLE
from tests.wire import CYCLES_MS, INPUTS, REQUIRED, axles, crc8, decoded

SILENT_CYCLES = 3
"""Cycles for which a required input may be silent."""
LIVELY_FRAMES, SHORT_FRAMES, STUCK_FRAMES = 600, 10, 40
"""A message that changed all through so many frames, with no more than so many alike in a row, and
then stands still for so many, is stuck."""
RADIUS = 0.625
SLOWEST, FASTEST, AT_REST, SPINNING = 1.0, 100.0, 0.1, 2.0
"""Vehicle speeds between which a slip ratio can be told, m/s, and rim speeds over the vehicle speed
between which a wheel may be said to run."""
LARGEST_EFFORT = 300e3
"""Effort beyond which a reading stands at the end of its range, N."""


class Input(NamedTuple):
    """A good frame.

    Attributes:
        at_us: Time at which it passed, µs.
        name: Name of its message.
        frame: The frame.

    """

    at_us: int
    name: str
    frame: Frame


def good_inputs(
    delivered: Iterable[tuple[int, Frame]], overtaken: Callable[[str, int], bool]
) -> Iterator[Input]:
    """Required messages that came with a seal, a new counter and values.

    Args:
        delivered: Frames that were delivered, with the times at which they passed, µs.
        overtaken: Whether frames of a message may overtake each other at a time, µs.

    """
    names = {INPUTS[name]: name for name in REQUIRED}
    last: dict[str, tuple[int, int]] = {}
    stuck = {name: _StuckPayload() for name in REQUIRED}
    for at_us, frame in delivered:
        name = names.get(frame.arbitration_id)
        if name is None or len(frame.data) != 8:
            continue
        number = frame.arbitration_id
        head = bytes([number & 0xFF, number >> 8])
        if frame.data[0] != crc8(head + frame.data[1:]):
            continue
        count = frame.data[1] & 0xF
        # Frames that overtake each other may have the same count and be of different cycles.
        # So may the first one after a pause.
        before_us, before = last.get(name, (0, 15))
        paused = at_us - before_us > SILENT_CYCLES * CYCLES_MS[name] * 1000
        new = count != before or paused or overtaken(name, at_us)
        last[name] = at_us, count
        if not new or frame.data[2:] == NOT_AVAILABLE[name]:
            continue
        if not stuck[name].accept(frame.data[2:]):
            yield Input(at_us, name, frame)


class _StuckPayload:
    """Whether the values of a message are stuck: long lively, they stand still."""

    def __init__(self) -> None:
        self._values = b""
        self._alike = self._lively = 0

    def accept(self, values: bytes) -> bool:
        """Whether they are, with these values."""
        if values == self._values:
            self._alike += 1
            return self._lively >= LIVELY_FRAMES and self._alike >= STUCK_FRAMES
        self._lively = 0 if self._alike > SHORT_FRAMES else self._lively + 1
        self._values, self._alike = values, 1
        return False


def good_times(inputs: Iterable[Input]) -> dict[str, list[int]]:
    """Times of good frames, µs, by message."""
    times: dict[str, list[int]] = {name: [] for name in REQUIRED}
    for one in inputs:
        times[one.name].append(one.at_us)
    return times


def usable_times(inputs: Iterable[Input]) -> dict[str, list[int]]:
    """Times at which a reading could be used, µs, by quantity: one axle's is enough."""
    times: dict[str, list[int]] = {"vehicle speed": [], "wheel speed": [], "effort": []}
    speed = 0.0
    for at_us, name, frame in inputs:
        values = _values(name, frame.data[2:])
        if name == "VehicleSpeed":
            (speed,) = values or (0.0,)
            usable, quantity = SLOWEST <= speed <= FASTEST, "vehicle speed"
        elif name.startswith("WheelSpeeds"):
            # Beside a vehicle that is said to stand nobody knows how fast a wheel should turn.
            usable = speed < SLOWEST or any(
                AT_REST < RADIUS * value / speed < SPINNING for value in values
            )
            quantity = "wheel speed"
        else:
            usable, quantity = any(abs(value) < LARGEST_EFFORT for value in values), "effort"
        if usable:
            times[quantity].append(at_us)
    return times


@lru_cache(4096)
def _values(name: str, payload: bytes) -> list[float]:
    """Values of a message that are available."""
    signal = {"W": "WheelSpeed", "T": "TractiveEffort"}.get(name[0], "VehicleSpeed")
    names = [signal] if name == "VehicleSpeed" else [f"{signal}_Ax{axle}" for axle in axles(name)]
    signals = decoded(Frame(0, INPUTS[name], b"\x00\x00" + payload))
    missing = b"\xff\x7f" if signal == "TractiveEffort" else b"\xff\xff"
    return [
        float(signals[one])
        for place, one in enumerate(names)
        if payload[2 * place : 2 * place + 2] != missing
    ]
