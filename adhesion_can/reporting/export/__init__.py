"""Files of columns for the tools that people use: CSV, Parquet and MF4.

A file appears whole or not at all, and takes the same memory however long it gets.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from adhesion_can.errors import InputError
from adhesion_can.reporting.export import csv_file
from adhesion_can.reporting.export.layout import Column, Field, Group, Raw, Rows, Sink

__all__ = [
    "SUFFIXES",
    "Column",
    "Field",
    "Group",
    "Raw",
    "Rows",
    "TableWriter",
    "Writer",
    "open_recording",
    "open_table",
    "require_format",
]

SUFFIXES = (".csv", ".csv.gz", ".parquet", ".mf4")

_EXTRAS = {".parquet": ("parquet", "pyarrow"), ".mf4": ("mf4", "asammdf")}


class Writer:
    """Writes rows as they come; a group begins with its first rows."""

    def __init__(self, path: Path, sink: Sink) -> None:
        self._path = path
        self._sink = sink

    def begin(self, t_ns: int) -> None:
        """Set the begin of the recording, ns: the time of MF4 counts from there.

        Files of one recording that hold other rows lie over each other then. To be called before
        the first rows; without it, time counts from the first row.
        """
        self._sink.begin(t_ns)

    def write(self, rows: Sequence[Rows]) -> None:
        """Append rows; `Rows.place` is their order."""
        with _told(self._path):
            self._sink.write(rows)


class TableWriter:
    """Writes the rows of one table."""

    def __init__(self, writer: Writer, group: Group) -> None:
        self._writer = writer
        self._group = group

    def write(self, t_ns: NDArray[np.int64], columns: Sequence[Column]) -> None:
        """Append rows.

        Args:
            t_ns: Time stamps, ns, shape (n,).
            columns: Column of each field, shape (n,) each.

        """
        self._writer.write([Rows(self._group, np.arange(len(t_ns)), t_ns, columns)])


def require_format(path: Path, option: str) -> None:
    """Raise an InputError where a file's format is unknown or its extra is not installed.

    Args:
        path: Path of the file to write.
        option: Option of the command line that names the file.

    """
    suffix = _suffix(path)
    if suffix is None:
        raise InputError(
            f"{option} {path}", "of no known format", f"give a name in {', '.join(SUFFIXES)}"
        )
    with _told(path):
        if path.is_dir():
            raise InputError(f"{option} {path}", "is a folder", "name a file")
    if suffix in _EXTRAS:
        _module(suffix, path)


@contextmanager
def open_recording(path: Path, origin: Mapping[str, str]) -> Iterator[Writer]:
    """A file for the rows of many messages.

    CSV and Parquet: a row a frame in their order, columns `time_s`, `message` and 'Message.Signal'
    for each. MF4: a channel group a message, its rows in the order of their stamps as far as they
    are written at once.

    Args:
        path: Path of the file; its suffix selects the format.
        origin: Version, inputs and the like, by name; CSV has no place for them.

    Raises:
        InputError: no known format, an extra that is missing, or a disk that is full.

    """
    sink = _begin(path, origin)
    with _whole(path, sink):
        yield Writer(path, sink)


@contextmanager
def open_table(
    path: Path,
    fields: Sequence[Field],
    origin: Mapping[str, str],
    *,
    name: str = "table",
    decimals: int = 6,
) -> Iterator[TableWriter]:
    """A file for the rows of one table: `time_s`, then its fields.

    The time of MF4 counts from the first row.

    Args:
        path: Path of the file; its suffix selects the format.
        fields: Fields of the table beside the time.
        origin: Version, inputs and the like, by name; CSV has no place for them.
        name: Name of the table, where the format has one.
        decimals: Number of decimals of `time_s` in CSV.

    Raises:
        InputError: no known format, an extra that is missing, or a disk that is full.

    """
    group = Group(name, tuple(fields))
    sink = _begin(path, origin, (group,), decimals)
    with _whole(path, sink):
        yield TableWriter(Writer(path, sink), group)


def _begin(
    path: Path, origin: Mapping[str, str], groups: Sequence[Group] = (), decimals: int = 9
) -> Sink:
    """Begin a file in the format of its suffix; known groups make it a plain table."""
    require_format(path, "output")
    suffix = _suffix(path)
    sink: Sink
    with _told(path):
        if suffix == ".mf4":
            sink = _module(suffix, path).Mf4File(path, origin, groups)
        elif suffix == ".parquet":
            sink = _module(suffix, path).open_sheet(path, origin, groups)
        else:
            sink = csv_file.open_sheet(path, groups, decimals)
    return sink


@contextmanager
def _whole(path: Path, sink: Sink) -> Iterator[None]:
    try:
        yield
        with _told(path):
            sink.close()
    except BaseException:
        sink.abandon()
        raise


@contextmanager
def _told(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(
            str(path),
            error.strerror or " ".join(str(error).split()) or "cannot be written",
            "name a folder that can be written to and has room",
        ) from error


def _suffix(path: Path) -> str | None:
    """Suffix of a known format; None: of none."""
    name = path.name.lower()
    return next((suffix for suffix in SUFFIXES if name.endswith(suffix)), None)


def _module(suffix: str, path: Path) -> ModuleType:
    """The module that writes a format, which is imported where it is used: it needs an extra."""
    extra, library = _EXTRAS[suffix]
    try:
        return import_module(f"{__name__}.{extra}_file")
    except ImportError as error:
        raise InputError(
            str(path), f"this format needs {library}", f"pip install 'adhesion-can[{extra}]'"
        ) from error
