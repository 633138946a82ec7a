"""The service's own log: frames as they took effect, in files that are whole when they end.

`FrameLog` writes, and waits where a disk or a reader is slow; `LogBehind` does so behind the loop.
"""

import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.pipes import is_stream, text_stream
from adhesion_can.service.behind import DISK_END_S, STREAM_END_S, Behind
from adhesion_can.service.log_comments import format_comment, stamp_of

WAITING_LINES = 1 << 16
"""Largest number of lines that wait to be written: half a minute of the packaged message set."""
GATHER_S = 0.05
"""Time for which lines gather before they are written together, s."""


class _Unfinished(Exception):  # noqa: N818  no error: it keeps a part as a part
    """The service failed; its log is kept as far as it was written."""


class FrameLog:
    """Log in one file after the other: a.log, a.1.log, a.2.log, in the order of time.

    A disk that takes no more ends the file, and never the service. What was written of it stays
    beside, with the suffix .part; the next file may be asked for when there is room again. A pipe
    or a device is written to as it is, and opened again where another file is asked for.

    Args:
        path: Path of the first file. Later ones take the first free numbers.
        notify: Callback with a line for the operator.

    Raises:
        InputError: The first file cannot be written.

    """

    def __init__(self, path: Path, notify: Callable[[str], None]) -> None:
        self.lost = 0
        """Number of lines that no file took."""
        self._path = path
        self._notify = notify
        self._wants_next = False
        self._stack = ExitStack()
        self._file: Any = None
        self._begin(path)

    def request_next(self) -> None:
        """Ask for another file from the next line on; safe from a signal handler."""
        self._wants_next = True

    def write(self, lines: str) -> None:
        """Write lines, with their ends."""
        if self._wants_next:
            self._wants_next = False
            self._begin_next()
        if self._file is None:
            self.lost += lines.count("\n")
            return
        try:
            self._file.write(lines)
        except OSError as error:
            self.lost += lines.count("\n")
            self._end(error)

    def close(self, *, failed: bool = False) -> None:
        """End the file; after a failure what was written stays as a part."""
        if not failed:
            self._end()
        elif self._file is not None:
            unfinished = _Unfinished()
            self._stack.__exit__(_Unfinished, unfinished, None)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _traceback: object) -> None:
        self.close(failed=error is not None)

    def _begin(self, path: Path) -> None:
        # Later files have names of ours.
        own_name = path != self._path
        opened = (
            text_stream(path)
            if is_stream(path)
            else whole_file(path, keep_part=True, own_name=own_name)
        )
        self._file = self._stack.enter_context(opened)

    def _begin_next(self) -> None:
        self._end()
        number, path = 1, self._path
        packed = self._path.suffix == ".gz"
        suffix = "".join(self._path.suffixes[-2:] if packed else self._path.suffixes[-1:])
        stem = self._path.name.removesuffix(suffix)
        while os.path.lexists(path) and not is_stream(path):
            path = self._path.with_name(f"{stem}.{number}{suffix}")
            number += 1
        try:
            self._begin(path)
        except InputError as error:
            self._notify(f"--log: {error}; the service continues without a log")
        else:
            self._notify(f"--log: continues in {path.name}")

    def _end(self, error: OSError | None = None) -> None:
        """End the file, whole, or as a part at an error of the disk."""
        if self._file is None:
            return
        self._file = None
        reason: Exception | None = error
        try:
            if error is None:
                self._stack.close()
            else:
                self._stack.__exit__(type(error), error, error.__traceback__)
        except (InputError, OSError) as told:
            reason = told
        if reason is not None:
            self._notify(
                f"--log: {reason}; logging has stopped; the lines so far are in *.part; SIGHUP "
                "starts a new log"
            )


class LogBehind:
    """Writes a log in a thread of its own: no disk and no reader holds the loop up.

    Where neither takes what comes, lines are lost, which is reported, and a comment in the log
    marks the place.

    Args:
        path: Path of the first file.
        notify: Callback with a line for the operator; called in both threads.

    Raises:
        InputError: The first file cannot be written, or is a pipe that nobody reads.

    """

    def __init__(self, path: Path, notify: Callable[[str], None]) -> None:
        self._log = FrameLog(path, notify)
        self._notify = notify
        self._end_s = STREAM_END_S if is_stream(path) else DISK_END_S
        self._latest = ""
        """Line that is being handed over."""
        self._lines: Behind[str] = Behind(
            "log",
            lambda lines: self._log.write("".join(lines)),
            capacity=WAITING_LINES,
            pause_s=GATHER_S,
            finish=lambda failed: self._log.close(failed=failed),
            fills=lambda: notify("--log: losing lines: the disk or the reader is too slow"),
            flows=self._mark_hole,
        )

    @property
    def lost(self) -> int:
        """Number of lines that were not written."""
        return self._log.lost + self._lines.lost

    def write(self, line: str) -> None:
        """Have a line written, with its end, or several that belong together; never waits."""
        self._latest = line
        self._lines.put(line)

    def request_next(self) -> None:
        """Ask for another file; safe from a signal handler."""
        self._log.request_next()

    def end(self, *, failed: bool = False) -> None:
        """Have the rest written and the file ended; returns at once."""
        self._lines.end(failed=failed)

    def wait(self) -> bool:
        """Wait for the end, as long as a disk or a reader may take; returns whether it came."""
        has_ended = self._lines.wait(self._end_s)
        if not has_ended:
            self._notify(
                f"--log: {self.lost} lines lost: they were not written before the service ended"
            )
        return has_ended

    def _mark_hole(self, lines: int) -> None:
        text = f"{lines} lines lost: the disk or the reader was too slow"
        self._lines.put(format_comment(stamp_of(self._latest), "log", text))
        self._notify(f"--log: continues; {lines} lines lost")
