"""A python-can bus that is opened again when it goes down."""

import errno
import time
from collections.abc import Callable, Iterable

import can

from adhesion_can.bus.j1939 import IdFilter
from adhesion_can.errors import BusError
from adhesion_can.service.kernel_losses import count_drops, count_unsent, enlarge_buffer

PAUSES_S = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
"""Pause before each attempt to open a lost bus again, s; the last one repeats."""
BUS_LOST_CODES = frozenset({errno.ENETDOWN, errno.ENODEV, errno.ENXIO, errno.EBADF})
"""Error codes at sending that mean that the bus is gone, and not only full."""
CHECKED_FRAMES = 50
"""Number of frames sent from one look to the next at whether the interface sends them at all."""
LISTEN_ONLY = (
    "the adapter only listens, so no frame of this service reaches the bus; for SocketCAN run "
    "`ip link set can0 down; ip link set can0 type can listen-only off; ip link set can0 up`"
)
OPENING_ERRORS = (can.CanError, OSError, ValueError, BusError)
"""Errors by which python-can's interfaces and the commands say that a bus cannot be opened."""


class ReconnectingBus:
    """Receives from and sends to a bus; opens it again, with growing pauses, when it goes down.

    A bus that was opened again counts as back with the first frame that passes it. While the bus
    is down, nothing is received, and frames to send are dropped.

    Args:
        open_bus: Opener of the bus; called at once, and again after each loss.
        ids: Identifiers to receive; all others are filtered out.
        notify: Callback with a line for the operator.
        clock: Monotonic clock, s.
        sleep: Function that waits for a time, s.
        wait_for_it: Whether a bus that cannot be opened at first is tried again, as a lost one.
        count_unsent: Function that counts the frames that an interface dropped instead of sending;
            None where it gives none.

    Raises:
        OPENING_ERRORS: The bus cannot be opened, and is not waited for.

    """

    def __init__(
        self,
        open_bus: Callable[[], can.BusABC],
        ids: Iterable[IdFilter],
        notify: Callable[[str], None] = lambda _: None,
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
        wait_for_it: bool = False,
        count_unsent: Callable[[can.BusABC], int | None] = count_unsent,
    ) -> None:
        self.sent = 0
        """Number of frames that the bus took."""
        self.send_errors = 0
        """Number of frames that the bus did not take."""
        self.reopened = 0
        """Number of times that the bus came back."""
        self._open_bus = open_bus
        self._filters: can.typechecking.CanFilters = [
            {
                "can_id": id_filter.number,
                "can_mask": id_filter.mask,
                "extended": id_filter.is_extended,
            }
            for id_filter in ids
        ]
        self._notify = notify
        self._clock = clock
        self._sleep = sleep
        self.unsent = 0
        """Number of frames that the interface dropped instead of sending, whoever sent them."""
        self._count_unsent = count_unsent
        self._unsent_before = 0
        self._only_listens = False
        self._drops = self._earlier_drops = 0
        self._failed_attempts = -1
        self._next_attempt_s = 0.0
        self._reopened_unconfirmed = False
        """Whether the bus was opened again and no frame has passed it since."""
        self._bus: can.BusABC | None = None
        try:
            self._bus = self._open_filtered()
        except OPENING_ERRORS as error:
            if not wait_for_it or isinstance(error, can.CanInterfaceNotImplementedError):
                raise
            self._notify(f"cannot open the bus yet ({error}); trying again")
            self._plan_next_attempt()

    @property
    def kernel_drops(self) -> int:
        """Number of frames that the kernel dropped, of all buses; 0 where it does not show."""
        if self._bus is not None:
            self._drops = count_drops(self._bus) or self._drops
        return self._earlier_drops + self._drops

    @property
    def is_open(self) -> bool:
        """Whether the bus is open."""
        return self._bus is not None

    @property
    def channel_info(self) -> str:
        """Description of the bus."""
        return "closed" if self._bus is None else str(self._bus.channel_info)

    def receive(self, timeout_s: float) -> can.Message | None:
        """Next message; None where none came in time, or the bus is down.

        Args:
            timeout_s: Longest time to wait, s.

        """
        if self._bus is None:
            self._try_to_open(timeout_s)
            return None
        try:
            message = self._bus.recv(timeout_s)
        except (can.CanError, OSError) as error:
            self._close_lost_bus(error)
            return None
        if message is not None:
            self._confirm_bus()
        return message

    def send(self, message: can.Message) -> bool:
        """Send a message; returns whether the bus took it."""
        if self._bus is None:
            return False
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            self.send_errors += 1
            code = error.error_code if isinstance(error, can.CanError) else error.errno
            if code in BUS_LOST_CODES:
                self._close_lost_bus(error)
            elif self.send_errors == 1:
                self._notify(f"the bus does not accept frames: {error}")
            return False
        self.sent += 1
        self._confirm_bus()
        if self.sent % CHECKED_FRAMES == 0:
            self._look_for_unsent(self._bus)
        return True

    def shutdown(self) -> None:
        """Close the bus for good."""
        if self._bus is not None:
            self._bus.shutdown()

    def _open_filtered(self) -> can.BusABC:
        """Open the bus, and ask the kernel or python-can for the wanted ids alone."""
        bus = self._open_bus()
        try:
            bus.set_filters(self._filters)
            enlarge_buffer(bus)
        except BaseException:
            bus.shutdown()
            raise
        self._unsent_before = self._count_unsent(bus) or 0
        # Some adapters tell it themselves.
        self._tell_only_listens(getattr(bus, "state", None) is can.BusState.PASSIVE)
        return bus

    def _look_for_unsent(self, bus: can.BusABC) -> None:
        """Count what the interface dropped, and show where that is all that was sent."""
        count = self._count_unsent(bus)
        if count is None:
            return
        fresh, self._unsent_before = max(count - self._unsent_before, 0), count
        self.unsent += fresh
        self._tell_only_listens(fresh >= CHECKED_FRAMES)

    def _tell_only_listens(self, only_listens: bool) -> None:
        if only_listens and not self._only_listens:
            self._notify(LISTEN_ONLY)
        self._only_listens = only_listens

    def _try_to_open(self, timeout_s: float) -> None:
        remaining_s = self._next_attempt_s - self._clock()
        if remaining_s > 0:
            self._sleep(min(timeout_s, remaining_s))
            return
        try:
            self._bus = self._open_filtered()
        except OPENING_ERRORS:
            self._plan_next_attempt()
        else:
            self._reopened_unconfirmed = True

    def _close_lost_bus(self, error: Exception) -> None:
        if not self._reopened_unconfirmed:
            self._notify(f"the bus is gone ({error}); reopening it")
            self._failed_attempts = -1
        # Else it could be opened and carried nothing: the pauses go on growing.
        self._reopened_unconfirmed = False
        if self._bus is not None:
            self._earlier_drops, self._drops = self.kernel_drops, 0
            try:
                self._bus.shutdown()
            except (can.CanError, OSError) as at_close:
                self._notify(f"closing it also failed ({at_close})")
        self._bus = None
        self._plan_next_attempt()

    def _plan_next_attempt(self) -> None:
        self._failed_attempts = min(self._failed_attempts + 1, len(PAUSES_S) - 1)
        self._next_attempt_s = self._clock() + PAUSES_S[self._failed_attempts]

    def _confirm_bus(self) -> None:
        if self._reopened_unconfirmed:
            self._reopened_unconfirmed = False
            self.reopened += 1
            self._notify("the bus is back")
