"""stderr of the service, behind its loop: a reader that stops delays no setpoint up."""

import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr
from typing import TextIO, cast

from adhesion_can.pipes import write_whole
from adhesion_can.service.behind import STREAM_END_S, Behind

WAITING_TEXTS = 64
"""Largest number of texts that wait for the reader: a burst of lines, and half a minute more."""


class StderrBehind(io.TextIOBase):
    """Text stream that takes what it is given at once, and writes it in a thread of its own.

    Args:
        file: Stream to write to.

    """

    def __init__(self, file: TextIO) -> None:
        self.has_ended = True
        """Whether all was written, or lost for good, when it was closed."""
        self._file = file
        self._encoding = file.encoding or "utf-8"
        file.flush()
        try:
            # Past the file's own buffer: a reader that stalls would keep its lock until the end of
            # the interpreter, which takes it.
            self._descriptor: int | None = file.fileno()
        except OSError:
            self._descriptor = None
        self._texts: Behind[str] = Behind("stderr", self._write_all, capacity=WAITING_TEXTS)

    @property
    def has_room(self) -> bool:
        """Whether the next text would be taken."""
        return self._texts.has_room

    def write(self, text: str, /) -> int:
        """Have some text written; never waits."""
        self._texts.put(text)
        return len(text)

    def writable(self) -> bool:
        """Whether it can be written to."""
        return True

    def isatty(self) -> bool:
        """Whether a terminal shows it."""
        return self._file.isatty()

    def end(self) -> None:
        """Have the rest written, as long as a reader may take."""
        self._texts.end()
        self.has_ended = self._texts.wait(STREAM_END_S)

    def _write_all(self, texts: list[str]) -> None:
        text = "".join(texts)
        try:
            if self._descriptor is None:
                self._file.write(text)
                self._file.flush()
            else:
                write_whole(self._descriptor, text.encode(self._encoding, "backslashreplace"))
        except OSError:
            # Its reader has gone, or its disk is full: there is nobody to tell it to.
            return


@contextmanager
def stderr_behind() -> Iterator[StderrBehind]:
    """Send what anybody in this process says on stderr through one queue, libraries as well."""
    behind = StderrBehind(sys.stderr)
    try:
        with redirect_stderr(cast(TextIO, behind)):
            yield behind
    finally:
        behind.end()
