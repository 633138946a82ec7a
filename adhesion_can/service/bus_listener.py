"""Listens to a bus in a thread of its own, and sends nothing.

Somebody else takes the frames when it suits him. What waits is bounded: the oldest frames go, and
are counted.
"""

import threading
from collections import deque
from collections.abc import Callable

from adhesion_can.bus.frame import Frame, to_us
from adhesion_can.bus.j1939 import IdFilter
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.service.live import start_clock
from adhesion_can.service.receive_queue import Received, ReceiveQueue
from adhesion_can.service.reconnecting_bus import ReconnectingBus
from adhesion_can.service.stamp_clock import StampClock

EVERY_ID = (IdFilter(0, is_extended=False, mask=0), IdFilter(0, is_extended=True, mask=0))
"""Filters that let every frame pass."""
CAPACITY = 20_000
"""Largest number of frames that wait: two seconds of a full bus at 1 Mbit/s."""
IDLE_S = 0.1
"""Longest wait for a frame, s, so that a request to stop is seen soon."""


class BusListener:
    """Frames of a bus, with stamps on the clock of this host.

    Args:
        bus: Bus to listen to.
        notify: Callback with a line for the operator; called in the thread.
        capacity: Largest number of frames that wait to be taken.

    """

    def __init__(
        self,
        bus: ReconnectingBus,
        notify: Callable[[str], None] = lambda _: None,
        *,
        capacity: int = CAPACITY,
    ) -> None:
        self.clock = start_clock()
        self._bus = bus
        self._stamps = StampClock(notify)
        self._queue = ReceiveQueue(bus, self._age_us, self.clock)
        self._capacity = capacity
        self._dropped = 0
        self._waiting: deque[Frame] = deque()
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._listen, name="bus listener", daemon=True)

    @property
    def dropped(self) -> int:
        """Number of frames lost on this host: by the kernel, or as they were not taken in time."""
        return self._dropped + self._queue.dropped + self._bus.kernel_drops

    @property
    def is_open(self) -> bool:
        """Whether the bus is open."""
        return self._bus.is_open

    def start(self) -> None:
        """Start to listen."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread, and close the bus."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        self._bus.shutdown()

    def take(self, limit: int = CAPACITY) -> list[Frame]:
        """Oldest frames that were not taken yet, no more than a limit.

        Raises:
            Exception: What ended the thread.

        """
        if self._failure is not None:
            raise self._failure
        with self._lock:
            return [self._waiting.popleft() for _ in range(min(limit, len(self._waiting)))]

    def _listen(self) -> None:
        try:
            while not self._stop.is_set():
                received = self._queue.get(IDLE_S)
                if received is not None:
                    self._add(received)
        except BaseException as error:  # noqa: BLE001  who takes frames raises it
            self._failure = error

    def _add(self, received: Received) -> None:
        frame = from_message(received.message)
        t_us = self._stamps.to_host(
            frame.t_us, received.time_us, received.earliest_us, awaited=received.awaited
        )
        with self._lock:
            self._waiting.append(frame._replace(t_us=max(t_us, 0)))
            if len(self._waiting) > self._capacity:
                self._waiting.popleft()
                self._dropped += 1

    def _age_us(self, received: Received) -> int:
        if not self._stamps.usable:
            return 0
        return self.clock() - (to_us(received.message.timestamp) + self._stamps.offset_us)
