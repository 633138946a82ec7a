"""A bus in simulated time: what a service gets from python-can, and a record of what passed."""

import errno
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from math import ceil

import can

from adhesion_can.bus.frame import Frame
from adhesion_can.recordings.python_can_messages import from_message, to_message
from tests.histories.faults import Fault, any_active
from tests.histories.traffic import START_US, Passing


class _Nothing(list):
    """A list that keeps nothing."""

    def append(self, _: object) -> None:
        """Drop what comes."""


@dataclass
class Record:
    """What passed the bus.

    Attributes:
        inputs: Frames that were delivered: time at which they passed, µs, and frame.
        outputs: Frames that were sent: time at which they passed, µs, and frame.
        log: Lines of the service's own log.
        notices: Lines for the operator.

    """

    inputs: list[tuple[int, Frame]] = field(default_factory=list)
    outputs: list[tuple[int, Frame]] = field(default_factory=list)
    log: list[str] = field(default_factory=list)
    notices: list[str] = field(default_factory=list)

    @classmethod
    def of_nothing(cls) -> "Record":
        """A record that stays empty, for hours of which the memory is looked at."""
        return cls(_Nothing(), _Nothing(), _Nothing(), _Nothing())


class SimulatedBus:
    """Delivers frames at their times. Time passes while they are waited for, and in a stop.

    Args:
        traffic: Frames in the order in which they pass.
        faults: Faults of the host and of the bus.
        end_us: Time at which the history ends, µs.
        record: Record to be filled; a new one by default.

    """

    channel_info = "simulated"

    def __init__(
        self,
        traffic: Iterator[Passing],
        faults: tuple[Fault, ...],
        end_us: int,
        record: Record | None = None,
    ) -> None:
        self.now_us = START_US
        self.record = record or Record()
        self.unsent = 0
        self.go_on(traffic, faults, end_us)

    def go_on(self, traffic: Iterator[Passing], faults: tuple[Fault, ...], end_us: int) -> None:
        """Begin a history now; the first begins with the bus."""
        self._start_us = self.now_us
        self.end_us = end_us
        self._traffic = traffic
        self._next = next(traffic, None)
        self._waiting: deque[Passing] = deque()
        self._stops = deque(f for f in faults if f.kind == "stopped")
        self._slow = [f for f in faults if f.kind == "slow"]
        self._downs = [f for f in faults if f.kind in ("bus_down", "link_missing")]
        off = [f for f in faults if f.kind == "bus_off"]
        self._silent = [*self._downs, *off]
        self._deaf = [f for f in faults if f.kind == "listen_only"]
        self._full = [*off, *(f for f in faults if f.kind == "no_buffer")]

    def clock(self) -> int:
        """Time of the host, µs."""
        return self.now_us

    def sleep(self, seconds: float) -> None:
        """Let time pass: at least the least there is, as who sleeps for less would never end."""
        self._pass(self.now_us + ceil(seconds * 1e6))

    def turn(self) -> None:
        """Let the time pass that a turn of the service's loop takes: none but on a slow machine."""
        for fault in self._slow:
            if fault.active(self.now_us - self._start_us):
                self._pass(self.now_us + round(fault.size * 1e6))

    def open(self) -> "SimulatedBus":
        """Opening of the bus."""
        if self._is_down():
            raise OSError(errno.ENETDOWN, "Network is down")
        # What passed before a socket is open is not received.
        self._waiting.clear()
        return self

    def recv(self, timeout: float | None) -> can.Message | None:
        """Next frame, as python-can gives it."""
        if self._is_down():
            self._waiting.clear()
            raise can.CanOperationError("down", errno.ENETDOWN)
        if not self._waiting and timeout:
            latest_us = self.now_us + round(timeout * 1e6)
            first_us = latest_us if self._next is None else min(self._next.at_us, latest_us)
            self._pass(max(first_us, self.now_us))
        else:
            self._pass(self.now_us)
        if not self._waiting or self._is_down():
            return None
        passing = self._waiting.popleft()
        self.record.inputs.append((passing.at_us, passing.frame))
        message = to_message(passing.frame)
        message.timestamp = passing.stamp_us / 1e6
        return message

    def send(self, message: can.Message, timeout: float | None = None) -> None:
        """Send a frame."""
        if self._is_down():
            raise can.CanOperationError("down", errno.ENETDOWN)
        if any_active(self._full, self.now_us - self._start_us):
            raise can.CanOperationError("no buffer space", errno.ENOBUFS)
        if any_active(self._deaf, self.now_us - self._start_us):
            # As the kernel does it: the sender does not learn of it.
            self.unsent += 1
            return
        self.record.outputs.append((self.now_us, from_message(message)))

    def set_filters(self, filters: object) -> None:
        """Filters are not needed."""

    def shutdown(self) -> None:
        """Nothing to close."""

    def _is_down(self) -> bool:
        return any_active(self._downs, self.now_us - self._start_us)

    def _pass(self, until_us: int) -> None:
        """Let time pass; a stop that begins meanwhile lasts until its end."""
        while self._stops and self._start_us + self._stops[0].from_us <= until_us:
            stop = self._stops.popleft()
            until_us = max(until_us, self._start_us + stop.until_us)
        self.now_us = until_us
        while self._next is not None and self._next.at_us <= until_us:
            if not self._is_lost(self._next):
                self._waiting.append(self._next)
            self._next = next(self._traffic, None)

    def _is_lost(self, passing: Passing) -> bool:
        """Whether a frame does not arrive; of a controller that is off its own reports do."""
        silent = self._downs if passing.frame.is_error else self._silent
        return any_active(silent, passing.at_us - self._start_us)
