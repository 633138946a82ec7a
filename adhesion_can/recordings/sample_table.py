"""Tables of samples: CSV (gzip too) or Parquet, one row a sample.

Columns: `time_s`, `slip`, and `adhesion` or both `longitudinal_force_N` and `normal_load_N`;
optional `speed_mps`, `axle`, `segment`; every other numeric column is a covariate by its name.
Without `time_s` the rows are independent points and all have the stamp 0.
"""

import csv
import gzip
import io
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.errors import TableError
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.candump_columns.text_source import Packing

FORCE, LOAD = "longitudinal_force_N", "normal_load_N"
TIME_LIMIT_S = 9e9
"""Limit of a time, s: beyond it, 285 years, stamps do not fit 64 bits as ns."""
_KNOWN = frozenset({"time_s", "slip", "adhesion", FORCE, LOAD, "speed_mps", "axle", "segment"})


@dataclass(frozen=True)
class Table:
    """Samples of a table, with its segments and statistics.

    Attributes:
        samples: Rows whose slip, adhesion and time are finite.
        segment: Number of the segment of each sample, shape (n,); None where the table has none.
        rows: Number of rows of the file.
        left_out: Number of rows without a finite slip, adhesion or time.
        ignored: Names of the columns that are not numeric.
        timed: Whether the table has the column `time_s`.

    """

    samples: Samples
    segment: NDArray[np.int64] | None
    rows: int
    left_out: int
    ignored: tuple[str, ...]
    timed: bool = True


def is_table(path: Path) -> bool:
    """Whether a file is a sample table rather than a recording.

    Raises:
        TableError: The file is a .csv with the columns of neither.

    """
    suffixes = [suffix.lower() for suffix in path.suffixes if suffix.lower() != ".gz"]
    if not suffixes or suffixes[-1] == ".parquet":
        return bool(suffixes)
    if suffixes[-1] != ".csv":
        return False
    try:
        header = {name.strip() for name in next(csv.reader([_first_line(path)], strict=True), [])}
    except csv.Error as error:
        raise TableError(f"{path}:1", f"not CSV ({error})", "mend the line") from error
    if "slip" in header:
        return True
    if "arbitration_id" in header:
        return False
    raise TableError(
        str(path),
        "a .csv with neither a 'slip' column (a table) nor 'arbitration_id' (a recording)",
        "name the column of the slip ratio 'slip'",
    )


def read_table(path: Path) -> Table:
    """Read a sample table.

    Raises:
        TableError: The file cannot be read, or lacks a required column.

    """
    columns = _parquet(path) if path.suffix.lower() == ".parquet" else _csv(path)
    numeric = {name: column for name, column in columns.items() if column is not None}
    if "slip" not in columns:
        raise TableError(str(path), "no column 'slip'", "add it, or rename the one that is it")
    timed = "time_s" in columns
    if not timed:
        stamps = np.zeros_like(numeric.get("slip", np.empty(0)))
        columns["time_s"] = numeric["time_s"] = stamps
    by_force = FORCE in columns and LOAD in columns
    if "adhesion" not in columns and not by_force:
        raise TableError(
            str(path), "no column 'adhesion'", f"add it, or both {FORCE!r} and {LOAD!r}"
        )
    needed = ("time_s", "slip", *(("adhesion",) if "adhesion" in columns else (FORCE, LOAD)))
    for name in needed:
        if name not in numeric:
            raise TableError(str(path), f"column {name!r} is not numeric", "write numbers in it")
    ignored = tuple(n for n, c in columns.items() if c is None)
    return replace(_table(path, numeric, ignored), timed=timed)


def _table(path: Path, columns: Mapping[str, Array], ignored: tuple[str, ...]) -> Table:
    time_s, slip = columns["time_s"], columns["slip"]
    ones = np.ones_like(slip)
    load = columns.get(LOAD, ones)
    if "adhesion" in columns:
        adhesion = columns["adhesion"]
    else:
        force = columns[FORCE]
        adhesion = np.divide(force, load, out=np.full_like(slip, np.nan), where=load > 0)
    speed = columns.get("speed_mps", ones)
    good = np.isfinite(time_s) & np.isfinite(slip) & np.isfinite(adhesion)
    good &= np.abs(np.where(good, time_s, 0.0)) < TIME_LIMIT_S
    if not good.any():
        raise TableError(
            str(path), "no row has a finite time, slip and adhesion", "check the units"
        )
    axle = columns.get("axle", 0 * ones)[good]
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
        slip_var=0 * ones[good],
        adhesion_var=0 * ones[good],
        slip_common_var=0 * ones[good],
        speed_us=t_us,
        transient_var=0 * ones[good],
        speed_share=ones[good],
        covariates={n: c[good] for n, c in columns.items() if n not in _KNOWN},
    )
    segment = columns.get("segment")
    return Table(
        samples,
        None if segment is None else np.unique(segment[good], return_inverse=True)[1],
        rows=len(slip),
        left_out=int(len(slip) - good.sum()),
        ignored=ignored,
    )


def _read(path: Path) -> bytes:
    try:
        content = path.read_bytes()
        is_gzip = Packing.from_head(content) is Packing.GZIP
        return gzip.decompress(content) if is_gzip else content
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise TableError(
            str(path), f"the gzip file is damaged ({error})", "compress it again"
        ) from error
    except OSError as error:
        raise TableError(str(path), error.strerror or "cannot be read", "check the path") from error


def _first_line(path: Path) -> str:
    return _read(path).split(b"\n", 1)[0].decode("utf-8-sig", "replace")


def _csv(path: Path) -> dict[str, Array | None]:
    rows = csv.reader(io.StringIO(_read(path).decode("utf-8-sig", "replace"), newline=""))
    try:
        header = [name.strip() for name in next(rows, [])]
        if not header:
            raise TableError(str(path), "empty", "write a header line and rows below it")
        body = []
        for row in rows:
            if not any(cell.strip() for cell in row):
                continue
            if len(row) != len(header):
                raise TableError(
                    f"{path}:{rows.line_num}",
                    f"{len(row)} fields under {len(header)} columns",
                    "mend the row",
                )
            body.append(row)
    except csv.Error as error:
        raise TableError(
            f"{path}:{rows.line_num}", f"not CSV ({error})", "mend the line"
        ) from error
    if not body:
        raise TableError(str(path), "has a header and no rows", "write one row a sample")
    return {name: _numbers([row[i] for row in body]) for i, name in enumerate(header) if name}


def _numbers(cells: list[str]) -> Array | None:
    """A column as numbers; an empty cell is NaN; None where a cell is something else."""
    try:
        return np.array([float(cell) if cell.strip() else np.nan for cell in cells])
    except ValueError:
        return None


def _parquet(path: Path) -> dict[str, Array | None]:
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError as error:
        raise TableError(
            str(path), "Parquet needs pyarrow", "pip install 'adhesion-can[parquet]'"
        ) from error
    try:
        table = parquet.read_table(path)
    except (OSError, pa.ArrowException) as error:
        reason = " ".join(str(error).split())[:150]
        raise TableError(
            str(path), f"not readable as Parquet ({reason})", "check the file"
        ) from error
    kinds = pa.types
    columns: dict[str, Array | None] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        numeric = any(
            is_a(column.type) for is_a in (kinds.is_integer, kinds.is_floating, kinds.is_boolean)
        )
        values = column.to_pylist() if numeric else []
        columns[name] = (
            np.array([np.nan if v is None else float(v) for v in values]) if numeric else None
        )
    return columns
