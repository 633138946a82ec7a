"""The file of `--state` at the start of a service."""

import errno
import os
import time
from collections.abc import Callable
from pathlib import Path

from adhesion_can.config import Configuration
from adhesion_can.errors import InputError
from adhesion_can.input_files import regular_file
from adhesion_can.service.kept_state import (
    LARGEST_TEXT,
    KeptState,
    StateError,
    fingerprint,
    state_from_text,
)

_NOT_WRITABLE = (errno.EROFS, errno.EACCES, errno.EPERM)


def read_state(config: Configuration, path: Path, notify: Callable[[str], None]) -> KeptState:
    """Kept state; an empty one where there is none, or where it is refused.

    A file that is refused stays beside the new one, with the suffix .refused; where it cannot be
    renamed, nor written, under its own name.

    Args:
        config: Configuration, whose vehicle the state has to fit.
        path: Path of the file.
        notify: Callback with a line for the operator.

    Raises:
        InputError: The file is none, or cannot be read or renamed.

    """
    empty = KeptState(fingerprint(config))
    where = f"--state {path}"
    if not path.exists():
        return empty
    with regular_file(path, where=where, fix="name another file") as file:
        content = file.read(LARGEST_TEXT + 1)
    try:
        now_us = time.time_ns() // 1000
        text = content.decode("utf-8", errors="replace")
        return state_from_text(text, empty.vehicle, now_us, config.service.state_age_s)
    except StateError as error:
        notify(f"{where} is not used: {error}; starting cold; {_put_aside(path, where)}")
        return empty


def _put_aside(path: Path, where: str) -> str:
    """Rename a file that is refused; a clause on where it is now.

    Raises:
        InputError: It cannot be renamed, and would be written over.

    """
    place = Path(os.path.realpath(path))
    refused = place.with_name(place.name + ".refused")
    try:
        place.replace(refused)
    except OSError as error:
        reason = error.strerror or "no reason given"
        if error.errno in _NOT_WRITABLE:
            return f"it cannot be renamed ({reason}) and stays in place"
        what = f"can be neither used nor renamed to {refused.name} ({reason})"
        raise InputError(where, what, f"move {refused} out of the way") from error
    return f"renamed to {refused.name}"
