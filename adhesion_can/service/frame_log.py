"""The service's own log: frames as they took effect, in files that are whole when they end."""

import os
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from adhesion_can.errors import InputError
from adhesion_can.files import whole_file

READER_WAIT_S = 5.0
"""Time for which a start waits for the reader of a log that is a pipe, s."""


class FrameLog:
    """Log in one file after the other: a.log, a.1.log, a.2.log, in the order of time.

    A disk that takes no more ends the file, and never the service. What was written of it stays
    beside, with the suffix .part; the next file may be asked for when there is room again.

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

    def write(self, line: str) -> None:
        """Write a line, with its end."""
        if self._wants_next:
            self._wants_next = False
            self._begin_next()
        if self._file is None:
            self.lost += 1
            return
        try:
            self._file.write(line)
        except OSError as error:
            self.lost += 1
            self._end(error)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """End the file; after an exception what was written stays as a part."""
        if error is None:
            self._end()
        else:
            self._stack.__exit__(kind, error, traceback)

    def _begin(self, path: Path) -> None:
        # Later files have names of ours.
        out = whole_file(
            path,
            keep_part=True,
            own_name=path != self._path,
            reader_wait_s=READER_WAIT_S,
        )
        self._file = self._stack.enter_context(out)

    def _begin_next(self) -> None:
        self._end()
        number, path = 1, self._path
        packed = self._path.suffix == ".gz"
        suffix = "".join(self._path.suffixes[-2:] if packed else self._path.suffixes[-1:])
        stem = self._path.name.removesuffix(suffix)
        while os.path.lexists(path):
            path = self._path.with_name(f"{stem}.{number}{suffix}")
            number += 1
        try:
            self._begin(path)
        except InputError as error:
            self._notify(f"--log: {error}; the service goes on without a log")
        else:
            self._notify(f"--log: goes on in {path.name}")

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
                f"--log: {reason}; it ends here, what was written stays in *.part; SIGHUP begins "
                "another one"
            )
