"""Losses of python-can's readers in a file, as notes for the user, as far as they can be known."""

import logging
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

_READERS = "can.io"
_LETTERS = 120


class _WarningCounter(logging.Handler):
    """Counts the warnings of one thread and keeps the text of the first."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.count = 0
        self.first = ""
        self._thread = threading.get_ident()

    def emit(self, record: logging.LogRecord) -> None:
        if record.thread != self._thread:
            return
        if not self.count:
            self.first = " ".join(record.getMessage().split())[:_LETTERS]
        self.count += 1


@contextmanager
def collect_python_can_warnings(notes: list[str]) -> Iterator[None]:
    """Add one note of all that python-can's readers warn of, when they are done or stopped.

    Args:
        notes: Notes of the recording, to which the note is added.

    """
    counter = _WarningCounter()
    logger = logging.getLogger(_READERS)
    logger.addHandler(counter)
    try:
        yield
    finally:
        logger.removeHandler(counter)
        if counter.count:
            lines = "a warning" if counter.count == 1 else f"{counter.count} warnings"
            notes.append(f"python-can gives {lines} on lines or frames in it: {counter.first}")


def find_lost_lines(suffix: str, lines: Iterable[bytes], frames: int) -> str | None:
    """Note on lost lines of a text file that was read to its end; None: no loss is visible.

    Nothing can be known of a .csv, whose reader stops at any fault, and little of an .asc, which
    may hold lines of all kinds.

    Args:
        suffix: Suffix of the format.
        lines: Lines of the file.
        frames: Number of frames that the reader gave.

    """
    if suffix == ".trc":
        records = sum(not line.startswith(b";") for line in map(bytes.strip, lines) if line)
        if records > frames:
            return f"python-can takes {records - frames} of {records} lines for no frames"
    elif suffix == ".asc":
        opened = 0
        for line in map(bytes.lower, lines):
            opened += line.startswith(b"begin triggerblock")
            opened -= line.startswith(b"end triggerblock")
        if opened > 0:
            return "the file lacks its last line 'End TriggerBlock': it may be cut"
    return None
