"""Recordings from paths or objects, one or several."""

from collections.abc import Iterable
from pathlib import Path

from adhesion_can.recordings.recording import Recording
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
    items = [given] if isinstance(given, str | Path | Recording) else list(given)
    return [
        item if isinstance(item, Recording) else open_recordings([Path(item)])[0] for item in items
    ]


def name_of(recordings: Iterable[Recording]) -> str:
    """Paths of recordings in one line, for errors."""
    return ", ".join(str(recording.path) for recording in recordings)
