"""Notices to a service manager: ready, alive, stopping (systemd's sd_notify protocol)."""

import socket
import time
from collections.abc import Callable, Mapping


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
        """Tell that the service is ready, with a line for `systemctl status`."""
        self._tell(f"READY=1\nSTATUS={status}")

    def alive(self) -> None:
        """Tell that the loop goes on, where a watchdog waits for it; cheap, for every turn."""
        if not self._interval_s:
            return
        now_s = self._clock()
        if now_s - self._told_s >= self._interval_s:
            self._told_s = now_s
            self._tell("WATCHDOG=1")

    def stopping(self) -> None:
        """Tell that the service ends."""
        self._tell("STOPPING=1")

    def _tell(self, text: str) -> None:
        if not self._address:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as out:
            try:
                out.sendto(text.encode(), self._address)
            except OSError:
                # A manager that restarts misses a notice; the next one reaches it.
                return
