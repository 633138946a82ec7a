"""Signals of a recording over time, for the page of its diagnosis."""

import numpy as np

from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.offline.load_traces import LoadedTraces
from adhesion_can.sampling.drive_signals import SLIP, DriveSignals


def thin_signals(received: LoadedTraces, drive: DriveData, spans: int) -> DriveSignals:
    """Readings of a recording, and the slips of its rows, over time.

    Args:
        received: Traces of all its signals.
        drive: Drive data of the recording.
        spans: Number of spans to which they are thinned.

    """
    signals = DriveSignals(spans)
    for key, parts in received.columns.items():
        for part in parts:
            signals.add({key: part})
    slip = drive.observe().slip
    t_us = drive.first_us + np.rint(1e6 * drive.t_s).astype(np.int64)
    for axle in np.unique(drive.axle).tolist():
        axle_rows = drive.axle == axle
        signals.add({(SLIP, axle): (t_us[axle_rows], slip[axle_rows])})
    return signals
