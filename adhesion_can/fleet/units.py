"""The units of a fleet: recordings and TABLEs by path, folder, pattern or URL, with their names."""

import csv
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from io import StringIO
from math import isfinite
from pathlib import Path
from sys import intern
from typing import Any
from urllib.parse import unquote

from adhesion_can.errors import InputError, suggest
from adhesion_can.fleet.places import is_url, open_place
from adhesion_can.input_files import read_small_file
from adhesion_can.recordings.formats import PYTHON_CAN

COLUMNS = ("path", "vehicle", "config", "line", "latitude", "longitude")
"""Columns of a manifest; the first two are needed."""
LARGEST_MANIFEST = 256 << 20
"""Size of a manifest that is read, bytes; a million units have 100 MiB."""
_SUFFIXES = PYTHON_CAN | {".log", ".parquet", ".mat"}
"""Suffixes of the files of a folder that are taken."""
_PATTERN = re.compile(r"[*?\[]")
_LIMITS = {"latitude": 90.0, "longitude": 180.0}


@dataclass(frozen=True, slots=True)
class Unit:
    """A recording or TABLE of a fleet.

    Attributes:
        path: Absolute path or URL.
        vehicle: Name of its vehicle.
        size: Size of the file, bytes; None where the server does not report it.
        fingerprint: Size and time of change, or ETag; '' where the server shows none of them.
        config: Path of its own configuration file; None: that of the command.
        line: Name of the railway line; None where it is not known.
        latitude_deg: Latitude, °; None where it is not known.
        longitude_deg: Longitude, °; None where it is not known.

    """

    path: str
    vehicle: str
    size: int | None = None
    fingerprint: str = ""
    config: str | None = None
    line: str | None = None
    latitude_deg: float | None = None
    longitude_deg: float | None = None

    @property
    def unit_id(self) -> str:
        """Identity: the file's name, and a hash of its whole path."""
        name = self.path.rstrip("/").rsplit("/", 1)[-1]
        if is_url(self.path):
            name = unquote(name.partition("?")[0])
        name = re.sub(r"[^A-Za-z0-9._-]+", "_", name)[:60]
        return f"{name}-{sha256(self.path.encode()).hexdigest()[:12]}"


def find_units(inputs: Iterable[str], vehicle: str | None, out: str) -> list[Unit]:
    """Units of paths, folders, patterns and URLs, each file once, in the order of the inputs.

    Args:
        inputs: Paths, folders, patterns or URLs.
        vehicle: Regular expression whose group `vehicle`, or first group, is the vehicle's name in
            the path; None: the name of the file's folder.
        out: Folder of the data set, whose files are none of the inputs.

    Raises:
        InputError: An input is missing, or a path does not fit the expression.

    """
    named = _vehicle_by(vehicle)
    out_folder = f"{open_place(out).name.rstrip('/')}/"
    units: dict[str, Unit] = {}
    for given in inputs:
        for path, info in _files(given):
            if not path.startswith(out_folder):
                units.setdefault(path, _unit(path, named(path), info))
    if not units:
        raise InputError("fleet", "the inputs contain no recording or TABLE", "check the paths")
    return list(units.values())


def read_manifest(path: Path) -> list[Unit]:
    """Units of a manifest, a CSV file with a row for each.

    Args:
        path: Path of the file; paths in it are relative to its folder.

    Raises:
        InputError: The manifest or one of its rows cannot be used.

    """
    where, fix = f"--units {path}", "name a CSV file in UTF-8"
    try:
        text = read_small_file(path, LARGEST_MANIFEST, where=where, fix=fix).decode("utf-8-sig")
        reader = csv.DictReader(StringIO(text, newline=""), restkey="", restval="")
        _require_heading(reader.fieldnames or (), str(path))
        rows = [(reader.line_num, row) for row in reader]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(where, f"cannot be read as CSV ({error})", fix) from error
    units: dict[str, Unit] = {}
    for number, row in rows:
        where = f"--units {path}, line {number}"
        unit = _manifest_unit(row, path.absolute().parent, where)
        if unit.path in units:
            raise InputError(where, f"{unit.path} is given twice", "name each file once")
        units[unit.path] = unit
    if not units:
        raise InputError(f"--units {path}", "no row", "write a row for each recording")
    return list(units.values())


def _require_heading(heading: Sequence[str], where: str) -> None:
    for name in heading:
        if name not in COLUMNS:
            fix = suggest(name, COLUMNS) or f"known: {', '.join(COLUMNS)}"
            raise InputError(f"--units {where}", f"no column {name!r} is known", fix)
    for name in COLUMNS[:2]:
        if name not in heading:
            what = f"no column {name!r}"
            raise InputError(
                f"--units {where}", what, f"the first columns must be {','.join(COLUMNS[:2])}"
            )


def _manifest_unit(row: Mapping[str, Any], folder: Path, where: str) -> Unit:
    if "" in row:
        raise InputError(where, "more cells than columns", "put texts with commas in quotes")
    cells = {name: (text or "").strip() for name, text in row.items()}
    for name in COLUMNS[:2]:
        if not cells[name]:
            raise InputError(where, f"no {name}", "fill it in")
    given = cells["path"]
    full = given if is_url(given) else str(folder / given)
    files = [] if _PATTERN.search(full) and not Path(full).exists() else list(_files(full))
    if len(files) != 1:
        raise InputError(where, f"{given} is not a single file", "write a row for each recording")
    config = cells.get("config") or None
    name, info = files[0]
    return replace(
        _unit(name, cells["vehicle"], info),
        config=None if config is None else str(folder / config),
        line=cells.get("line") or None,
        latitude_deg=_degrees(cells.get("latitude", ""), "latitude", where),
        longitude_deg=_degrees(cells.get("longitude", ""), "longitude", where),
    )


def _degrees(text: str, name: str, where: str) -> float | None:
    if not text:
        return None
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not (isfinite(value) and abs(value) <= _LIMITS[name]):
        fix = f"write degrees, -{_LIMITS[name]:g} to {_LIMITS[name]:g}, or nothing"
        raise InputError(where, f"{name} {text!r}", fix)
    return value


def _unit(path: str, vehicle: str, info: Mapping[str, Any]) -> Unit:
    # One text for all units of a vehicle.
    return Unit(path, intern(vehicle), info.get("size"), _fingerprint(info))


def _fingerprint(info: Mapping[str, Any]) -> str:
    """Cheap sign of a change, from what a file system says of a file."""
    tag = info.get("ETag") or info.get("etag") or info.get("md5Hash")
    changed = info.get("mtime") or info.get("LastModified") or info.get("updated")
    if tag is None and changed is None:
        return ""  # a size alone is no sign
    return f"{info.get('size')} {tag or changed}"


def _files(given: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Files of an input with what their file system says of them, in the order of their names."""
    place = open_place(given)
    info = place.info()
    if info is not None and info["type"] != "directory":
        yield place.name, info
        return
    if info is not None:
        files = {name: about for name, about in place.files() if _is_taken(name, place.name)}
        if not files:
            known = ", ".join(sorted(_SUFFIXES))
            raise InputError(given, "no recording in this folder", f"their names end in {known}")
    elif _PATTERN.search(given):
        files = dict(place.files(pattern=True))
        if not files:
            raise InputError(
                given, "no file matches this pattern", "check it; in a shell, put it in quotes"
            )
    else:
        raise InputError(given, "No such file or directory", "check the path")
    yield from sorted(files.items())


def _is_taken(name: str, folder: str) -> bool:
    """Whether a file below a folder is a recording by its name, and not hidden."""
    below = name[len(folder.rstrip("/")) + 1 :]
    if any(part.startswith((".", "_")) for part in below.split("/")):
        return False
    suffixes = [suffix.lower() for suffix in Path(below).suffixes]
    if suffixes and suffixes[-1] in {".gz", ".zst"}:
        suffixes.pop()
    return bool(suffixes) and suffixes[-1] in _SUFFIXES


def _vehicle_by(expression: str | None) -> Callable[[str], str]:
    """Function from a path to the name of its vehicle."""
    if expression is None:
        return _folder_name
    where = f"--vehicle {expression!r}"
    try:
        pattern = re.compile(expression)
    except re.error as error:
        raise InputError(where, f"not a regular expression ({error})", "correct it") from error
    group: str | int = "vehicle" if "vehicle" in pattern.groupindex else min(pattern.groups, 1)

    def named(path: str) -> str:
        match = pattern.search(path)
        if match is None or not match[group]:
            raise InputError(where, f"finds no vehicle in {path}", "correct it, or give --units")
        return str(match[group])

    return named


def _folder_name(path: str) -> str:
    """Name of the folder that holds a file; of a bucket or a server where there is no folder."""
    parts = [part for part in path.partition("?")[0].split("/") if part]
    return unquote(parts[-2]) if is_url(path) else (parts[-2] if len(parts) > 1 else "/")
