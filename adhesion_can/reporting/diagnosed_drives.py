"""Recordings of a diagnosis over time: a figure and a table of signals each."""

from collections.abc import Mapping
from itertools import islice

from adhesion_can.config import Configuration
from adhesion_can.diagnosis.result import Diagnosis
from adhesion_can.reporting.drive.signal_panels import signal_panels, signal_table
from adhesion_can.reporting.page import Part, Text
from adhesion_can.reporting.time_panels import panels_figure
from adhesion_can.result_text import TimeScale
from adhesion_can.sampling.drive_signals import MOST_SPANS, DriveSignals

MOST_DRIVES = 4
"""Number of recordings that are drawn, the first ones."""


def recording_times(diagnosis: Diagnosis, recording: str) -> TimeScale:
    """Scale of the times of a recording; from 0 on its clock where no first reading is known."""
    return TimeScale.beginning_at(diagnosis.begins.get(recording, 0))


def spans_of_a_drive(drives: int) -> int:
    """Number of spans to which each of so many recordings is thinned, so that a page stays small.

    Args:
        drives: Number of recordings, at least one.

    """
    return MOST_SPANS // min(drives, MOST_DRIVES)


def drive_parts(
    drives: Mapping[str, DriveSignals], config: Configuration, diagnosis: Diagnosis
) -> list[Part]:
    """Parts of a page with the signals of recordings.

    Args:
        drives: Signals by the name of their recording.
        config: Configuration of the diagnosis.
        diagnosis: Result of the diagnosis, for the times.

    """
    parts: list[Part] = []
    for number, (name, signals) in enumerate(islice(drives.items(), MOST_DRIVES), start=1):
        shown = signal_panels(signals, config, recording_times(diagnosis, name).zero_us)
        if shown.panels:
            caption = f"{name}. {shown.caption}"
            parts.append(panels_figure(caption, shown.panels, "time, s", f"drive-{number}"))
        parts.append(signal_table(signals, config, name))
    if len(drives) > MOST_DRIVES:
        parts.append(Text(f"Drawn: the first {MOST_DRIVES} of {len(drives)} recordings."))
    return parts
