"""Writing of the state while the service runs, in a thread: a slow disk makes no setpoint late."""

import threading
from collections.abc import Callable
from pathlib import Path

from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.service.kept_state import KeptState, state_to_text
from adhesion_can.service.outputs import Outputs

NEW_SURFACE_US = 1_000_000
"""Least time after the file was written until it is written for a new surface, µs."""


class StateKeeper:
    """Keeps what a service learns in a file.

    The file is written once an interval, and sooner when a new surface was identified. It is
    replaced as a whole: who ends the process at any moment finds the last one.

    Args:
        path: File of the state.
        state: State to begin with.
        interval_s: Interval of writing, s.
        notify: Callback with a line for the operator.

    """

    def __init__(
        self, path: Path, state: KeptState, interval_s: float, notify: Callable[[str], None]
    ) -> None:
        self.state = state
        self.written = 0
        """Number of times that the file was written."""
        self._path = path
        self._interval_us = round(interval_s * 1e6)
        self._notify = notify
        self._handed_over = state
        self._handed_over_us: int | None = None
        self._failed = False
        self._closing = False
        self._waiting: KeptState | None = None
        self._condition = threading.Condition()
        self._thread = threading.Thread(target=self._write_all, name="state", daemon=True)
        self._thread.start()

    def observe(self, t_us: int, outputs: Outputs) -> None:
        """Learn from what was sent at a due time, µs."""
        self.state = state = self.state.with_outputs(t_us, outputs)
        if state is self._handed_over:
            return
        known = {surface.since_us for surface in self._handed_over.surfaces}
        is_new = bool(state.surfaces) and state.surfaces[-1].since_us not in known
        interval_us = min(self._interval_us, NEW_SURFACE_US) if is_new else self._interval_us
        if self._handed_over_us is None or t_us - self._handed_over_us >= interval_us:
            self._hand_over(t_us)

    def close(self) -> None:
        """Write what was not written yet, and end."""
        with self._condition:
            if self.state is not self._handed_over:
                self._waiting = self.state
            self._closing = True
            self._condition.notify()
        self._thread.join()

    def _hand_over(self, t_us: int) -> None:
        self._handed_over, self._handed_over_us = self.state, t_us
        with self._condition:
            self._waiting = self.state
            self._condition.notify()

    def _write_all(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._waiting is not None or self._closing)
                state, self._waiting = self._waiting, None
                if state is None:
                    return
            self._write(state)

    def _write(self, state: KeptState) -> None:
        try:
            with whole_file(self._path, durable=True) as file:
                file.write(state_to_text(state))
        except (InputError, OSError) as error:
            if not self._failed:
                self._notify(f"--state: {error}; tried again at each interval")
            self._failed = True
            return
        if self._failed:
            self._notify(f"--state {self._path}: written again")
        self._failed = False
        self.written += 1
