"""Files of columns for the tools that people use: CSV, Parquet and MF4.

A file appears whole or not at all, and takes the same memory however long it gets.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.errors import InputError
from adhesion_can.reporting.export.layout import Column, Field, Group, Raw, Rows, Sink, SinkOpener

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


class _Format(NamedTuple):
    """Module of this package that writes a format.

    Attributes:
        module: Name of the module; its function `open_sink` is a `SinkOpener`.
        extra: Extra of the package that the module needs; '' for none.
        library: Library behind the extra.

    """

    module: str
    extra: str = ""
    library: str = ""


_FORMATS: Mapping[str, _Format] = {
    ".csv": _Format("csv_file"),
    ".csv.gz": _Format("csv_file"),
    ".parquet": _Format("parquet_file", "parquet", "pyarrow"),
    ".mf4": _Format("mf4_file", "mf4", "asammdf"),
}
"""Formats by the suffix of the file."""

SUFFIXES = tuple(_FORMATS)
"""Suffixes of the formats that are written."""


class Writer:
    """Writes rows as they come; a group begins with its first rows."""

    def __init__(self, path: Path, sink: Sink) -> None:
        self._path = path
        self._sink = sink

    def begin(self, t_ns: int) -> None:
        """Set the begin of the recording, ns, from which the time of MF4 counts.

        So files with different rows of one recording have one time base. To be called before the
        first rows; without it, time counts from the first row.
        """
        self._sink.begin(t_ns)

    def write(self, rows: Sequence[Rows]) -> None:
        """Append rows; `Rows.position` is their order."""
        with _input_errors(self._path):
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
    with _input_errors(path):
        if path.is_dir():
            raise InputError(f"{option} {path}", "is a folder", "name a file")
    _load_module(suffix, path)


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
        InputError: The format is unknown, an extra is missing, or the disk is full.

    """
    sink = _begin(path, origin)
    with _closed(path, sink):
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
        InputError: The format is unknown, an extra is missing, or the disk is full.

    """
    group = Group(name, tuple(fields))
    sink = _begin(path, origin, (group,), decimals)
    with _closed(path, sink):
        yield TableWriter(Writer(path, sink), group)


def _begin(
    path: Path, origin: Mapping[str, str], groups: Sequence[Group] = (), decimals: int = 9
) -> Sink:
    """Begin a file in the format of its suffix; known groups make it a plain table."""
    require_format(path, "output")
    open_sink: SinkOpener = _load_module(_suffix(path) or "", path).open_sink
    with _input_errors(path):
        return open_sink(path, origin, groups, decimals)


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
    except OSError as error:
        raise InputError(
            str(path),
            error.strerror or " ".join(str(error).split()) or "cannot be written",
            "name a folder that can be written to and has room",
        ) from error


def _suffix(path: Path) -> str | None:
    """Suffix of the file's format; None where the format is unknown."""
    name = path.name.lower()
    return next((suffix for suffix in SUFFIXES if name.endswith(suffix)), None)


def _load_module(suffix: str, path: Path) -> ModuleType:
    """Module that writes a format, imported where it is used, since it may need an extra."""
    form = _FORMATS[suffix]
    try:
        return import_module(f"{__name__}.{form.module}")
    except ImportError as error:
        if not form.extra:
            raise
        raise InputError(
            str(path),
            f"this format needs {form.library}",
            f"pip install 'adhesion-can[{form.extra}]'",
        ) from error
