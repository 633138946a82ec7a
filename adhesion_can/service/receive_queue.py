"""Queue of received messages, bounded: when the service cannot follow, the oldest ones go."""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import can

from adhesion_can.service.reconnecting_bus import ReconnectingBus

QUEUE_FRAMES = 4096
"""Largest number of waiting messages: eight seconds of the packaged message set's full input."""
AWAITED_US = 200
"""Time in which a message that was there already is read, µs; one that took longer was awaited."""
DRAIN_FRAMES = 256
"""Largest number of messages read from the bus before the next one is handled."""


class Received(NamedTuple):
    """A received message.

    Attributes:
        message: The message.
        time_us: Time at which it was received, on this host's clock, µs.
        awaited: Whether it came while it was waited for.

    """

    message: can.Message
    time_us: int
    awaited: bool


class ReceiveQueue:
    """Receives from a bus, and keeps what comes in faster than it is handled.

    Args:
        bus: Bus to receive from.
        is_late: Predicate of a received message: whether others are likely to wait behind it.
        clock: Clock of this host, µs.
        capacity: Largest number of waiting messages.

    """

    def __init__(
        self,
        bus: ReconnectingBus,
        is_late: Callable[[Received], bool],
        clock: Callable[[], int],
        capacity: int = QUEUE_FRAMES,
    ) -> None:
        self.dropped = 0
        """Number of messages dropped because the queue was full."""
        self._bus = bus
        self._is_late = is_late
        self._clock = clock
        self._capacity = capacity
        self._waiting: deque[Received] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def get(self, timeout_s: float) -> Received | None:
        """Oldest message; None where none came in time.

        Args:
            timeout_s: Longest time to wait, s; a message that waits already is returned at once.

        """
        received = self._receive(0.0 if self._waiting else timeout_s)
        if received is not None:
            if not self._waiting and not self._is_late(received):
                return received
            self._drain(received)
        return self._waiting.popleft() if self._waiting else None

    def _receive(self, timeout_s: float) -> Received | None:
        began_us = self._clock() if timeout_s > 0.0 else 0
        message = self._bus.receive(timeout_s)
        if message is None:
            return None
        now_us = self._clock()
        return Received(message, now_us, timeout_s > 0.0 and now_us - began_us > AWAITED_US)

    def _drain(self, first: Received) -> None:
        """Add a message, and those that the bus has ready after it."""
        received: Received | None = first
        for _ in range(DRAIN_FRAMES):
            if received is None:
                return
            self._add(received)
            received = self._receive(0.0)
        if received is not None:
            self._add(received)

    def _add(self, received: Received) -> None:
        self._waiting.append(received)
        if len(self._waiting) > self._capacity:
            self._waiting.popleft()
            self.dropped += 1
