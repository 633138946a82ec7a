"""Frames of a drive as they pass the bus, spoilt by faults."""

from bisect import bisect_left
from collections.abc import Iterable, Iterator
from functools import cache
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from adhesion_can.bus.frame import Frame
from tests.histories.faults import Fault
from tests.wire import CYCLES_MS, INPUTS, REQUIRED, Bench, sealed

STEPS = 50
"""Steps of slip up and down, 0.2 s each."""
OFFSETS_US = {name: 230 * number for number, name in enumerate(REQUIRED)}
"""Times within 10 ms at which the messages are sent."""
SEALS = 15
NOISE = np.random.default_rng(60).standard_normal((STEPS, SEALS)).tolist()
"""Draws of the noise of a measurement, by step and frame: few payloads, none like the next."""
FOREIGN_ID, OWN_ID = 0x5A0, 0x201
BUS_OFF, ERROR_WITH_COUNTS = 0x40, 0x204
"""Ids of error frames as Linux makes them: bus-off; a controller's warning with its counts, which
looks like our AxleSetpoint."""
FOREIGN = ("bus_off", "flood", "error_frames", "second_service")
"""Kinds of faults that are frames of others."""
START_US = 1_000_000_000_000
"""Time of the host at the begin of a history, µs."""


class Passing(NamedTuple):
    """A frame on the bus.

    Attributes:
        at_us: Time at which it passes, on the host's clock, µs.
        stamp_us: Its stamp, µs.
        frame: The frame.

    """

    at_us: int
    stamp_us: int
    frame: Frame


def _payload(
    name: str, step: int, count: int, noise: float, drift: float = 0.0, limit: float = 1.0
) -> bytes:
    """Sealed payload of a message at a step of the drive, from slips that drift or are limited."""
    slip = min(0.02 + 0.06 * abs(2.0 * step / STEPS - 1.0), limit) + drift
    adhesion = 0.4 * (1.0 - np.exp(-60.0 * slip)) - 0.3 * slip
    bench = Bench()
    bench.counts[name] = count
    # Each message has one kind of values, and so one of these: 3 to 25 steps of its resolution.
    return bench.steady(
        name,
        0,
        speed=10.0 + (0.01 * noise if name == "VehicleSpeed" else 0.0),
        slip=slip + 0.0004 * noise,
        adhesion=float(adhesion) + 0.001 * noise,
    ).data


@cache
def _undistorted(name: str, step: int, noise: float) -> bytes:
    """The same from the slips as they are, not sealed yet.

    These are few, and all there after some minutes. With counters there were 15 times as many: for
    hours they grew, in a process whose memory is looked at.
    """
    return _payload(name, step, 0, noise)


NOT_AVAILABLE = dict.fromkeys(REQUIRED, 6 * b"\xff") | {
    "TractiveEffort1": 3 * b"\xff\x7f",
    "TractiveEffort2": 3 * b"\xff\x7f",
}
"""Bytes 2 to 7 of a message whose signals are not available; efforts have a sign."""


ENDS = range(5)
"""Steps of the resolution from an end of the range at which a blinded sensor stands in turn."""


def _blind_payload(name: str, size: float, step: int) -> bytes:
    """Payload of a sensor at rest (size 0) or at the end of its range (1), with some noise."""
    last = 0x7FFE if name.startswith("TractiveEffort") else 0xFFFE
    raw = last - step if size else step
    word = raw.to_bytes(2, "little")
    return b"\x00\x00" + (word + b"\x11" + 3 * b"\x00" if name == "VehicleSpeed" else 3 * word)


class _Sender:
    """Sender of one message, with its counter."""

    def __init__(self, name: str, faults: Iterable[Fault], rng: np.random.Generator) -> None:
        self.name = name
        self._faults = [f for f in faults if f.target and name.startswith(f.target)]
        self._rng = rng
        self._count = 0
        self._last = b""

    def send(self, t_us: int) -> Iterator[tuple[int, bytes]]:
        """Delays, µs, and payloads of what is sent at a time of the history."""
        active = {fault.kind: fault for fault in self._faults if fault.active(t_us)}
        if not active:
            yield 0, self._data(t_us, active)
            return
        if "silent" in active:
            return
        data = self._data(t_us, active)
        if "lost" in active and self._happens(active["lost"]):
            return
        if "corrupt" in active and self._happens(active["corrupt"]):
            spoilt = bytearray(data)
            spoilt[self._rng.integers(8)] ^= 1 << self._rng.integers(8)
            data = bytes(spoilt)
        late_us = 0
        if "delayed" in active:
            late_us = round(active["delayed"].size * 1e6 * self._rng.random())
        yield late_us, data
        if "twice" in active and self._happens(active["twice"]):
            yield late_us + 150, data

    def _data(self, t_us: int, active: dict[str, Fault]) -> bytes:
        if "repeated" in active and self._last and self._happens(active["repeated"]):
            return self._last
        at_us = active["frozen"].from_us if "frozen" in active else t_us
        step = at_us // 200_000 % STEPS
        noise = NOISE[step][at_us // (CYCLES_MS[self.name] * 1000) % SEALS]
        if "jumped" in active:
            step = (step + STEPS // 2) % STEPS
        self._count = (self._count + 1) % SEALS
        if "not_available" in active:
            payload = b"\x00\xf0" + NOT_AVAILABLE[self.name]
            self._last = sealed(INPUTS[self.name], payload, self._count)
        else:
            drift, limit = _distortion(t_us, active)
            if (drift, limit) == (0.0, 1.0):
                payload = _undistorted(self.name, step, noise)
                self._last = sealed(INPUTS[self.name], payload, self._count)
            else:
                self._last = _payload(self.name, step, self._count, noise, drift, limit)
        if "blinded" in active:
            data = _blind_payload(self.name, active["blinded"].size, self._count % len(ENDS))
            self._last = sealed(INPUTS[self.name], data, self._count)
        if "axles_lost" in active:
            lost = 2 + 2 * round(active["axles_lost"].size)
            payload = self._last[:2] + NOT_AVAILABLE[self.name][: lost - 2] + self._last[lost:]
            self._last = sealed(INPUTS[self.name], payload, self._count)
        return self._last

    def _happens(self, fault: Fault) -> bool:
        return bool(self._rng.random() < fault.size)


def _distortion(t_us: int, active: dict[str, Fault]) -> tuple[float, float]:
    """Drift and limit of the slips behind a message; the drift in steps of a tenth of a second."""
    drift, limit = 0.0, 1.0
    if "drifted" in active:
        fault = active["drifted"]
        drift = fault.size * ((t_us - fault.from_us) // 100_000) / 10.0
    if "saturated" in active:
        limit = active["saturated"].size
    return drift, limit


def make_traffic(
    seed: int, duration_us: int, faults: tuple[Fault, ...], start_us: int = START_US
) -> Iterator[Passing]:
    """Frames in the order in which they pass the bus, from a time of the host on."""
    rng = np.random.default_rng([seed, 78])
    senders = [_Sender(name, faults, rng) for name in REQUIRED]
    others = [_Other(fault) for fault in faults if fault.kind == "other_sender"]
    foreign = tuple(fault for fault in faults if fault.kind in FOREIGN)
    sets = [(f.from_us, round(f.size * 1e6)) for f in faults if f.kind == "clock_set"]
    waiting: list[tuple[int, Frame]] = []
    for t_us in range(0, duration_us, 10_000):
        sent = [
            (t_us + OFFSETS_US[sender.name] + late_us, INPUTS[sender.name], data)
            for sender in senders
            if t_us % (CYCLES_MS[sender.name] * 1000) == 0
            for late_us, data in sender.send(t_us)
        ]
        for other in others:
            sent += other.send(t_us)
        waiting += [(at_us, Frame(at_us, number, data)) for at_us, number, data in sent]
        waiting += _foreign(t_us, foreign, rng)
        # Of the same time, what was sent first passes first: the sort keeps their order.
        waiting.sort(key=itemgetter(0))
        passed = bisect_left(waiting, t_us + 10_000, key=itemgetter(0))
        for at_us, frame in waiting[:passed]:
            set_us = sum(size_us for from_us, size_us in sets if from_us <= at_us) if sets else 0
            yield Passing(start_us + at_us, start_us + at_us + set_us, frame)
        del waiting[:passed]


class _Other:
    """A second sender of a message, with a counter of its own."""

    def __init__(self, fault: Fault) -> None:
        self._fault = fault
        self._count = 7

    def send(self, t_us: int) -> list[tuple[int, int, bytes]]:
        fault = self._fault
        if not fault.active(t_us) or t_us % (CYCLES_MS[fault.target] * 1000):
            return []
        self._count = (self._count + 1) % SEALS
        return [(t_us + 5_100, INPUTS[fault.target], _payload(fault.target, 3, self._count, 0.0))]


def _foreign(
    t_us: int, faults: tuple[Fault, ...], rng: np.random.Generator
) -> list[tuple[int, Frame]]:
    """Frames of others: bus-off, floods, error frames, and a second service."""
    found: list[tuple[int, Frame]] = []
    for fault in faults:
        if fault.kind == "bus_off" and t_us <= fault.from_us < t_us + 10_000:
            found.append((fault.from_us, Frame(0, BUS_OFF, b"", is_error=True)))
        if not fault.active(t_us):
            continue
        if fault.kind == "flood":
            count = round(10 * fault.size)
            found += [
                (t_us + 10_000 * k // count, Frame(0, FOREIGN_ID, bytes(8))) for k in range(count)
            ]
        elif fault.kind == "error_frames" and rng.random() < fault.size:
            found.append((t_us + 3_000, Frame(0, ERROR_WITH_COUNTS, b"", is_error=True)))
        elif fault.kind == "second_service" and t_us % 20_000 == 0:
            data = sealed(OWN_ID, b"\x00\x10\x01\x02\x03\x04\x05\x06", t_us // 20_000 % SEALS)
            found.append((t_us + 7_000, Frame(0, OWN_ID, data)))
    return found
