"""Log and state of a service, each written by a thread of its own; they end together."""

from collections.abc import Callable
from pathlib import Path
from typing import Self

from adhesion_can.pipes import is_stream
from adhesion_can.service.behind import DISK_END_S, STREAM_END_S
from adhesion_can.service.frame_log import LogBehind
from adhesion_can.service.kept_state import KeptState
from adhesion_can.service.state_keeper import StateKeeper


def longest_end_s(target: Path | str | None) -> float:
    """Time at the end in which an output must be taken, s; '-' is stdout."""
    if target is None:
        return DISK_END_S
    return STREAM_END_S if target == "-" or is_stream(Path(target)) else DISK_END_S


class WrittenBehind:
    """Opens what a service writes, and ends it with the service.

    Args:
        notify: Callback with a line for the operator.

    """

    def __init__(self, notify: Callable[[str], None]) -> None:
        self.all_ended = True
        """Whether everything was written in time when it ended."""
        self._notify = notify
        self._log: LogBehind | None = None
        self._keeper: StateKeeper | None = None

    def log(self, path: Path) -> LogBehind:
        """Start a log.

        Raises:
            InputError: It cannot be written, or is a pipe that nobody reads.

        """
        self._log = LogBehind(path, self._notify)
        return self._log

    def keep(self, path: Path, state: KeptState, interval_s: float) -> StateKeeper:
        """Start to keep a state in a file, once an interval."""
        self._keeper = StateKeeper(path, state, interval_s, self._notify)
        return self._keeper

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _traceback: object) -> None:
        """End both at once, and wait as long as a disk or a reader may take."""
        if self._log is not None:
            self._log.end(failed=error is not None)
        if self._keeper is not None:
            self._keeper.end()
        waited = [writer.wait() for writer in (self._log, self._keeper) if writer is not None]
        self.all_ended = all(waited)
