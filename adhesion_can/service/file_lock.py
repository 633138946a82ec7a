"""Locks between processes on one machine, beside the file that they are for."""

import errno
import fcntl
import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from adhesion_can.errors import InputError

_POLL_S = 0.005


@contextmanager
def file_lock(path: Path, where: str, *, wait_s: float = 0.0) -> Iterator[None]:
    """Keep all others away who ask for the lock of a file, however this process ends.

    The lock is on a file of its own, with the suffix .lock: the file itself is replaced whenever it
    is written, and may not be there yet. It is left where it is: who took it away could not know
    whether somebody had just opened it. Where nobody can make one, nobody can write the file
    either, and it needs no lock.

    Args:
        path: Path of the file, which links may lead to.
        where: Option and file, for errors.
        wait_s: Time for which a lock that is held is waited for, s.

    Raises:
        InputError: The lock is held or cannot be had, or the path is that of a pipe or a device.

    """
    if path.exists() and not path.is_file():
        raise InputError(where, "is a pipe or a device, not a file", "name a file")
    place = Path(os.path.realpath(path))
    place = place.with_name(f"{place.name}.lock")
    try:
        number = _locked(place, where, time.monotonic() + wait_s)
    except BlockingIOError as error:
        what = "is in use by another process of adhesion-can"
        raise InputError(
            where, what, f"stop that process, or name another file ({place})"
        ) from error
    except OSError as error:
        what = f"cannot be locked by {place.name} ({error.strerror})"
        raise InputError(where, what, "name another file, in a folder that you own") from error
    try:
        yield
    finally:
        if number is not None:
            os.close(number)


def _locked(place: Path, where: str, until_s: float) -> int | None:
    """Descriptor of a lock that is held; None where nobody can make one."""
    while True:
        try:
            flags = os.O_RDONLY | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
            number = os.open(place, flags, 0o600)
        except OSError as error:
            if error.errno == errno.ELOOP:
                fix = "remove the link, or name another file"
                raise InputError(where, f"its lock {place.name} is a link", fix) from error
            if error.errno in (errno.EROFS, errno.EACCES) and not place.exists():
                return None
            raise
        try:
            _require_file(number, place, where)
            _take(number, until_s)
            if _is_there(number, place):
                return number
        except BaseException:
            os.close(number)
            raise
        os.close(number)  # it was taken away meanwhile


def _require_file(number: int, place: Path, where: str) -> None:
    if not stat.S_ISREG(os.fstat(number).st_mode):
        fix = "remove it, or name another file"
        raise InputError(where, f"its lock {place.name} is not a file", fix)


def _take(number: int, until_s: float) -> None:
    """Lock a file.

    Raises:
        BlockingIOError: It is held by another until then.

    """
    while True:
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= until_s:
                raise
            time.sleep(_POLL_S)
        else:
            return


def _is_there(number: int, place: Path) -> bool:
    """Whether an open file still has its name."""
    try:
        status = place.lstat()
    except FileNotFoundError:
        return False
    return os.path.samestat(os.fstat(number), status)
