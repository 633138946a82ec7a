"""Files of the authentication: the key, and the trip counter that no start uses twice."""

import os
import re
import stat
from pathlib import Path

from adhesion_can.bus.secoc import KEY_BYTES, MOST_TRIPS
from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.input_files import read_small_file, regular_file
from adhesion_can.service.file_lock import file_lock

_MOST_BYTES = 256
"""Length beyond which a file is refused, bytes."""
_LOCK_WAIT_S = 10.0
"""Time for which other starts with the same counter are waited for, s; each takes milliseconds."""


def read_key(path: Path) -> bytes:
    """Key from a file with 32 hexadecimal digits that nobody but its owner can read.

    Raises:
        InputError: The file cannot be read, is no key, or is not protected.

    """
    where = f"--secoc-key {path}"
    # What is checked is what is read: another file cannot take its place in between.
    with regular_file(path, where=where, fix="name another file") as file:
        status = os.fstat(file.fileno())
        text = file.read(_MOST_BYTES + 1)
    if status.st_uid not in (0, os.geteuid()):
        raise InputError(where, "belongs to another user", "change its owner with chown")
    if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise InputError(where, "users other than its owner can access it", f"chmod 600 {path}")
    if re.fullmatch(rb"[0-9A-Fa-f]{%d}\s*" % (2 * KEY_BYTES), text) is None:
        raise InputError(
            where,
            f"does not hold a key of {2 * KEY_BYTES} hexadecimal digits",
            f"make one: openssl rand -hex {KEY_BYTES}",
        )
    return bytes.fromhex(text.decode().strip())


class TripFile:
    """Trip counter in a file, written before it is used, and under a lock.

    Args:
        path: Path of the file; where there is none, the counter starts at 1.

    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def next_trip(self) -> int:
        """Next trip counter, which is on the disk when it is returned.

        Raises:
            InputError: The file is damaged, cannot be written, or the counter is used up.

        """
        with file_lock(self._path, str(self._path), wait_s=_LOCK_WAIT_S):
            trip = self._read() + 1
            if trip > MOST_TRIPS:
                raise InputError(str(self._path), "the counter is used up", "take another key")
            with whole_file(self._path, durable=True) as file:
                file.write(f"{trip}\n")
        return trip

    def _read(self) -> int:
        if not self._path.exists():
            return 0
        text = read_small_file(self._path, _MOST_BYTES, fix="name another file")
        if re.fullmatch(rb"[0-9]{1,10}\s*", text) is None:
            raise InputError(
                str(self._path),
                "is not a trip counter",
                "write a number larger than any that was used with this key",
            )
        return int(text)
