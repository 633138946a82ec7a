"""Queue of received messages, bounded: when the service cannot follow, the oldest ones go."""

from collections import deque
from collections.abc import Callable

import can

from adhesion_can.service.reconnecting_bus import ReconnectingBus

QUEUE_FRAMES = 4096
"""Largest number of waiting messages: eight seconds of the packaged message set's full input."""
DRAIN_FRAMES = 256
"""Largest number of messages read from the bus before the next one is handled."""


class ReceiveQueue:
    """Receives from a bus, and keeps what comes in faster than it is handled.

    Args:
        bus: Bus to receive from.
        is_late: Predicate of a received message: whether others are likely to wait behind it.
        capacity: Largest number of waiting messages.

    """

    def __init__(
        self,
        bus: ReconnectingBus,
        is_late: Callable[[can.Message], bool],
        capacity: int = QUEUE_FRAMES,
    ) -> None:
        self.dropped = 0
        """Number of messages dropped because the queue was full."""
        self._bus = bus
        self._is_late = is_late
        self._capacity = capacity
        self._waiting: deque[can.Message] = deque()

    def __len__(self) -> int:
        return len(self._waiting)

    def get(self, timeout_s: float) -> can.Message | None:
        """Oldest message; None where none came in time.

        Args:
            timeout_s: Longest time to wait, s; a message that waits already is returned at once.

        """
        message = self._bus.receive(0.0 if self._waiting else timeout_s)
        if message is not None:
            if not self._waiting and not self._is_late(message):
                return message
            self._drain(message)
        return self._waiting.popleft() if self._waiting else None

    def _drain(self, first: can.Message) -> None:
        """Add a message, and those that the bus has ready after it."""
        message: can.Message | None = first
        for _ in range(DRAIN_FRAMES):
            if message is None:
                return
            self._add(message)
            message = self._bus.receive(0.0)
        if message is not None:
            self._add(message)

    def _add(self, message: can.Message) -> None:
        self._waiting.append(message)
        if len(self._waiting) > self._capacity:
            self._waiting.popleft()
            self.dropped += 1
