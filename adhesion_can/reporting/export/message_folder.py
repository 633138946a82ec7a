"""A folder with a file for each message: dense tables, each with its own time."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO, Protocol

from adhesion_can.errors import InputError
from adhesion_can.files import Temporary, whole_file
from adhesion_can.input_files import read_small_file
from adhesion_can.reporting.export.layout import Frames, Group, GroupRows, Sink

LIST = "convert.json"
"""Name of the file that lists the files of a folder."""

_TIMES = ("time_s", "time_ns")

_LARGEST_LIST = 16 << 20
"""Size of a list of files that is read, bytes."""
_CELLS = 1 << 24
"""Largest number of cells of all files that are held in memory."""


class MessageFile(Protocol):
    """A file with the rows of one message from one bus."""

    held: int
    """Number of cells that are held in memory."""

    def write(self, rows: GroupRows) -> None:
        """Append rows."""

    def flush(self) -> None:
        """Write what is held."""

    def close(self) -> None:
        """Write what is left; the file stays open."""


@dataclass
class _Entry:
    """A file of the folder.

    Attributes:
        group: Message, and its bus.
        part: File under its temporary name.
        file: Rows on their way into it.
        rows: Number of rows.

    """

    group: Group
    part: Temporary
    file: MessageFile
    rows: int = 0


class MessageFolder(Sink):
    """Writes a file a message, and one for each bus where several carry the message.

    All files have temporary names until the last one is finished. Files that an earlier run wrote
    into the folder, and this one did not, are then deleted; what else is there stays.

    Args:
        path: Path of the folder; made where it is not there.
        suffix: Suffix of the files.
        open_file: Function that starts a file for a message.
        origin: Version, inputs and the like, by name, for the list of files.

    Raises:
        InputError: The folder holds files, and no earlier run wrote them.

    """

    def __init__(
        self,
        path: Path,
        suffix: str,
        open_file: Callable[[BinaryIO, Group], MessageFile],
        origin: Mapping[str, str],
    ) -> None:
        self._path = path
        self._suffix = suffix
        self._open_file = open_file
        self._origin = origin
        self._entries: dict[tuple[str, str], _Entry] = {}
        self._earlier = listed_files(path)
        self._is_new = not path.exists()
        path.mkdir(exist_ok=True)

    def write(self, rows: Sequence[GroupRows], _frames: Frames | None = None) -> None:
        """Append rows."""
        for part in rows:
            if len(part.t_ns):
                entry = self._entry(part.group)
                entry.file.write(part)
                entry.rows += len(part.t_ns)
        while sum(entry.file.held for entry in self._entries.values()) > _CELLS:
            max(self._entries.values(), key=lambda entry: entry.file.held).file.flush()

    def close(self) -> None:
        """Finish all files, which then get their names."""
        for entry in self._entries.values():
            entry.file.close()
        named = self._named()
        # Listed before they are there: what stops the command here is fixed by the next run.
        self._write_list({**dict.fromkeys(self._earlier), **named})
        for name, entry in named.items():
            entry.part.rename(self._path / name)
        for name in self._earlier:
            if name not in named:
                (self._path / name).unlink(missing_ok=True)
        self._write_list(named)

    def abandon(self) -> None:
        """Delete what has been written so far; the files of an earlier run stay."""
        for entry in self._entries.values():
            # The error that led here is the one to be raised.
            with suppress(OSError):
                entry.file.close()
            entry.part.remove()
        if self._is_new:
            with suppress(OSError):
                self._path.rmdir()

    def _entry(self, group: Group) -> _Entry:
        key = group.name, group.channel
        if key not in self._entries:
            part = Temporary(self._path / f"{len(self._entries) + 1}{self._suffix}")
            try:
                file = self._open_file(part.file, _dense(group))
            except BaseException:
                part.remove()
                raise
            self._entries[key] = _Entry(group, part, file)
        return self._entries[key]

    def _named(self) -> dict[str, _Entry]:
        """Files by name: the message's, with the bus behind it where several carry it."""
        buses: dict[str, int] = {}
        for name, _ in self._entries:
            buses[name] = buses.get(name, 0) + 1
        named: dict[str, _Entry] = {}
        taken: set[str] = set()
        for (message, channel), entry in self._entries.items():
            stem = _as_file_name(f"{message}.{channel}" if buses[message] > 1 else message)
            name, again = stem, 1
            while name.lower() in taken:  # some file systems take two names for one
                again += 1
                name = f"{stem}-{again}"
            taken.add(name.lower())
            named[name + self._suffix] = entry
        return named

    def _write_list(self, files: Mapping[str, _Entry | None]) -> None:
        listed = [
            {"file": name}
            if entry is None
            else {
                "file": name,
                "message": entry.group.name,
                "channel": entry.group.channel,
                "rows": entry.rows,
            }
            for name, entry in files.items()
        ]
        with whole_file(self._path / LIST, own_name=True) as file:
            json.dump({**self._origin, "files": listed}, file, indent=2, ensure_ascii=False)


def listed_files(path: Path) -> list[str]:
    """Names of the files that an earlier run wrote into a folder.

    Raises:
        InputError: The folder holds files, and no earlier run wrote them; or its list is no list
            of ours.

    """
    if not path.exists():
        return []
    fix = "name a new folder, or empty this one"
    if not (path / LIST).exists():
        # Hidden ones are what a killed run left, or what a desktop puts everywhere.
        if any(not file.name.startswith(".") for file in path.iterdir()):
            raise InputError(str(path), "contains files that convert did not write", fix)
        return []
    try:
        document = json.loads(read_small_file(path / LIST, _LARGEST_LIST, fix=fix))
        names = [str(listed["file"]) for listed in document["files"]]
    except (ValueError, LookupError, TypeError) as error:
        raise InputError(
            str(path / LIST), "is not a list of files written by convert", fix
        ) from error
    # A list that somebody changed must not delete what is elsewhere.
    return [name for name in names if Path(name).name == name and not (path / name).is_dir()]


def _dense(group: Group) -> Group:
    """The group, with the message's name before a signal that is called as a time column is."""
    fields = [
        replace(field, name=f"{group.name}.{field.name}") if field.name in _TIMES else field
        for field in group.fields
    ]
    return replace(group, fields=tuple(fields))


def _as_file_name(text: str) -> str:
    """A text with '_' for what some file system does not take in a name."""
    return re.sub(r"[^\w@.+-]", "_", text).lstrip(".") or "_"
