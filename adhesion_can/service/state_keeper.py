"""Writing of the state while the service runs, in a thread: a slow disk makes no setpoint late."""

from collections.abc import Callable
from pathlib import Path

from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.service.behind import DISK_END_S, Behind
from adhesion_can.service.kept_state import KeptState, state_to_text
from adhesion_can.service.outputs import Outputs

NEW_SURFACE_US = 1_000_000
"""Least time after the file was written until it is written for a new surface, µs."""
WAITING_STATES = 8
"""Largest number of states that wait for a disk; of those that wait the latest one is written."""


class StateKeeper:
    """Keeps what a service learns in a file.

    The file is written once an interval, and sooner when a new surface was identified. It is
    replaced as a whole: who ends the process at any moment finds the last one.

    Args:
        path: File of the state.
        state: State to start with.
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
        self._states: Behind[KeptState] = Behind(
            "state", lambda states: self._write(states[-1]), capacity=WAITING_STATES
        )

    def observe(self, t_us: int, outputs: Outputs) -> None:
        """Learn from what was sent at a due time, µs."""
        self.state = state = self.state.with_outputs(t_us, outputs)
        if state is self._handed_over:
            return
        known = {surface.since_us for surface in self._handed_over.surfaces}
        is_new = bool(state.surfaces) and state.surfaces[-1].since_us not in known
        interval_us = min(self._interval_us, NEW_SURFACE_US) if is_new else self._interval_us
        is_due = self._handed_over_us is None or t_us - self._handed_over_us >= interval_us
        # A disk that stands still has enough to write: nothing is lost, a later one is handed over.
        if is_due and self._states.put(state):
            self._handed_over, self._handed_over_us = state, t_us

    def end(self) -> None:
        """Have written what was not written yet; returns at once."""
        self._states.end(None if self.state is self._handed_over else self.state)

    def wait(self) -> bool:
        """Wait for the end, as long as a disk may take; returns whether it came."""
        has_ended = self._states.wait(DISK_END_S)
        if not has_ended:
            self._notify(f"--state {self._path}: not written before the service ended")
        return has_ended

    def _write(self, state: KeptState) -> None:
        try:
            with whole_file(self._path, durable=True) as file:
                file.write(state_to_text(state))
        except (InputError, OSError) as error:
            if not self._failed:
                self._notify(f"--state: {error}; trying again at each interval")
            self._failed = True
            return
        if self._failed:
            self._notify(f"--state {self._path}: can be written again")
        self._failed = False
        self.written += 1
