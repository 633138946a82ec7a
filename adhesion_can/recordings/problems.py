"""Sentences about what was passed over while recordings were read."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from adhesion_can.errors import RecordingError
from adhesion_can.plurals import counted
from adhesion_can.recordings.recording import Recording

NO_FRAME_FIX = "is it a recording of a bus, as 'candump -L' makes one?"
"""What to look at where a file has not one frame."""

LEAST_ACCEPTED = 0.1
"""Share of a message's frames that pass their checks where the database is that of the bus: with
ids of another bus, one in 256 has the right checksum by chance."""


def distinct_names(paths: Sequence[Path]) -> list[str]:
    """Names of files for sentences: without the folder where the names differ without it."""
    bare = Counter(path.name for path in paths)
    return [path.name if bare[path.name] == 1 else str(path) for path in paths]


def describe_problems(
    recordings: Sequence[Recording],
    backwards: str = "read with the time of the previous frame",
    names: Sequence[str] | None = None,
    *,
    with_remarks: bool = True,
) -> list[str]:
    """Sentences about lines that were passed over, and what else is to be known of a file.

    Args:
        recordings: Recordings that were read to their end.
        backwards: What was done with frames that are stamped before the one in front of them.
        names: Names of the recordings for the sentences; None: by their paths.
        with_remarks: Whether what is not wrong is among them.

    """
    sentences = []
    names = names or distinct_names([recording.path for recording in recordings])
    for name, recording in zip(names, recordings, strict=True):
        report = recording.report
        sentences += [f"{name}: {note}" for note in report.notes]
        sentences += [f"{name}: {remark}" for remark in report.remarks] if with_remarks else []
        if report.backwards:
            count = counted(report.backwards, "frame")
            sentences.append(
                f"{name}: {count} stamped earlier than the previous frame, {backwards}"
            )
        if report.passed_over:
            kinds = ", ".join(
                f"{report.kinds[kind]} {kind}"
                for kind in ("malformed", "untimed", "cut")
                if report.kinds[kind]
            )
            lines = ", ".join(map(str, report.bad_lines[:5]))
            where = f" (line {lines}, ..)" if lines else ""  # the end of a packed file has none
            sentences.append(f"{name}: lines skipped: {kinds}{where}")
    return sentences


def describe_remarks(recordings: Sequence[Recording]) -> list[str]:
    """Sentences about recordings that say nothing wrong: kind, steps of the clock."""
    names = distinct_names([recording.path for recording in recordings])
    return [
        f"{name}: {remark}"
        for name, recording in zip(names, recordings, strict=True)
        for remark in recording.report.remarks
    ]


def no_frame_error(
    recordings: Sequence[Recording], what: str = "it has no frames"
) -> RecordingError:
    """Error for recordings without a frame, with what was passed over: the file may be cut.

    Args:
        recordings: Recordings that were read to their end.
        what: What is missing.

    """
    where = ", ".join(str(recording.path) for recording in recordings)
    return RecordingError(where, "; ".join([what, *describe_problems(recordings)]), NO_FRAME_FIX)
