"""Hashes of files, and files that appear whole or not at all."""

import errno
import gzip
import io
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any, BinaryIO

from adhesion_can.errors import InputError

_DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def file_sha256(path: Path) -> str:
    """Hash of a file's bytes, hex."""
    digest = sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


@contextmanager
def whole_file(path: Path, mode: str = "w", *, keep_part: bool = False) -> Iterator[Any]:
    """Write a file under a temporary name; it gets its own when all is written, else vanishes.

    A device or a pipe, such as /dev/stdout, is written to as it is: by its name a file would take
    its place. So would it take that of a symbolic link; the file that a link names is written.

    Args:
        path: Path of the finished file; a suffix .gz compresses it.
        mode: Mode of opening, 'w' or 'wb'.
        keep_part: Whether the part written before an exception is kept, with the suffix .part: a
            recording cannot be made again.

    Raises:
        InputError: the folder does not exist or cannot be written to, or the disk is full.

    """
    if path.is_dir():
        raise InputError(str(path), "is a folder", "name a file")
    is_stream = path.exists() and not path.is_file()
    target = path if is_stream else Path(os.path.realpath(path))
    part = path if is_stream else target.with_name(target.name + ".part")
    try:
        raw: BinaryIO = part.open("wb")
    except OSError as error:
        raise InputError(
            str(path), error.strerror or "cannot be written", "name a folder that can be written to"
        ) from error
    try:
        with ExitStack() as stack:
            file: Any = stack.enter_context(raw)
            if path.suffix == ".gz":
                packed = gzip.GzipFile(path.stem, "wb", fileobj=raw, mtime=0)
                file = stack.enter_context(packed)
            if "b" not in mode:
                text = io.TextIOWrapper(file, encoding="utf-8", newline="")
                file = stack.enter_context(text)
            yield file
        if not is_stream:
            part.replace(target)
    except BaseException as error:
        if not (keep_part or is_stream):
            part.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno in _DISK_FULL:
            reason = error.strerror or "cannot be written"
            raise InputError(str(path), reason, "make room, or name another disk") from error
        raise
