"""Files of columns for the tools that people use: CSV, Parquet, Arrow, MF4 and MCAP.

A file appears whole or not at all, and takes the same memory however long it gets.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adhesion_can.errors import InputError
from adhesion_can.reporting.export.layout import Field, FieldColumn, Frames, Group, GroupRows, Sink
from adhesion_can.reporting.export.target import (
    TABLE_SUFFIXES,
    Target,
    file_target,
    require_format,
)

TIME_DECIMALS = 6
"""Number of decimals of `time_s` in CSV."""
WriteRows = Callable[[NDArray[np.int64], Sequence[FieldColumn]], None]
"""Function that appends rows to a table: time stamps, ns, shape (n,), and the column of each field,
shape (n,) each."""


class Writer:
    """Writes rows as they come; a group starts with its first rows."""

    def __init__(self, path: Path, sink: Sink) -> None:
        self._path = path
        self._sink = sink

    def begin(self, t_ns: int) -> None:
        """Set the start of the recording, ns, from which the time of MF4 counts.

        So files with different rows of one recording have one time base. To be called before the
        first rows; without it, time counts from the first row.
        """
        self._sink.begin(t_ns)

    def write(self, rows: Sequence[GroupRows], frames: Frames | None = None) -> None:
        """Append rows, as `Sink.write` defines it."""
        with _input_errors(self._path):
            self._sink.write(rows, frames)

    def problems(self) -> list[str]:
        """Sentences about what the file does not hold exactly; also after it was closed."""
        return self._sink.problems()


@contextmanager
def open_recording(target: Target, origin: Mapping[str, str]) -> Iterator[Writer]:
    """A file or folder for the rows of many messages.

    CSV and Parquet: a row a frame in their order, columns `time_s`, `message` and 'Message.Signal'
    for each. MF4 and MCAP: a channel group or channel a message. Arrow: a row for each value. A
    folder: a file a message.

    Args:
        target: File, folder or stdout.
        origin: Version, inputs and the like, by name; CSV has no place for them.

    Raises:
        InputError: An extra is missing, or the disk is full.

    """
    module = target.load_module()
    with _input_errors(target.path):
        if target.is_folder:
            sink: Sink = module.open_folder(target.path, target.suffix, origin, **target.settings)
        else:
            sink = module.open_sink(target.path, origin, (), 9, **target.settings)
    with _closed(target.path, sink):
        yield Writer(target.path, sink)


@contextmanager
def open_table(
    path: Path,
    fields: Sequence[Field],
    origin: Mapping[str, str],
    *,
    name: str = "table",
    keep_formulas: bool = False,
) -> Iterator[WriteRows]:
    """A file for the rows of one table: `time_s`, then its fields; gives what appends rows.

    The time of MF4 counts from the first row; that of CSV has `TIME_DECIMALS`.

    Args:
        path: Path of the file; its suffix selects the format.
        fields: Fields of the table beside the time.
        origin: Version, inputs and the like, by name; CSV has no place for them.
        name: Name of the table, where the format has one.
        keep_formulas: Whether CSV has names as they are even where a spreadsheet computes them.

    Raises:
        InputError: The format is unknown, an extra is missing, or the disk is full.

    """
    require_format(path, "output")
    group = Group(name, tuple(fields))
    target = replace(file_target(path, "output", TABLE_SUFFIXES), keep_formulas=keep_formulas)
    with _input_errors(path):
        sink: Sink = target.load_module().open_sink(
            path, origin, (group,), TIME_DECIMALS, **target.settings
        )
    with _closed(path, sink):
        writer = Writer(path, sink)
        yield lambda t_ns, columns: writer.write(
            [GroupRows(group, np.arange(len(t_ns)), t_ns, columns)]
        )


@contextmanager
def _closed(path: Path, sink: Sink) -> Iterator[None]:
    """Close the file once all is written; delete it after an error."""
    try:
        yield
        with _input_errors(path):
            sink.close()
    except BaseException:
        sink.abandon()
        raise


@contextmanager
def _input_errors(path: Path) -> Iterator[None]:
    """Turn errors of the file system into InputErrors."""
    try:
        yield
    except BrokenPipeError:
        raise  # who read from the pipe has gone
    except OSError as error:
        raise InputError(
            str(path),
            error.strerror or " ".join(str(error).split()) or "cannot be written",
            "name a writable folder with free space",
        ) from error
