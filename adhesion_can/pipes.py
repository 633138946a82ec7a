"""Pipes and devices as outputs: opened without waiting for a reader for ever, written whole."""

import errno
import gzip
import io
import os
import select
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, cast

from adhesion_can.errors import InputError

READER_S = 3.0
"""Time in which the reader of a pipe must have opened it, s: it may be started together with us."""
_LOOK_S = 0.02
_FULL_S = 1.0


def is_stream(path: Path) -> bool:
    """Whether a path is that of something which is no file and no folder: a pipe, a device."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def open_stream(path: Path, reader_s: float | None = None) -> int:
    """Descriptor of a pipe or a device, for writing.

    Args:
        path: Path of the pipe or the device.
        reader_s: Time in which a pipe's reader must have opened it, s; None: `READER_S`.

    Raises:
        InputError: Nobody reads the pipe, it cannot be opened, or a file has taken its place.

    """
    end_s = time.monotonic() + (READER_S if reader_s is None else reader_s)
    flags = os.O_WRONLY
    for name in ("O_NONBLOCK", "O_NOCTTY", "O_CLOEXEC", "O_BINARY"):
        flags |= getattr(os, name, 0)  # as far as this system has them
    while True:
        try:
            descriptor = os.open(path, flags)
        except OSError as error:
            if not (error.errno == errno.ENXIO and path.is_fifo()):
                reason = error.strerror or "cannot be opened"
                raise InputError(str(path), reason, "name another file") from error
            if time.monotonic() >= end_s:
                fix = "start its reader first, or name a file"
                raise InputError(str(path), "is a pipe without a reader", fix) from error
            time.sleep(_LOOK_S)
        else:
            break
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise InputError(str(path), "was a pipe or a device and became a file", "try again")
    if sys.platform != "win32":
        os.set_blocking(descriptor, True)
    return descriptor


def write_whole(descriptor: int, data: bytes) -> None:
    """Write all of some bytes, however long the reader takes.

    Raises:
        OSError: The reader has gone, or the device takes no more.

    """
    rest = memoryview(data)
    while rest:
        try:
            rest = rest[os.write(descriptor, rest) :]
        except BlockingIOError:
            # Somebody who has the same descriptor made it so.
            select.select([], [descriptor], [], _FULL_S)


class _Pipe(io.RawIOBase):
    """A descriptor as a binary file without a buffer: no lock is held while its reader stalls."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def writable(self) -> bool:
        return True

    def write(self, data: object, /) -> int:
        whole = bytes(cast(bytes, data))
        write_whole(self._descriptor, whole)
        return len(whole)

    def close(self) -> None:
        if not self.closed:
            os.close(self._descriptor)
        super().close()


class TextStream:
    """Text in UTF-8 to a binary file, at once.

    Args:
        file: File to write to.

    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def write(self, text: str) -> None:
        """Write some text."""
        self._file.write(text.encode())


@contextmanager
def text_stream(path: Path) -> Iterator[TextStream]:
    """Open a pipe or a device for text; one whose name ends in .gz gets it compressed.

    Raises:
        InputError: Nobody reads the pipe, or it cannot be opened.

    """
    pipe = cast(BinaryIO, _Pipe(open_stream(path)))
    with pipe:
        if path.suffix != ".gz":
            yield TextStream(pipe)
            return
        with gzip.GzipFile(path.stem, "wb", fileobj=pipe, mtime=0) as packed:
            yield TextStream(cast(BinaryIO, packed))
