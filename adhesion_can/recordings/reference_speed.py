"""A vehicle speed that another recorder wrote, as CSV on the recording's clock."""

import csv
from itertools import pairwise
from math import isfinite
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.bus.role_specs import ROLE_SPECS, known_units
from adhesion_can.bus.units import find_factor
from adhesion_can.errors import TableError
from adhesion_can.physics.readings import Role
from adhesion_can.recordings.tables.headings import find_column, name_columns
from adhesion_can.recordings.tables.times import TIME_LIMIT_S


def reference_path(option: str) -> tuple[Path, str | None]:
    """Path and column of --speed; a colon may be a part of the path."""
    path, colon, column = option.rpartition(":")
    if colon and column and not Path(option).exists():
        return Path(path), column
    return Path(option), None


def read_reference(option: str) -> tuple[NDArray[np.int64], Array]:
    """Vehicle speed of another recorder.

    Args:
        option: Path of a CSV file with `time_s` and speeds, in m/s unless the heading states
            another unit, as in 'v [km/h]'; behind a colon the name of the column where there are
            several, with or without its unit.

    Returns:
        Time stamps, µs, and speeds, m/s, NaN where a cell is empty; shape (n,) each.

    Raises:
        TableError: The file cannot be read, or its columns, numbers or times are wrong.

    """
    path, column = reference_path(option)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.reader(file, strict=True))
    except OSError as error:
        raise TableError(str(path), error.strerror or "cannot be read", "check the path") from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise TableError(str(path), f"not CSV ({error})", "check the file") from error
    named = name_columns(rows[0] if rows else [])
    header, units = [name for name, _ in named], dict(named)
    others = [name for name in header if name and name != "time_s"]
    if "time_s" not in header or not others:
        raise TableError(
            str(path), "needs the columns time_s and a speed in m/s", "write a header line"
        )
    if column is None and len(others) > 1:
        raise TableError(
            str(path), f"more than one column ({', '.join(others)})", f"write {path}:COLUMN"
        )
    name = find_column(column or others[0], others, units, str(path))
    factor = find_factor(ROLE_SPECS[Role.VEHICLE_SPEED].units, units[name] or "m/s")
    if factor is None:
        fix = f"write one of {known_units(Role.VEHICLE_SPEED)}"
        raise TableError(str(path), f"{name!r} has the unknown unit {units[name]!r}", fix)
    places = header.index("time_s"), header.index(name)
    values = [
        _numbers(row, places, f"{path}:{line}")
        for line, row in enumerate(rows[1:], start=2)
        if any(cell.strip() for cell in row)
    ]
    if not any(isfinite(speed) for _, speed in values):
        raise TableError(str(path), f"{name!r} has no numbers", "check the column")
    if any(after < before for (before, _), (after, _) in pairwise(values)):
        raise TableError(str(path), "its times run backwards", "sort it by time_s")
    time_s, speed = np.array(values).T
    return np.round(time_s * 1e6).astype(np.int64), factor * speed


def _numbers(row: list[str], places: tuple[int, int], where: str) -> tuple[float, float]:
    """Time and speed of a row; an empty speed is not available."""
    try:
        time_s, speed = (float(row[place].strip() or "nan") for place in places)
    except (IndexError, ValueError) as error:
        raise TableError(where, "not numbers under the header", "correct the line") from error
    if not abs(time_s) < TIME_LIMIT_S:
        raise TableError(where, f"{time_s} is not a time", "correct the line")
    return time_s, speed if isfinite(speed) else np.nan
