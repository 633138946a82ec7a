"""Tables of samples: CSV (gzip too), Parquet, MATLAB or MF4, one row a sample.

Columns: `time_s`, `slip`, and `adhesion` or both `longitudinal_force_N` and `normal_load_N`;
optional `speed_mps`, `axle`, `segment`, `slip_std`, `adhesion_std`, and the position by
`latitude_deg` and `longitude_deg`, which is no covariate. Every other numeric column is one
by its name, and each text of a column of few texts is one as `COLUMN=TEXT`, 1 in its rows
and 0 in the others. Rows stand in the order of their times, whatever order the file has. Without
`time_s` they are independent points and all have the stamp 0.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.errors import TableError
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.formats import FRAME_TABLE, HEAD, format_of, is_measurement
from adhesion_can.recordings.tables.cells import is_float
from adhesion_can.recordings.tables.choice import ColumnChoice, apply_choices
from adhesion_can.recordings.tables.columns import Column, Columns
from adhesion_can.recordings.tables.csv_file import heading_of, read_csv
from adhesion_can.recordings.tables.headings import has_column, resolve_choices
from adhesion_can.recordings.tables.mat_file import read_mat
from adhesion_can.recordings.tables.mf4_table import holds_channel, read_mf4
from adhesion_can.recordings.tables.parquet_file import read_parquet
from adhesion_can.recordings.tables.row_order import sort_rows
from adhesion_can.recordings.tables.shift import shift_columns
from adhesion_can.recordings.tables.text import read_head
from adhesion_can.recordings.tables.times import TIME, TIME_LIMIT_S, with_times

FORCE, LOAD = "longitudinal_force_N", "normal_load_N"
MOST_NEGATIVE, LEAST_NEGATIVE = 0.05, 20
"""Share of negative loads, and number of them, beyond which they are no noise about 0."""
LARGEST, SMALLEST = 1e30, 1e-30
"""Largest and smallest size of a number that anything measures, in whatever unit: the fits' powers
of larger ones overflow."""
MOST_TEXTS, LEAST_TEXT_ROWS = 12, 5
"""Texts of a column that groups the rows, and rows of each of them."""
_OWN = frozenset({"slip_std", "adhesion_std", "residual", "left_out"})
"""Columns of `replay --samples` that say something of a row, and are no channels."""
POSITION = ("latitude_deg", "longitude_deg")
"""Columns of a row's position. A place on the earth is no cause: it would stand for every effect of
a line, and a straight line in a latitude means nothing."""
_KNOWN = (
    _OWN
    | set(POSITION)
    | {"time_s", "slip", "adhesion", FORCE, LOAD, "speed_mps", "axle", "segment"}
)


@dataclass(frozen=True)
class SampleTable:
    """Samples of a table, with its segments and statistics.

    Attributes:
        samples: Rows whose slip, adhesion and time are finite.
        segment: Number of the segment of each sample, shape (n,); None where the table has none.
        rows: Number of rows of the file.
        left_out: Number of rows without a finite slip, adhesion or time.
        ignored: Names of the columns of text that are not used.
        timed: Whether the table has the column `time_s`.
        notes: What was recognised of the file, a sentence each.
        units: Units of the columns that state one.
        unloaded: Number of the rows left out whose load is not above 0.
        position: Latitude and longitude of each sample, °, NaN where it has none; shape (n, 2);
            None where the table lacks one of the columns.

    """

    samples: Samples
    segment: NDArray[np.int64] | None
    rows: int
    left_out: int
    ignored: tuple[str, ...]
    timed: bool = True
    notes: tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    unloaded: int = 0
    position: Array | None = None


def is_table(path: Path, choices: Sequence[ColumnChoice] = ()) -> bool:
    """Whether a file is a sample table rather than a recording.

    Args:
        path: Path of the file.
        choices: Columns that stand for known ones.

    Raises:
        TableError: The file is a .csv with the columns of neither.

    """
    suffix = _kind(path)
    if suffix == ".mf4":
        return holds_channel(path, _slip_column(choices))
    if suffix in (".parquet", ".mat"):
        return True
    try:
        head = read_head(path)
    except TableError:
        if suffix == ".csv":
            raise
        return False  # the reader of recordings says what is wrong
    seen = format_of(head[:HEAD].encode())
    if (suffix != ".csv" and "\0" in head) or seen not in (None, FRAME_TABLE, ".csv"):
        return False
    named = _slip_column(choices)
    heading = heading_of(head, {"slip", named}, path)
    if "slip" in heading or (named != "slip" and has_column(named, heading, heading)):
        return True
    if suffix != ".csv" or seen is not None or "arbitration_id" in heading:
        return False
    resolve_choices([c for c in choices if c.name == "slip"], heading, heading, str(path))
    raise TableError(
        str(path),
        "a .csv with neither a 'slip' column (a table) nor 'arbitration_id' (a recording)",
        "name the column of the slip ratio 'slip', or pass --column slip=ITS_NAME",
    )


def _slip_column(choices: Sequence[ColumnChoice]) -> str:
    """Name of the column of the slip ratio in the file."""
    return next((choice.column for choice in choices if choice.name == "slip"), "slip")


def _kind(path: Path) -> str:
    """Suffix of the format of a file: by its first bytes, or by its name."""
    try:
        with path.open("rb") as file:
            head = file.read(8)
    except OSError:
        return _suffix(path)
    if is_measurement(head):
        return ".mf4"
    return ".parquet" if head.startswith(b"PAR1") else _suffix(path)


def _suffix(path: Path) -> str:
    suffixes = [suffix.lower() for suffix in path.suffixes if suffix.lower() != ".gz"]
    return suffixes[-1] if suffixes else ""


def read_table(path: Path, choices: Sequence[ColumnChoice] = ()) -> SampleTable:
    """Read a sample table.

    Args:
        path: Path of the file.
        choices: Columns that stand for known ones, with their units, signs and delays.

    Raises:
        TableError: The file cannot be read, or lacks a required column.

    """
    readers: dict[str, Callable[[Path], Columns]] = {
        ".parquet": read_parquet,
        ".mat": read_mat,
        ".mf4": partial(read_mf4, name=_slip_column(choices)),
    }
    wanted = {"slip", _slip_column(choices)}
    reader = readers.get(_kind(path), partial(read_csv, wanted=wanted))
    read = reader(path)
    choices = resolve_choices(choices, read.values, read.units, str(path))
    time = next((choice for choice in choices if choice.name == TIME), ColumnChoice(TIME, TIME))
    stated = time.unit is not None or time.column in read.units
    columns = with_times(apply_choices(read, choices, str(path)), str(path), stated=stated)
    columns = sort_rows(columns)
    columns = shift_columns(columns, choices, str(path))
    _require_columns(columns.values, str(path))
    numbers = {
        name: _within_sense(c) for name, c in columns.values.items() if not isinstance(c, tuple)
    }
    texts = {name: c for name, c in columns.values.items() if isinstance(c, tuple)}
    segment = texts.pop("segment", None)
    if segment is not None:
        numbers["segment"] = np.unique(np.array(segment), return_inverse=True)[1].astype(np.float64)
    groups = {name: _groups(name, cells) for name, cells in texts.items() if name not in _OWN}
    for indicators in groups.values():
        numbers |= indicators
    ignored = tuple(name for name, indicators in groups.items() if not indicators)
    return _table(path, columns, numbers, ignored)


def _require_columns(values: Mapping[str, Column], where: str) -> None:
    """TableError where a column that is needed is missing, or is not numeric."""
    if "slip" not in values:
        fix = "add it, rename the column, or pass --column slip=ITS_NAME"
        raise TableError(where, "no column 'slip'", fix)
    by_force = FORCE in values and LOAD in values
    if "adhesion" not in values and not by_force:
        fix = f"add it, or both {FORCE!r} and {LOAD!r}; --column NAME=ITS_NAME maps a column"
        raise TableError(where, "no column 'adhesion'", fix)
    adhesion = ("adhesion",) if "adhesion" in values else (FORCE, LOAD)
    for name in ("time_s", "slip", *adhesion, "speed_mps", "axle"):
        column = values.get(name)
        if isinstance(column, tuple):
            odd = next((cell for cell in column if not is_float(cell)), "")
            what = f"column {name!r} is not numeric: it has {odd[:40]!r}"
            raise TableError(where, what, "write numbers in it")


def _groups(name: str, cells: Sequence[str]) -> dict[str, Array]:
    """Rows of each text of a column, 1 or 0; none where its texts are no groups."""
    texts, number, counts = np.unique(np.array(cells), return_inverse=True, return_counts=True)
    stated = [place for place, text in enumerate(texts) if text]
    large = [place for place in stated if counts[place] >= LEAST_TEXT_ROWS]
    if not 2 <= len(stated) <= MOST_TEXTS or not large:
        return {}
    if len(texts) == 2 and len(large) == 2:
        large = large[1:]  # of two texts the rows of one are those without the other
    return {f"{name}={texts[place]}": (number == place).astype(np.float64) for place in large}


def _table(
    path: Path, columns: Columns, numbers: dict[str, Array], ignored: tuple[str, ...]
) -> SampleTable:
    timed = "time_s" in numbers
    slip = numbers["slip"]
    time_s = numbers.get("time_s", np.zeros_like(slip))
    ones = np.ones_like(slip)
    load = numbers.get(LOAD, ones)
    if "adhesion" in numbers:
        adhesion = numbers["adhesion"]
    else:
        force = numbers[FORCE]
        adhesion = np.divide(force, load, out=np.full_like(slip, np.nan), where=load > 0)
    unloaded = _find_unloaded(numbers, str(path))
    speed = numbers.get("speed_mps", ones)
    good = np.isfinite(time_s) & np.isfinite(slip) & np.isfinite(adhesion)
    good &= np.abs(np.where(good, time_s, 0.0)) < TIME_LIMIT_S
    if not good.any():
        raise TableError(
            str(path), "no row has a finite time, slip and adhesion", "check the units"
        )
    axle = numbers.get("axle", 0 * ones)[good]
    axle = np.where(np.abs(axle) < 1000, axle, 0)  # no axle has such a number
    t_us = np.round(time_s[good] * 1e6).astype(np.int64)
    samples = Samples(
        t_us=t_us,
        axle=axle.astype(np.int64),
        slip=slip[good],
        adhesion=adhesion[good],
        creep_speed=(slip * speed)[good],
        speed=speed[good],
        load=load[good],
        load_std=0 * ones[good],
        slip_var=_variance(numbers, "slip_std", ones)[good],
        adhesion_var=_variance(numbers, "adhesion_std", ones)[good],
        slip_common_var=0 * ones[good],
        speed_us=t_us,
        transient_var=0 * ones[good],
        speed_share=ones[good],
        covariates={name: c[good] for name, c in numbers.items() if name not in _KNOWN},
    )
    segment = numbers.get("segment")
    return SampleTable(
        samples,
        None if segment is None else np.unique(segment[good], return_inverse=True)[1],
        rows=len(slip),
        left_out=int(len(slip) - good.sum()),
        unloaded=int((unloaded & ~good).sum()),
        ignored=ignored,
        timed=timed,
        notes=columns.notes,
        units=columns.units,
        position=_position(numbers, good),
    )


def _within_sense(column: Array) -> Array:
    """Numbers without those that nothing measures, whose squares are beyond all numbers, or 0.

    Beyond `LARGEST` a number is not available, as infinity is; below `SMALLEST` it is 0.
    """
    size = np.abs(column)
    return np.where(size <= LARGEST, np.where(size >= SMALLEST, column, 0.0), np.nan)


def _position(numbers: Mapping[str, Array], good: NDArray[np.bool_]) -> Array | None:
    """Latitude and longitude of the rows that are used, °, shape (n, 2); None: not known.

    A receiver without a fix says 0, 0, or what is on no globe: such a row has none.
    """
    if any(name not in numbers for name in POSITION):
        return None
    position = np.stack([numbers[name][good] for name in POSITION], axis=1)
    wrong = (np.abs(position) > (90.0, 180.0)).any(axis=1) | (position == 0.0).all(axis=1)
    return np.where(wrong[:, None], np.nan, position)


def _find_unloaded(numbers: Mapping[str, Array], where: str) -> NDArray[np.bool_]:
    """Rows with a load that is not above 0, from which no adhesion can be computed; shape (n,).

    Raises:
        TableError: More than a few loads are negative.

    """
    load = numbers.get(LOAD)
    if load is None or "adhesion" in numbers:
        return np.zeros(len(numbers["slip"]), dtype=np.bool_)
    stated = np.isfinite(load)
    below, count = int((load[stated] < 0).sum()), int(stated.sum())
    if below < min(LEAST_NEGATIVE, count) or not count:
        return np.asarray(stated & (load <= 0))
    if below > (1.0 - MOST_NEGATIVE) * count:
        raise TableError(
            where,
            f"{'all' if below == count else f'{below} of {count}'} loads are negative",
            f"if the load is positive upwards, pass --column {LOAD}={LOAD},sign=-1",
        )
    if below > MOST_NEGATIVE * count:
        raise TableError(
            where,
            f"{below} of {count} loads are negative, the others are not",
            "write the vertical force of the wheel on the rail, above 0 in every row",
        )
    return np.asarray(stated & (load <= 0))


def _variance(numbers: Mapping[str, Array], name: str, ones: Array) -> Array:
    """Square of a column of standard deviations; 0 where there is none."""
    return np.square(np.nan_to_num(numbers.get(name, 0.0 * ones)))
