"""Where an export goes: a file by its suffix, a folder, or stdout."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from adhesion_can.errors import InputError
from adhesion_can.extras import install_extra
from adhesion_can.reporting.export.message_folder import listed_files

STDOUT = "-"
"""Name of stdout in place of a file's."""


class _Format(NamedTuple):
    """Module of this package that writes a format.

    Attributes:
        module: Name of the module; its function `open_sink` starts a file. It takes the path of the
            finished file; version, inputs and the like by name; the groups of a plain table, or
            none for a recording, whose messages become known as they are written; and the number of
            decimals of time stamps in s, where they are text.
        extra: Extra of the package that the module needs; '' for none.
        library: Library behind the extra.
        by_channel: Whether the format keeps buses apart.
        table: Whether the format takes a plain table, too.

    """

    module: str
    extra: str = ""
    library: str = ""
    by_channel: bool = False
    table: bool = True


_FORMATS: Mapping[str, _Format] = {
    ".csv": _Format("csv_file"),
    ".csv.gz": _Format("csv_file"),
    ".parquet": _Format("parquet_file", "parquet", "pyarrow"),
    ".mf4": _Format("mf4_file", "mf4", "asammdf"),
    ".mcap": _Format("mcap_file", "mcap", "mcap", by_channel=True, table=False),
    ".arrow": _Format("arrow_long", "parquet", "pyarrow", by_channel=True, table=False),
    ".arrows": _Format("arrow_long", "parquet", "pyarrow", by_channel=True, table=False),
}
"""Formats by the suffix of the file."""

_FOLDERS: Mapping[str, _Format] = {
    ".parquet": _Format("arrow_message", "parquet", "pyarrow", by_channel=True),
    ".arrow": _Format("arrow_message", "parquet", "pyarrow", by_channel=True),
    ".csv": _Format("csv_file", by_channel=True),
}
"""Formats of a folder's files by their suffix; the module's function `open_folder` opens it."""

_OTHER_NAMES = {
    ".feather": ".arrow",
    ".ipc": ".arrow",
    ".pq": ".parquet",
    ".mdf": ".mf4",
    ".mdf4": ".mf4",
    ".bag": ".mcap",
    ".xlsx": ".csv",
    ".xls": ".csv",
}

SUFFIXES = tuple(_FORMATS)
"""Suffixes of the formats that are written."""

TABLE_SUFFIXES = tuple(suffix for suffix, form in _FORMATS.items() if form.table)
"""Suffixes of the formats that take a plain table."""

FOLDER_FORMATS = tuple(suffix.removeprefix(".") for suffix in _FOLDERS)
"""Names of the formats of a folder's files, the usual one first."""


@dataclass(frozen=True)
class Target:
    """Output of an export.

    Attributes:
        path: Path of the file or folder; '-' for stdout.
        suffix: Suffix of the format; of the files in a folder.
        is_folder: Whether it is a folder with a file a message.
        keep_formulas: Whether CSV has names as they are even where a spreadsheet computes them.

    """

    path: Path
    suffix: str
    is_folder: bool = False
    keep_formulas: bool = False

    @property
    def is_stdout(self) -> bool:
        """Whether the export goes to stdout."""
        return not self.is_folder and str(self.path) == STDOUT

    @property
    def by_channel(self) -> bool:
        """Whether the format keeps buses apart."""
        return self._format.by_channel

    @property
    def settings(self) -> Mapping[str, bool]:
        """Settings of the format that are not the usual ones."""
        is_csv = self.suffix.startswith(".csv")
        return {"keep_formulas": True} if is_csv and self.keep_formulas else {}

    @property
    def text_at_once(self) -> int:
        """Number of bytes of text whose frames are best written at once.

        A message's file takes its own columns, and a hundred messages want long ones; a row of one
        table has a cell for each signal of the database.
        """
        return (16 if self.is_folder else 4) << 20

    @property
    def files(self) -> int:
        """Number of files in the folder that the last run wrote."""
        return len(listed_files(self.path))

    @property
    def size(self) -> int | None:
        """Size of the finished file, or of those in the folder, bytes; None for stdout."""
        if self.is_stdout:
            return None
        names = listed_files(self.path) if self.is_folder else [""]
        return sum((self.path / name).stat().st_size for name in names)

    @property
    def _format(self) -> _Format:
        return (_FOLDERS if self.is_folder else _FORMATS)[self.suffix]

    def load_module(self) -> ModuleType:
        """Module that writes the format, imported where it is used, since it may need an extra.

        Raises:
            InputError: The extra is not installed.

        """
        form = self._format
        try:
            return import_module(f"{__package__}.{form.module}")
        except ImportError as error:
            if not form.extra:
                raise
            raise InputError(
                str(self.path),
                f"this format needs {form.library}",
                install_extra(form.extra),
            ) from error


def parse_target(text: str, option: str, form: str | None = None) -> Target:
    """Target of an export of a recording.

    Args:
        text: Name of a file, of a folder where it ends in a slash or is one, or '-' for stdout.
        option: Option of the command line that has the name.
        form: Name of a format for what has no suffix; None: Parquet, for stdout Arrow.

    Raises:
        InputError: The format is unknown or does not fit, its extra is not installed, or the folder
            holds files of others.

    """
    where = f"{option} {text}"
    path = Path(text)
    if text == STDOUT:
        if form not in (None, "arrow"):
            raise InputError(
                f"{where} --format {form}", "stdout supports only arrow", "name a file"
            )
        target = Target(path, ".arrows")
    elif text.endswith("/") or (_is_folder(path, where) and not path.suffix):
        if path.exists() and not path.is_dir():
            raise InputError(where, "is a file", "name a folder, or remove the slash")
        listed_files(path)
        target = Target(path, f".{form or FOLDER_FORMATS[0]}", is_folder=True)
    else:
        target = file_target(path, option)
        if path.is_dir():
            raise InputError(
                where, "is a folder", f"name a file, or {path}/ for one file per message"
            )
        if form is not None and f".{form}" != target.suffix:
            fix = (
                f"{where}/ is a folder with one file per message; for a single file, use the "
                f"suffix .{form}"
            )
            raise InputError(f"{where} --format {form}", "the suffix names the format", fix)
    target.load_module()
    return target


def file_target(path: Path, option: str, suffixes: tuple[str, ...] = SUFFIXES) -> Target:
    """Target of a file; its suffix selects the format.

    Args:
        path: Path of the file.
        option: Option of the command line that names the file.
        suffixes: Suffixes to choose from.

    Raises:
        InputError: The format is unknown.

    """
    # The longest first: .csv.gz ends in .gz, which alone is nothing.
    suffix = next((ending for ending in suffixes if path.name.lower().endswith(ending)), None)
    if suffix is not None:
        return Target(path, suffix)
    known = ", ".join(suffixes)
    other = _OTHER_NAMES.get(path.suffix.lower())
    fix = f"use a suffix of {known}"
    if other in suffixes:
        fix = f"it is called {other} here; known: {known}"
    elif not path.suffix and suffixes == SUFFIXES:
        fix = f"use a suffix of {known}, or {path}/ for a folder with one file per message"
    raise InputError(f"{option} {path}", "unknown format", fix)


def require_format(path: Path, option: str) -> None:
    """Raise an InputError where a table's format is unknown or its extra is not installed.

    Args:
        path: Path of the file to write.
        option: Option of the command line that names the file.

    """
    target = file_target(path, option, TABLE_SUFFIXES)
    if _is_folder(path, f"{option} {path}"):
        raise InputError(f"{option} {path}", "is a folder", "name a file")
    target.load_module()


def _is_folder(path: Path, where: str) -> bool:
    try:
        return path.is_dir()
    except OSError as error:  # a name that is too long
        reason = error.strerror or "cannot be used"
        raise InputError(where, reason, "name another file") from error
