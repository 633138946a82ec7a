"""Warnings of python-can's readers about a file, as a note for the user."""

import logging
import threading
from collections.abc import Iterator
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
            notes.append(f"python-can reports {lines} about its lines or frames: {counter.first}")
