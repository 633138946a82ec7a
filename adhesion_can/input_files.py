"""Files that a user gives: opened without waiting for a pipe, read where they are small, hashed."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from hashlib import sha256
from pathlib import Path
from typing import BinaryIO

from adhesion_can.errors import InputError


def file_sha256(path: Path) -> str:
    """Hash of a file's bytes, hex."""
    digest = sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


@contextmanager
def regular_file(
    path: Path,
    *,
    where: str = "",
    kind: type[InputError] = InputError,
    fix: str = "check the path",
) -> Iterator[BinaryIO]:
    """Open a file for reading; a pipe or a device is refused, and never waited for.

    Args:
        path: Path of the file.
        where: Name of the file in errors; '' for the path.
        kind: Class of the errors.
        fix: Advice where the file cannot be read.

    Raises:
        InputError: The file cannot be read, or is a pipe or a device; of the class `kind`.

    """
    where = where or str(path)
    try:
        number = open_descriptor(path, os.O_RDONLY, "O_NONBLOCK", "O_NOCTTY")
        with ExitStack() as stack:
            stack.callback(os.close, number)
            form = os.fstat(number).st_mode
            if stat.S_ISDIR(form):
                raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
            if not stat.S_ISREG(form):
                raise kind(where, "is a pipe or a device, not a file", "write it to a file first")
            yield stack.enter_context(os.fdopen(number, "rb", closefd=False))
    except OSError as error:
        if error.errno == errno.ENXIO:  # of a socket
            what = "is a pipe or a device, not a file"
            raise kind(where, what, "write it to a file first") from error
        raise kind(where, error.strerror or "cannot be read", fix) from error


def read_small_file(
    path: Path,
    largest: int,
    *,
    where: str = "",
    kind: type[InputError] = InputError,
    fix: str = "check the path",
) -> bytes:
    """Content of a file that a user gives and that is small where it is the right one.

    Args:
        path: Path of the file.
        largest: Largest size, bytes.
        where: Name of the file in errors; '' for the path.
        kind: Class of the errors.
        fix: Advice where the file cannot be read.

    Raises:
        InputError: The file cannot be read, is too large, or is a pipe or a device; of the class
            `kind`.

    """
    with regular_file(path, where=where, kind=kind, fix=fix) as file:
        content = file.read(largest + 1)
    if len(content) > largest:
        size = f"{largest >> 20} MiB" if largest >= 1 << 20 else f"{largest} bytes"
        raise kind(where or str(path), f"larger than {size}", "check that it is the right file")
    return content


def open_descriptor(path: Path, flags: int, *names: str, rights: int = 0o666) -> int:
    """Descriptor of a file, with further flags by the names that this system may not have."""
    for name in ("O_BINARY", *names):
        flags |= getattr(os, name, 0)
    return os.open(path, flags, rights)
