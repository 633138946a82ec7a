"""The service on a bus: one blocking loop around the core.

The loop waits in `recv` until 2 ms after the next due time at most; so a frame may come that much
late and still count before it. When the bus goes down it is closed and opened again, with growing
pauses, while the core goes on and says STALE_INPUT.
"""

import errno
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import can
import numpy as np

from adhesion_can.bus.frame import ADVANCE, SECOND_SENDER, Frame, Mark, to_us
from adhesion_can.recordings.candump import format_frame, format_mark
from adhesion_can.recordings.recording import from_message, to_message
from adhesion_can.service.core import ServiceCore

GRACE_US = 2_000
IDLE_S = 0.1
"""Longest wait in `recv`, so that a request to stop is heard."""
PAUSES_S = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Before each attempt to open a lost bus again; the last one repeats."""
QUEUE_FRAMES = 4096
"""Bound of our own queue: eight seconds of the contract's full input."""
DRAIN_FRAMES = 256
"""Taken from the bus at most before the next one is handled."""
BEHIND_US = 10_000
"""A frame older than this when it is taken says that more are waiting: they are taken as well."""
GONE = frozenset({errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EBADF})
"""Errors at sending that say that the bus has gone, and not that it is full."""
ECHO_US = 1_000_000
CLOCK_TOLERANCE_US = 1_000_000
"""Stamps further from this host's clock come from another one, and are shifted by the offset."""


def wall_clock() -> int:
    """Clock of this host, µs since the epoch, as SocketCAN stamps frames."""
    return time.time_ns() // 1000


@dataclass(slots=True)
class LiveCounts:
    """What happened on the bus.

    Attributes:
        received: frames.
        sent: frames.
        send_errors: frames that the bus did not take.
        echoes: of our own frames, as some interfaces return them.
        foreign_outputs: our ids, sent by somebody else.
        reopened: times that the bus was opened again.
        clock_offset_us: added to the bus's stamps.

    """

    received: int = 0
    sent: int = 0
    send_errors: int = 0
    echoes: int = 0
    foreign_outputs: int = 0
    reopened: int = 0
    clock_offset_us: int = 0


class LiveService:
    """Runs a core on a python-can bus until told to stop.

    Args:
        core: a fresh one.
        bus: opened.
        reopen: opens the bus again after it went down.
        clock: µs on the clock of the bus's stamps.
        write_log: takes each line of the service's own log.
        dry_run: listen and identify, and send nothing.
        tell: takes a line that a person at the bench should read.

    """

    def __init__(
        self,
        core: ServiceCore,
        bus: can.BusABC,
        reopen: Callable[[], can.BusABC],
        *,
        clock: Callable[[], int] = wall_clock,
        write_log: Callable[[str], object] | None = None,
        dry_run: bool = False,
        tell: Callable[[str], None] = lambda _: None,
    ) -> None:
        self.core = core
        self.counts = LiveCounts()
        self._bus: can.BusABC | None = bus
        self._reopen = reopen
        self._clock = clock
        self._write_log = write_log
        self._dry_run = dry_run
        self._tell = tell
        self._stop = threading.Event()
        self._queue: deque[can.Message] = deque()
        self._sent: deque[tuple[int, int, bytes]] = deque(maxlen=QUEUE_FRAMES)
        self._loop_times: deque[float] = deque(maxlen=1000)
        self._attempt = 0
        self._unproven = False
        self._next_attempt_s = 0.0
        self._synchronised = False
        self._filter()

    def stop(self) -> None:
        """Ask the loop to end; safe from a signal handler or another thread."""
        self._stop.set()

    def run(self, until_us: int | None = None) -> None:
        """Run until `stop` is called, or until the clock passes `until_us`; then close the bus."""
        try:
            while not self._stop.is_set() and (until_us is None or self._clock() < until_us):
                self._step()
        finally:
            if self._bus is not None:
                self._bus.shutdown()

    def _step(self) -> None:
        due_us = self.core.next_due_us
        wait_s = IDLE_S
        if due_us is not None:
            wait_s = min(max((due_us + GRACE_US - self._clock()) / 1e6, 0.0), IDLE_S)
        message = self._receive(wait_s)
        if message is not None:
            self._handle(message)
        elif due_us is not None and self._clock() >= due_us + GRACE_US:
            self._log(format_mark(Mark(due_us, ADVANCE)))
            self._send(self.core.advance(due_us))

    def _receive(self, wait_s: float) -> can.Message | None:
        """Next message; what came in the meantime is taken from the bus into our own queue.

        The queue is bounded: when the service cannot follow, the oldest frames go, counted.
        """
        if self._bus is None:
            self._open_again(wait_s)
            return None
        try:
            message = self._bus.recv(0.0 if self._queue else wait_s)
            if message is not None:
                self._proven()
                if not self._queue and not self._behind(message):
                    return message
                self._take_waiting(message)
        except (can.CanError, OSError) as error:
            self._lost(error)
        return self._queue.popleft() if self._queue else None

    def _behind(self, message: can.Message) -> bool:
        stamp = to_us(message.timestamp) + self.counts.clock_offset_us
        return self._clock() - stamp > BEHIND_US

    def _take_waiting(self, first: can.Message) -> None:
        message: can.Message | None = first
        for _ in range(DRAIN_FRAMES):
            if message is None or self._bus is None:
                return
            self._queue.append(message)
            if len(self._queue) > QUEUE_FRAMES:
                self._queue.popleft()
                self.core.counts.receive_drops += 1
            message = self._bus.recv(0.0)
        if message is not None:
            self._queue.append(message)

    def _handle(self, message: can.Message) -> None:
        began = time.perf_counter()
        self.counts.received += 1
        frame = self._stamped(from_message(message))
        if (frame.arbitration_id, frame.is_extended) in self.core.messages.ids:
            self._own_id(frame)
            return
        frame = frame._replace(t_us=max(frame.t_us, 0))
        effective = frame._replace(t_us=max(frame.t_us, self.core.now_us))
        # The core gets the stamp as it came, and counts it when it has to clamp it.
        self._send(self.core.feed(frame))
        self._log(format_frame(effective))
        self._loop_times.append(time.perf_counter() - began)
        if self.counts.received % 100 == 0:
            self.core.loop_time_p99_us = float(np.quantile(self._loop_times, 0.99)) * 1e6

    def _stamped(self, frame: Frame) -> Frame:
        if not self._synchronised:
            self._synchronised = True
            offset = self._clock() - frame.t_us
            if abs(offset) > CLOCK_TOLERANCE_US:
                self.counts.clock_offset_us = offset
                self._tell(f"the bus stamps by another clock: {offset / 1e6:+.3f} s are added")
        return frame._replace(t_us=frame.t_us + self.counts.clock_offset_us)

    def _own_id(self, frame: Frame) -> None:
        """One of our ids came in: an echo of our own frame, or a second service."""
        while self._sent and self._clock() - self._sent[0][0] > ECHO_US:
            self._sent.popleft()
        for index, (_, number, data) in enumerate(self._sent):
            if (number, data) == (frame.arbitration_id, frame.data):
                del self._sent[index]
                self.counts.echoes += 1
                return
        if not self.counts.foreign_outputs:
            name = self.core.messages.name_of(frame.arbitration_id)
            self._tell(
                f"another sender of {name} ({frame.arbitration_id:#x}) on this bus: status FAULT "
                "while it sends; stop it, or give this service a database with other ids"
            )
        self.counts.foreign_outputs += 1
        mark = Mark(max(frame.t_us, self.core.now_us), SECOND_SENDER)
        self._log(format_mark(mark))
        self.core.second_sender(mark.t_us)

    def _send(self, frames: list[Frame]) -> None:
        for frame in frames:
            self._log(format_frame(frame))
            if self._dry_run or self._bus is None:
                continue
            self._sent.append((self._clock(), frame.arbitration_id, frame.data))
            try:
                self._bus.send(to_message(frame))
            except (can.CanError, OSError) as error:
                self._not_sent(error)
            else:
                self.counts.sent += 1
                self._proven()

    def _not_sent(self, error: can.CanError | OSError) -> None:
        self._sent.pop()
        self.counts.send_errors += 1
        code = error.error_code if isinstance(error, can.CanError) else error.errno
        if code in GONE:
            self._lost(error)
        elif self.counts.send_errors == 1:
            self._tell(f"the bus does not take our frames: {error}")

    def _log(self, line: str) -> None:
        if self._write_log is not None:
            self._write_log(line)

    def _filter(self) -> None:
        """Ask the kernel, or python-can, for our ids alone."""
        if self._bus is not None:
            ids = [*self.core.receiver.ids, *self.core.messages.ids]
            self._bus.set_filters(
                [
                    {"can_id": i, "can_mask": 0x1FFFFFFF if x else 0x7FF, "extended": x}
                    for i, x in ids
                ]
            )

    def _lost(self, error: Exception) -> None:
        if self._unproven:
            # It could be opened and carries nothing: the pauses go on growing.
            self._attempt = min(self._attempt + 1, len(PAUSES_S) - 1)
        else:
            self._tell(f"the bus is gone ({error}); trying to open it again")
            self._attempt = 0
        self._unproven = False
        if self._bus is not None:
            try:
                self._bus.shutdown()
            except (can.CanError, OSError) as at_close:
                self._tell(f"closing it failed as well ({at_close})")
        self._bus = None
        self._next_attempt_s = time.monotonic() + PAUSES_S[self._attempt]

    def _proven(self) -> None:
        """A frame has passed: a bus that was opened again is back."""
        if self._unproven:
            self._unproven = False
            self.counts.reopened += 1
            self._tell("the bus is back")

    def _open_again(self, wait_s: float) -> None:
        if time.monotonic() < self._next_attempt_s:
            self._stop.wait(min(wait_s, max(self._next_attempt_s - time.monotonic(), 0.0)))
            return
        try:
            self._bus = self._reopen()
        except (can.CanError, OSError, ValueError):
            self._attempt = min(self._attempt + 1, len(PAUSES_S) - 1)
            self._next_attempt_s = time.monotonic() + PAUSES_S[self._attempt]
            return
        self._unproven = True
        self._filter()
