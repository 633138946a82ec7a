"""What the data of some drives do not allow to say, whatever the effect."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from adhesion_can.diagnosis.drive.drive_data import DriveData, observed_column
from adhesion_can.diagnosis.evidence import Untested
from adhesion_can.diagnosis.inference.candidates import COASTING

LEAST_ROWS, LEAST_BLOCKS = 400, 9
"""Rows that decide, and blocks of time, without which there is no diagnosis."""
LEAST_POINTS = 60
"""Independent points that decide, without which there is no diagnosis."""
NOTICED = 10.0
"""Increase of twice the log likelihood by one parameter from which it is hardly chance."""
LEAST_RANGE = 0.004
"""Range of |λ| (5 to 95 % of the rows) below which there is no curve in the data."""
LEAST_ADHESION = 0.01
"""Range of |μ| (5 to 95 % of the rows) below which there is no curve in the data."""


def describe_insufficient_data(drives: Sequence[DriveData], block: NDArray[np.int64]) -> str:
    """Why the data carry no verdict at all; '' where they do.

    Args:
        drives: Rows of the recordings, one row at least.
        block: Number of each row's block, negative for a row that is held out; shape (n,).

    """
    points = all(drive.independent for drive in drives)
    decide, hold = np.count_nonzero(block >= 0), np.count_nonzero(block < 0)
    enough = LEAST_POINTS if points else LEAST_ROWS
    for count, fewest, what in (
        (decide, enough, "to decide on"),
        (hold, enough // 4, "to hold out"),
    ):
        # Of independent points each one is held out in turn where no other data are.
        if count < fewest and not (points and what == "to hold out" and not hold):
            return f"{count} usable rows {what}: at least {fewest} are needed"
    blocks = len(np.unique(block))
    if blocks < LEAST_BLOCKS:
        return (
            f"the usable part of the drive is too short: {blocks} blocks of time; at least "
            f"{LEAST_BLOCKS} are needed to hold out a part"
        )
    for name, least in (("slip", LEAST_RANGE), ("adhesion", LEAST_ADHESION)):
        size = np.abs(observed_column(drives, name))
        low, high = map(float, np.quantile(size, [0.05, 0.95]))
        if high - low < least:
            return (
                f"the {name} hardly varies ({low:.4f} to {high:.4f}); a curve needs creep swept "
                "from near 0 to beyond its peak"
            )
    return ""


def find_untestable(drives: Sequence[DriveData]) -> list[Untested]:
    """Quantities beside the effects that these drives do not identify, with the reason."""
    untestable = []
    for drive in drives:
        if drive.independent:
            untestable.append(_describe_size(drive))
        if drive.table:
            continue
        idle = np.abs(drive.observe().adhesion) < COASTING
        if not _coasts(idle, drive):
            untestable.append(
                Untested(
                    f"wheel against ground speed in {drive.name}",
                    "no axle coasts for a second, so errors of speed and radius and a bias of "
                    "effort are identified from the curve alone",
                )
            )
        untestable += [
            Untested(f"axle {axle} in {drive.name}", "it has no usable row")
            for axle in range(1, len(drive.radius) + 1)
            if not (drive.axle == axle).any()
        ]
    return untestable


def _describe_size(drive: DriveData) -> Untested:
    """What the size of a table of independent points does not allow to see."""
    rows = len(drive)
    return Untested(
        f"differences in {drive.name} of less than about {50.0 * NOTICED / rows:.1f} % of the RMSE",
        f"{rows} points, treated as independent, cannot distinguish them from chance",
    )


def _coasts(idle: np.ndarray, drive: DriveData) -> bool:
    """Whether a fifth of the rows of some second of an axle coast: noise alone does not do that."""
    second = np.floor(drive.t_s).astype(np.int64) + 100_000 * drive.axle
    numbers, inverse = np.unique(second, return_inverse=True)
    share = np.bincount(inverse, idle) / np.maximum(np.bincount(inverse), 1)
    return bool(len(numbers) and share.max() > 0.2)
