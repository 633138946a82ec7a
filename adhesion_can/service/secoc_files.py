"""Files of the authentication: the key, and the trip counter that no start uses twice."""

import os
import re
import stat
from pathlib import Path

from adhesion_can.bus.secoc import KEY_BYTES, MOST_TRIPS
from adhesion_can.errors import InputError
from adhesion_can.files import whole_file

_MOST_BYTES = 256
"""Length beyond which a file is none of these, bytes."""


def read_key(path: Path) -> bytes:
    """Key from a file with 32 hexadecimal digits that nobody but its owner can read.

    Raises:
        InputError: The file cannot be read, is no key, or is not protected.

    """
    where = f"--secoc-key {path}"
    try:
        # What is checked is what is read: another file cannot take its place in between.
        with path.open("rb") as file:
            status = os.fstat(file.fileno())
            text = file.read(_MOST_BYTES + 1)
    except OSError as error:
        reason = error.strerror or "cannot be read"
        raise InputError(where, reason, "name another file") from error
    if not stat.S_ISREG(status.st_mode):
        raise InputError(where, "is no regular file", "name another file")
    if status.st_uid not in (0, os.geteuid()):
        raise InputError(where, "belongs to another user", "take it over with chown")
    if status.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise InputError(where, "others than its owner have rights on it", f"chmod 600 {path}")
    if re.fullmatch(rb"[0-9A-Fa-f]{%d}\s*" % (2 * KEY_BYTES), text) is None:
        raise InputError(
            where,
            f"has not the {2 * KEY_BYTES} hexadecimal digits of a key",
            f"make one: openssl rand -hex {KEY_BYTES}",
        )
    return bytes.fromhex(text.decode().strip())


class TripFile:
    """Trip counter in a file, written before it is used.

    Args:
        path: Path of the file; where there is none, the counter begins at 1.

    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def next_trip(self) -> int:
        """Next trip counter, which is on the disk when it is returned.

        Raises:
            InputError: The file is damaged, cannot be written, or the counter is used up.

        """
        trip = self._read() + 1
        if trip > MOST_TRIPS:
            raise InputError(str(self._path), "the counter is used up", "take another key")
        with whole_file(self._path) as file:
            file.write(f"{trip}\n")
            file.flush()
            os.fsync(file.fileno())
        # The new name has to last as well.
        folder = os.open(self._path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
        return trip

    def _read(self) -> int:
        try:
            with self._path.open("rb") as file:
                text = file.read(_MOST_BYTES + 1)
        except FileNotFoundError:
            return 0
        except OSError as error:
            reason = error.strerror or "cannot be read"
            raise InputError(str(self._path), reason, "name another file") from error
        if re.fullmatch(rb"[0-9]{1,10}\s*", text) is None:
            raise InputError(
                str(self._path),
                "is no trip counter",
                "write a number higher than all that were used with this key",
            )
        return int(text)
