"""python-can's readers of files, what of their frames can be, and what they warn of."""

import gzip
import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can

from adhesion_can.bus.frame import MAX_PAYLOAD, MOST_ID, Frame
from adhesion_can.recordings.candump import LAST_US
from adhesion_can.recordings.formats import MF4, SQLITE
from adhesion_can.recordings.python_can_mf4 import mf4_reader
from adhesion_can.recordings.text_columns.text_source import Packing

_READERS: dict[str, tuple[Callable[[Any], can.io.generic.MessageReader], str]] = {
    ".asc": (can.ASCReader, "rt"),
    ".blf": (can.BLFReader, "rb"),
    ".csv": (can.CSVReader, "rt"),
    ".trc": (can.TRCReader, "rt"),
    MF4: (mf4_reader, "rb"),
    SQLITE: (can.SqliteReader, "rb"),
}
"""python-can's reader of each format, and how it wants an open file."""


def open_reader(path: Path, form: str, packing: Packing) -> can.io.generic.MessageReader:
    """python-can's reader of a format, whatever the name of the file.

    Args:
        path: Path of the file.
        form: Suffix of its format.
        packing: Compression of the file, gzip or none.

    """
    reader, mode = _READERS[form]
    return reader(path if packing is Packing.NONE else gzip.open(path, mode))


def require_valid(frame: Frame) -> None:
    """Raise a ValueError where no bus can carry a frame."""
    if len(frame.data) > MAX_PAYLOAD:
        raise ValueError(f"a frame of {len(frame.data)} bytes")
    if abs(frame.t_us) > LAST_US:
        raise ValueError(f"a frame stamped {frame.t_us / 1e6:g} s")
    if not (frame.is_error or 0 <= frame.arbitration_id <= MOST_ID):
        raise ValueError(f"a frame of the id {frame.arbitration_id}")


def position_of(reader: can.io.generic.MessageReader | None) -> int:
    """Number of bytes of its file that a reader has read; 0 where unknown, as with a data base."""
    file = getattr(reader, "file", None)
    for inner in ("buffer", "fileobj"):  # of text, of gzip
        file = getattr(file, inner, file)
    return file.tell() if file and not file.closed else 0


_LOGGER = "can.io"
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
    logger = logging.getLogger(_LOGGER)
    logger.addHandler(counter)
    try:
        yield
    finally:
        logger.removeHandler(counter)
        if counter.count:
            lines = "a warning" if counter.count == 1 else f"{counter.count} warnings"
            notes.append(f"python-can reports {lines} about its lines or frames: {counter.first}")
