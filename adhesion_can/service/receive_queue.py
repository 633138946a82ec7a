"""Queue of received messages, bounded in number and age: the oldest ones go.

A service that was held up, or cannot follow, drops what waited for too long. So it is back at the
present within a cycle, and what it sends is from the present. What waited while it was held up for
a moment is worth catching up with; where the machine is too slow for the bus, catching up never
ends, and no more than a cycle may wait.
"""

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import can

from adhesion_can.service.reconnecting_bus import ReconnectingBus

BEHIND_US = 10_000
"""Age of a received message beyond which others are likely to wait behind it, µs."""
STALE_US = 500_000
"""Age beyond which a message is dropped where others wait behind it, µs."""
OVERLOAD_STALE_US = 20_000
"""Age beyond which messages are dropped in an overload, µs: a cycle of the packaged setpoints. On a
bus so slow that this is less than half a cycle, half a cycle: what is due is not overdue then."""
OVERLOAD_AFTER, OVERLOAD_KEPT, OVERLOAD_OVER = 5, 1 / 4, 50
"""Time behind the bus without a moment at the present from which it cannot be followed, age of
the messages that are kept then, and time without dropping after which it can be followed again, in
units of that age."""
QUEUE_FRAMES = 4096
"""Largest number of waiting messages: eight seconds of the packaged message set's full input."""
AWAITED_US = 200
"""Time in which a message that was there already is read, µs; one that took longer was awaited."""
PROBE_US = 5_000
"""Time after which it is looked up whether nothing waits, µs: in a flood every message is there
before it is waited for."""
DRAIN_FRAMES = 256
"""Largest number of messages read from the bus before the next one is handled."""
HELD_UP_FRAMES = 65_536
"""The same after this process stood still: the last message shows how old the others are."""


class Received(NamedTuple):
    """A received message.

    Attributes:
        message: The message.
        time_us: Time at which it was received, on this host's clock, µs.
        awaited: Whether it came while it was waited for.
        earliest_us: Time before which it cannot have come: nothing waited then.

    """

    message: can.Message
    time_us: int
    awaited: bool
    earliest_us: int

    @property
    def message_id(self) -> tuple[int, bool]:
        """Arbitration id, and whether it has 29 bits."""
        return self.message.arbitration_id, self.message.is_extended_id


class ReceiveQueue:
    """Receives from a bus, and keeps what comes in faster than it is handled.

    Args:
        bus: Bus to receive from.
        age_us: Time since a received message passed the bus, by its stamp, µs.
        clock: Clock of this host, µs.
        cycle_us: Cycle at which what is received is answered, µs; None where nothing is.
        capacity: Largest number of waiting messages.

    """

    def __init__(
        self,
        bus: ReconnectingBus,
        age_us: Callable[[Received], int],
        clock: Callable[[], int],
        *,
        cycle_us: int | None = None,
        capacity: int = QUEUE_FRAMES,
    ) -> None:
        self.dropped = 0
        """Number of messages dropped because the queue was full, or they had waited too long."""
        self._bus = bus
        self._age_us = age_us
        self._clock = clock
        self._overload_stale_us = max((cycle_us or 0) // 2, OVERLOAD_STALE_US)
        self._capacity = capacity
        self._waiting: deque[Received] = deque()
        self._newest: Received | None = None
        """Message with the latest stamp of those that waited together."""
        self._behind_us: int | None = None
        """Time since which messages of the past are handled; None at the present."""
        self._overloaded_us: int | None = None
        """Latest time at which messages were dropped for an overload; None where none were."""
        self._empty_us = self._left_us = clock()
        """Latest times at which nothing is known to have waited, and at which `get` returned."""

    def __len__(self) -> int:
        return len(self._waiting)

    @property
    def is_overloaded(self) -> bool:
        """Whether messages were dropped of late because more come than can be handled."""
        dropped_us, over_us = self._overloaded_us, OVERLOAD_OVER * self._overload_stale_us
        return dropped_us is not None and self._clock() - dropped_us <= over_us

    def get(self, timeout_s: float) -> Received | None:
        """Oldest message; None where none came in time.

        Args:
            timeout_s: Longest time to wait, s; a message that waits already is returned at once.

        """
        try:
            return self._get(timeout_s)
        finally:
            self._left_us = self._clock()

    def _get(self, timeout_s: float) -> Received | None:
        if not self._waiting:
            self._newest = None
        if not self._waiting and self._clock() - self._empty_us > PROBE_US:
            received = self._receive(0.0) or self._receive(timeout_s)
        else:
            received = self._receive(0.0 if self._waiting else timeout_s)
        if received is not None:
            held_up = self._clock() - self._left_us > STALE_US + 1e6 * timeout_s
            if not (self._waiting or held_up) and self._bounded_age_us(received) <= BEHIND_US:
                self._behind_us = None
                return received
            if self._behind_us is None:
                self._behind_us = self._clock()
            self._drain(received, HELD_UP_FRAMES if held_up else DRAIN_FRAMES)
        elif not self._waiting:
            self._behind_us = None
        self._drop_stale()
        return self._waiting.popleft() if self._waiting else None

    def _receive(self, timeout_s: float) -> Received | None:
        began_us = self._clock()
        message = self._bus.receive(timeout_s)
        now_us = self._clock()
        awaited = timeout_s > 0.0 and now_us - began_us > AWAITED_US
        if awaited or message is None:
            self._empty_us = began_us
        return None if message is None else Received(message, now_us, awaited, self._empty_us)

    def _drain(self, first: Received, most: int) -> None:
        """Add a message, and those that the bus has ready after it."""
        received: Received | None = first
        for _ in range(most):
            if received is None:
                return
            self._add(received)
            received = self._receive(0.0)
        if received is not None:
            self._add(received)

    def _add(self, received: Received) -> None:
        self._waiting.append(received)
        newest = self._newest
        if newest is None or received.message.timestamp > newest.message.timestamp:
            self._newest = received
        if len(self._waiting) > self._capacity:
            self._waiting.popleft()
            self.dropped += 1

    def _bounded_age_us(self, received: Received) -> int:
        """Age of a message; whatever its stamp says, it came after nothing had waited.

        A stamp of the future says that the clock was set, perhaps while the messages waited: all of
        them are as much older than their stamps.
        """
        ahead_us = 0 if self._newest is None else max(-self._age_us(self._newest), 0)
        return min(self._age_us(received) + ahead_us, self._clock() - received.earliest_us)

    def _drop_stale(self) -> None:
        """Drop what waited too long, all but one message."""
        now_us, stale_us = self._clock(), self._overload_stale_us
        behind_us = 0 if self._behind_us is None else now_us - self._behind_us
        if behind_us <= OVERLOAD_AFTER * stale_us and not self.is_overloaded:
            while self._has_older(max(STALE_US, stale_us)):
                self._drop_oldest()
            return
        kept_us = round(OVERLOAD_KEPT * stale_us)
        while self._has_older(stale_us):
            self._overloaded_us = now_us
            # One of each message: were it the oldest alone, the last one of those that are sent
            # together would be dropped each time.
            first = self._drop_oldest()
            while self._has_older(kept_us) and self._waiting[0].message_id != first:
                self._drop_oldest()

    def _has_older(self, age_us: int) -> bool:
        """Whether the oldest of several waiting messages is older than that."""
        return len(self._waiting) > 1 and self._bounded_age_us(self._waiting[0]) > age_us

    def _drop_oldest(self) -> tuple[int, bool]:
        """Id of the message that was dropped."""
        self.dropped += 1
        return self._waiting.popleft().message_id
