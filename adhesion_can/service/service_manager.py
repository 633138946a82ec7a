"""Notices to a service manager: ready, alive, stopping (systemd's sd_notify protocol)."""

import socket
import time
from collections.abc import Callable, Mapping

READY_S = 1.0
"""Longest time to wait at the start for a manager that is busy, s."""
AGAIN = 0.1
"""Part of an interval after which a notice is tried again that the manager did not take."""


class ServiceManager:
    """Speaks to the manager that started this process; without one, to nobody.

    The protocol is a datagram of NAME=VALUE lines to the socket of `NOTIFY_SOCKET`, sd_notify(3).

    Args:
        environment: Environment of the process; `NOTIFY_SOCKET` and `WATCHDOG_USEC` count.
        clock: Monotonic clock, s.

    """

    def __init__(
        self, environment: Mapping[str, str], clock: Callable[[], float] = time.monotonic
    ) -> None:
        # A leading @ is an address in the abstract namespace, which begins with a zero byte.
        self._address = environment.get("NOTIFY_SOCKET", "").replace("@", "\0", 1)
        watchdog_us = environment.get("WATCHDOG_USEC", "")
        self._interval_s = int(watchdog_us) / 2e6 if watchdog_us.isdecimal() else 0.0
        self._clock = clock
        self._told_s = -1e9

    def ready(self, status: str) -> None:
        """Report that the service is ready, with a line for `systemctl status`."""
        self._tell(f"READY=1\nSTATUS={status}", READY_S)

    def alive(self) -> None:
        """Report that the loop goes on, where a watchdog waits for it; cheap, for every turn.

        It is called by the loop itself, and waits for nobody.
        """
        if not self._interval_s:
            return
        now_s = self._clock()
        if now_s - self._told_s >= self._interval_s:
            was_told = self._tell("WATCHDOG=1")
            self._told_s = now_s if was_told else now_s - (1.0 - AGAIN) * self._interval_s

    def stopping(self) -> None:
        """Report that the service ends."""
        self._tell("STOPPING=1")

    def _tell(self, text: str, wait_s: float = 0.0) -> bool:
        """Send a notice; returns whether the manager took it within a time, s."""
        if not self._address:
            return True
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out:
            out.settimeout(wait_s)
            try:
                out.sendto(text.encode(), self._address)
            except OSError:
                # A manager that restarts, or has not read the last ones yet.
                return False
        return True
