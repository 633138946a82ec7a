"""Hashes of files, and files that appear whole or not at all."""

import errno
import gzip
import io
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

    Args:
        path: Path of the finished file; a suffix .gz compresses it.
        mode: Mode of opening, 'w' or 'wb'.
        keep_part: Whether the part written before an exception is kept, with the suffix .part: a
            recording cannot be made again.

    Raises:
        InputError: the folder does not exist or cannot be written to, or the disk is full.

    """
    part = path.with_name(path.name + ".part")
    if path.is_dir():
        raise InputError(str(path), "is a folder", "name a file")
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
        part.replace(path)
    except BaseException as error:
        if not keep_part:
            part.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno in _DISK_FULL:
            reason = error.strerror or "cannot be written"
            raise InputError(str(path), reason, "make room, or name another disk") from error
        raise
