"""Recordings from paths or objects, one or several."""

from collections.abc import Iterable
from pathlib import Path

from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sample_table import Table
from adhesion_can.recordings.sequence import open_recordings

RecordingLike = str | Path | Recording
"""Recording, or path of its file."""


def as_recordings(given: RecordingLike | Iterable[RecordingLike]) -> list[Recording]:
    """Recordings in the order in which they were given.

    Args:
        given: One recording or path, or several.

    Raises:
        RecordingError: A file is missing, of no known format, or a table.

    """
    return [
        item if isinstance(item, Recording) else open_recordings([Path(item)])[0]
        for item in _as_list(given)
    ]


def as_paths(given: RecordingLike | Iterable[RecordingLike]) -> list[Path]:
    """Paths of recordings or tables, in the order in which they were given."""
    return [item.path if isinstance(item, Recording) else Path(item) for item in _as_list(given)]


def _as_list(given: RecordingLike | Iterable[RecordingLike]) -> list[RecordingLike]:
    return [given] if isinstance(given, str | Path | Recording) else list(given)


def name_of(recordings: Iterable[Recording]) -> str:
    """Paths of recordings in one line, for errors."""
    return ", ".join(str(recording.path) for recording in recordings)


def describe_left_out_rows(name: str, table: Table) -> list[str]:
    """Sentence about the rows of a table that cannot be used; none where all can.

    Args:
        name: Name of the table.
        table: Table as read from its file.

    """
    if not table.left_out:
        return []
    rows = f"{table.left_out} of {table.rows} rows"
    return [f"{name}: {rows} without a finite time, slip and adhesion"]
