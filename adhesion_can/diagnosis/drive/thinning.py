"""Thinning of long drives to a lower rate: more rows cost time and add little information."""

import numpy as np

from adhesion_can.diagnosis.drive.drive_data import DriveData

MANY_ROWS = 40_000
"""A drive with more rows is thinned."""


RATE_HZ = 16.0
"""Rows per second and axle that are used for deciding and for an evaluation."""


def thin_drive(drive: DriveData, rate_hz: float = RATE_HZ) -> DriveData:
    """Rows of a long drive at a lower rate, axle by axle; a sample table keeps all its rows.

    Args:
        drive: Drive data of a recording.
        rate_hz: Rows per second and axle.

    """
    if len(drive) <= MANY_ROWS or drive.table:
        return drive
    kept = np.zeros(len(drive), dtype=np.bool_)
    for axle in np.unique(drive.axle):
        rows = np.flatnonzero(drive.axle == axle)
        cycle = float(np.median(np.diff(drive.t_s[rows]))) if len(rows) > 1 else 1.0
        kept[rows[:: max(round(1.0 / (rate_hz * cycle)), 1)]] = True
    return drive.select_rows(kept)
