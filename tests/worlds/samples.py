"""A drive's readings as a table of samples, a row for each axle."""

from pathlib import Path

import numpy as np

from tests.worlds.plant import Readings, View

COLUMNS = (
    "time_s", "slip", "adhesion", "normal_load_N", "speed_mps", "axle",
    "humidity", "rail_temperature", "curvature", "sanding",
)  # fmt: skip
EVERY = 5
"""Rows of 10 ms from sample to sample."""


def write_samples(readings: Readings, plain: View, path: Path) -> None:
    """Write what a program of someone else's would make of the readings: CSV, 20 rows a second.

    Args:
        readings: of the bus.
        plain: Samples of the readings under no effect.
        path: of the table.

    """
    rows = np.flatnonzero(plain.use)[::EVERY]
    axles = plain.slip_std.shape[1]
    slow = [
        values[np.minimum(rows // cycle, len(values) - 1)]
        for values, cycle in (
            (readings.humidity, 100),
            (readings.rail_temperature, 100),
            (readings.curvature, 20),
            (readings.sanding, 100),
        )
    ]
    contact = plain.contact
    own = [contact.slip[rows], plain.adhesion[rows], contact.load[rows]]
    table = np.stack([
        np.repeat(plain.t[rows], axles), *(values.ravel() for values in own),
        np.repeat(contact.speed[rows], axles), np.tile(np.arange(1, axles + 1), len(rows)),
        *(np.repeat(values, axles) for values in slow),
    ], axis=1)  # fmt: skip
    np.savetxt(path, table, fmt="%.7g", delimiter=",", header=",".join(COLUMNS), comments="")
