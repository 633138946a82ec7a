"""Recordings from paths or objects, one or several."""

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from adhesion_can.errors import InputError
from adhesion_can.offline.finding import Finding
from adhesion_can.recordings.recording import Recording
from adhesion_can.recordings.sequence import open_recordings
from adhesion_can.recordings.tables.sample_table import SampleTable

RecordingLike = str | Path | Recording
"""Recording, or path of its file."""
ASSUMED = "assumed to be right"
"""Prefix of a warning about data that look wrong and were used all the same."""
_TIME = re.compile(r"(t|time|timestamp|seconds?|zeit)(\b|_|$)", re.IGNORECASE)


def as_recordings(given: RecordingLike | Iterable[RecordingLike]) -> list[Recording]:
    """Recordings in the order in which they were given.

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


def require_plausible(where: str, findings: Iterable[Finding], *, assumed: bool) -> list[str]:
    """Sentences about what is odd and can be lived with.

    Args:
        where: Name of the data, before each sentence.
        findings: What is odd.
        assumed: Whether the user says that the data are right all the same.

    Raises:
        InputError: With the data as they are no honest answer is possible.

    """
    sentences = []
    for finding in findings:
        if finding.fatal and not assumed:
            fix = f"{finding.fix}; if the data are right, pass --assume plausible"
            raise InputError(where, finding.what, fix)
        doubted = f"{ASSUMED}: " if finding.fatal else ""
        sentences.append(f"{where}: {doubted}{finding.sentence}")
    return sentences


def describe_table(name: str, table: SampleTable, slip_max: float) -> list[str]:
    """Sentences about what was recognised of a table, and what of it is not used.

    Args:
        name: Name of the table, before each sentence.
        table: Table as read from its file.
        slip_max: Largest slip ratio that is used.

    """
    sentences = (*table.notes, *_describe_times(table), *describe_left_out(table, slip_max))
    return [f"{name}: {sentence}" for sentence in sentences]


def _describe_times(table: SampleTable) -> list[str]:
    """That rows count as independent points although a column looks like their time."""
    likely = [name for name in table.samples.covariates if _TIME.match(name)]
    if table.timed or not likely:
        return []
    what = "no column time_s: the rows are treated as independent points"
    return [f"{what}; if {likely[0]!r} is their time, pass --column time_s={likely[0]}"]


def describe_left_out(table: SampleTable, slip_max: float) -> list[str]:
    """Sentences about the rows and columns of a table that are not used.

    Args:
        table: Table as read from its file.
        slip_max: Largest slip ratio that is used.

    """
    sentences = []
    if table.unloaded:
        sentences.append(f"dropped {table.unloaded} of {table.rows} rows: no load above 0")
    if lost := table.left_out - table.unloaded:
        rows = f"{lost} of {table.rows} rows"
        sentences.append(f"dropped {rows} without a finite time, slip and adhesion")
    samples = table.samples
    large = np.abs(samples.slip) > slip_max
    for reason, odd in (
        (f"a slip beyond {slip_max:g}, slip_max of [identifiability]", large),
        ("no speed above 0", ~(samples.speed > 0)),
        ("no load above 0", ~(samples.load > 0)),
    ):
        if odd.any():
            sentences.append(f"dropped {int(odd.sum())} of {table.rows} rows: {reason}")
    usable = ~large & (samples.speed > 0) & (samples.load > 0)
    for column, values in samples.covariates.items():
        missing = int((~np.isfinite(values[usable])).sum())
        if missing:
            rows = f"{missing} of {int(usable.sum())} rows"
            sentences.append(f"column {column!r} not used: it is empty in {rows}")
    return sentences + [
        f"column {column!r} not used: its texts do not form groups of rows"
        for column in table.ignored
    ]
