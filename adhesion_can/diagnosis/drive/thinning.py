"""Thinning of long drives to a lower rate: more rows cost time and add little information."""

from collections.abc import Sequence

import numpy as np

from adhesion_can.diagnosis.drive.drive_data import DriveData

MANY_ROWS = 40_000
"""A drive with more rows is thinned."""

RATE_HZ = 16.0
"""Rows per second and axle that are used for deciding and for an evaluation."""


def thin_drives(drives: Sequence[DriveData], rate_hz: float = RATE_HZ) -> tuple[DriveData, ...]:
    """Rows of drives at a lower rate, the same for all recordings where one of them is long.

    The noise of rows that follow each other has one memory, in rows, for all of them.

    Args:
        drives: Drive data of each recording.
        rate_hz: Rows per second and axle.

    """
    if not any(len(drive) > MANY_ROWS for drive in drives if not drive.table):
        return tuple(drives)
    return tuple(thin_drive(drive, rate_hz) for drive in drives)


def thin_drive(drive: DriveData, rate_hz: float = RATE_HZ) -> DriveData:
    """Rows of a drive at a lower rate, axle by axle; a sample table keeps all its rows.

    Args:
        drive: Drive data of a recording.
        rate_hz: Rows per second and axle.

    """
    if drive.table:
        return drive
    kept = np.zeros(len(drive), dtype=np.bool_)
    for axle in np.unique(drive.axle):
        rows = np.flatnonzero(drive.axle == axle)
        cycle = float(np.median(np.diff(drive.t_s[rows]))) if len(rows) > 1 else 1.0
        kept[rows[:: max(round(1.0 / (rate_hz * cycle)), 1)]] = True
    return drive.select_rows(kept)
