"""Columns of a measurement file, MDF 4 (extra 'mf4'): the channel group that holds the slip."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from adhesion_can.errors import TableError
from adhesion_can.extras import install_extra
from adhesion_can.recordings.limited import LimitError, read_limited
from adhesion_can.recordings.limited_work import Limits
from adhesion_can.recordings.mf4 import open_mf4
from adhesion_can.recordings.tables.columns import Column, Columns

FIX = "write it again with the tool that made it, or export it as .csv or .parquet"


def holds_channel(path: Path, name: str) -> bool:
    """Whether a file holds a channel of that name, so that it is a table and no recording.

    A file that cannot be opened, or that needs a package which is missing, is for the reader of
    recordings to refuse.

    Raises:
        TableError: Looking for it takes more than the limits allow.

    """
    try:
        return any(read_limited(partial(_held, path, name), _limits(path), "asammdf"))
    except TableError:
        return False
    except LimitError as error:
        raise TableError(str(path), str(error), FIX) from error


def read_mf4(path: Path, name: str) -> Columns:
    """Channels of the group that holds a channel, with their times as `time_s`.

    Args:
        path: Path of the file.
        name: Name of the channel of the slip ratio.

    Raises:
        TableError: The file cannot be read, asammdf is missing, or several groups hold the channel.

    """
    try:
        (columns,) = read_limited(partial(_columns, path, name), _limits(path), "asammdf")
    except LimitError as error:
        raise TableError(str(path), str(error), FIX) from error
    return columns


def _limits(path: Path) -> Limits:
    try:
        return Limits.of_file(path.stat().st_size)
    except OSError as error:
        raise TableError(str(path), error.strerror or "cannot be read", "check the path") from error


def _held(path: Path, name: str) -> Iterator[bool]:
    with _opened(path) as mdf:
        yield name in mdf


def _columns(path: Path, name: str) -> Iterator[Columns]:
    with _opened(path) as mdf:
        places = mdf.whereis(name)
        if len(places) != 1:
            what = f"{len(places)} channel groups hold {name!r}"
            raise TableError(str(path), what, "export the one that you mean as .csv or .parquet")
        ((group, _),) = places
        master = mdf.masters_db.get(group)
        values: dict[str, Column] = {}
        units: dict[str, str] = {}
        for index, channel in enumerate(mdf.groups[group].channels):
            if index == master:
                continue
            # Else rows whose value is marked as invalid are missing from the column.
            signal = mdf.get(group=group, index=index, ignore_invalidation_bits=True)
            if signal.samples.ndim != 1:
                continue
            values[channel.name] = _column(signal)
            if signal.unit:
                units[channel.name] = signal.unit
        if master is not None:
            values.setdefault("time_s", np.asarray(mdf.get_master(group), dtype=np.float64))
    if len({len(column) for column in values.values()}) > 1:
        what = f"the channels next to {name!r} differ in length"
        raise TableError(str(path), what, FIX)
    yield Columns(values, units, (f"using the {len(values)} channels next to {name!r} as columns",))


def _column(signal: Any) -> Column:
    """Numbers, NaN where marked as invalid; or texts."""
    samples = signal.samples
    if samples.dtype.kind in "fiub":
        numbers = samples.astype(np.float64)
        invalid = signal.invalidation_bits
        if invalid is not None:
            numbers[np.asarray(invalid, dtype=np.bool_)] = np.nan
        return np.asarray(numbers)
    return tuple(
        sample.decode(errors="replace") if isinstance(sample, bytes) else str(sample)
        for sample in samples
    )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    try:
        with closing(open_mf4(path)) as mdf:
            yield mdf
    except (TableError, MemoryError):
        raise
    except ImportError as error:
        fix = install_extra("mf4")
        raise TableError(str(path), "MF4 needs asammdf", fix) from error
    except OSError as error:
        raise TableError(str(path), error.strerror or "cannot be read", "check the path") from error
    except Exception as error:  # asammdf raises whatever its parsers meet
        reason = " ".join(str(error).split())[:150]
        raise TableError(str(path), f"not readable as MF4 ({reason})", "check the file") from error
