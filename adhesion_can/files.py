"""Outputs that appear whole or not at all.

Every output of this package is written here. Nobody can foresee the name under which it grows, so
that no link can be laid in its way, and until it is complete the old file stays.
"""

import errno
import gzip
import io
import os
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import gettempdir
from typing import Any, BinaryIO

from adhesion_can.errors import InputError
from adhesion_can.input_files import open_descriptor
from adhesion_can.pipes import open_stream

READER_WAIT_S = 60.0
"""Time for which the reader of a named pipe is waited for, s."""

_ROOM = "make room, or name another folder"
_DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_LONGEST_LABEL = 32
"""Number of letters of a file's name in that of its temporary file, whose name has a limit too."""
_MOST_PARTS = 1000
"""Largest number of interrupted runs whose parts are kept beside one file."""


class Temporary:
    """A new file beside a target, under a name that nobody can foresee.

    Nobody has more rights on it than on the target; where there is none, what the umask leaves. It
    is to be renamed or removed.

    Args:
        target: Path of the file whose place it may take; a link is not followed.

    Raises:
        OSError: It cannot be made.

    """

    def __init__(self, target: Path) -> None:
        label = target.name[:_LONGEST_LABEL]
        self.path = target.with_name(f".{label}.{os.urandom(8).hex()}.part")
        """Path of the file."""
        rights = _rights(target)
        number = _create(self.path, 0o666 if rights is None else rights)
        # With a name, for which asammdf asks.
        self.file: BinaryIO = open(self.path, "w+b", opener=lambda *_: number)  # noqa: SIM115
        """The file, open for writing and reading."""

    def read_again(self) -> BinaryIO:
        """The closed file, open for reading."""
        return os.fdopen(open_descriptor(self.path, os.O_RDONLY, "O_NOFOLLOW"), "rb")

    def rename(self, target: Path, *, durable: bool = False) -> None:
        """Write all to the disk, close, and take the place of a file in the same folder.

        The rights on that file are kept.

        Args:
            target: Path of the file; a link of this name is replaced, not followed.
            durable: Whether the new name is on the disk as well when this returns.

        """
        self.file.flush()
        rights = _rights(target)
        if rights is not None and sys.platform != "win32":
            os.fchmod(self.file.fileno(), rights)  # with what the umask took away
        os.fsync(self.file.fileno())
        self.file.close()
        self.path.replace(target)
        if durable:
            _sync_folder(target.parent)

    def keep(self, target: Path) -> None:
        """Close, and take the name of a target with the suffix .part; of the next number if taken.

        The name of the temporary file stays where none can be had.
        """
        with suppress(OSError):
            self.file.close()
        with suppress(OSError):
            part = _free_part(target)
            try:
                self.path.replace(part)
            except OSError:
                part.unlink()

    def remove(self) -> None:
        """Close and delete; whatever led here is the error to be reported."""
        with suppress(OSError):
            self.file.close()
        with suppress(OSError):
            self.path.unlink(missing_ok=True)


class OutputFile:
    """An output in the making: `finish` gives it its name, `abandon` leaves the old file.

    A link that the user named is followed to its file. A device or a pipe is written to as it is:
    a file would take its name away from all others.

    Args:
        path: Path as the user gave it.
        random_access: Whether the writer asks for its place in the file or goes back; a device or a
            pipe then gets all at the end.
        keep_part: Whether what was written is kept when the output is abandoned, with the suffix
            .part: a recording cannot be made again.
        durable: Whether the name is on the disk when `finish` returns, not only the content.
        own_name: Whether the name is ours, in a folder that the user named: a link of this name is
            somebody else's, and replaced.

    Raises:
        InputError: The folder does not exist or cannot be written to, or nobody reads the pipe.

    """

    def __init__(
        self,
        path: Path,
        *,
        random_access: bool = False,
        keep_part: bool = False,
        durable: bool = False,
        own_name: bool = False,
    ) -> None:
        self._path = path
        self._keep_part = keep_part
        self._durable = durable
        self._temporary: Temporary | None = None
        self._stream: BinaryIO | None = None
        with _file_errors(path, "name a folder that can be written to"):
            form = _form(path, follow_links=not own_name)
            if stat.S_ISDIR(form):
                raise InputError(str(path), "is a folder", "name a file")
            if stat.S_ISREG(form):
                self._target = path if own_name else Path(os.path.realpath(path))
                self._temporary = Temporary(self._target)
                self.file: BinaryIO = self._temporary.file
            else:
                self._stream = self.file = os.fdopen(open_stream(path, READER_WAIT_S), "wb")
                if random_access:
                    self._target = Path(gettempdir()) / path.name
                    self._temporary = Temporary(self._target)
                    self.file = self._temporary.file

    def set_aside(self) -> Temporary:
        """What was written so far, closed, to be read again and removed; the output starts again.

        Raises:
            InputError: It cannot be written.

        """
        aside = self._temporary
        if aside is None:
            raise ValueError("an output without random access cannot start again")
        with _file_errors(self._path, _ROOM):
            aside.file.close()
            self._temporary = Temporary(self._target)
        self.file = self._temporary.file
        return aside

    def finish(self) -> None:
        """Write what is left, and give the file its name.

        Raises:
            InputError: It cannot be written or renamed; it is still to be abandoned.

        """
        with _file_errors(self._path, _ROOM):
            if self._stream is not None:
                if self._temporary is not None:
                    self.file.seek(0)
                    shutil.copyfileobj(self.file, self._stream)
                    self._temporary.remove()
                self._stream.close()
            elif self._temporary is not None:
                self._temporary.rename(self._target, durable=self._durable)

    def abandon(self) -> None:
        """Delete what was written, or keep it as a part; the old file stays."""
        if self._stream is not None:
            with suppress(OSError):
                self._stream.close()
        if self._temporary is not None:
            if self._keep_part and self._stream is None:
                self._temporary.keep(self._target)
            else:
                self._temporary.remove()


@contextmanager
def whole_file(
    path: Path,
    mode: str = "w",
    *,
    keep_part: bool = False,
    durable: bool = False,
    own_name: bool = False,
) -> Iterator[Any]:
    """Write a file from its start to its end; it gets its name when all is written.

    Args:
        path: Path of the finished file; a suffix .gz compresses it.
        mode: Mode of opening, 'w' or 'wb'.
        keep_part: As for `OutputFile`.
        durable: As for `OutputFile`.
        own_name: As for `OutputFile`.

    Raises:
        InputError: The folder does not exist or cannot be written to, the disk is full, or nobody
            reads the pipe.

    """
    out = OutputFile(
        path,
        keep_part=keep_part,
        durable=durable,
        own_name=own_name,
    )
    try:
        with ExitStack() as stack:
            file: Any = out.file
            if path.suffix == ".gz":
                packed = gzip.GzipFile(path.stem, "wb", fileobj=out.file, mtime=0)
                file = stack.enter_context(packed)
            if "b" not in mode:
                file = io.TextIOWrapper(file, encoding="utf-8", newline="")
                # Closed it would close the file below, which is still to be written to the disk.
                stack.callback(file.detach)
            yield file
        out.finish()
    except BaseException as error:
        out.abandon()
        if isinstance(error, OSError) and error.errno in _DISK_FULL:
            reason = error.strerror or "cannot be written"
            raise InputError(str(path), reason, "make room, or name another disk") from error
        raise


@contextmanager
def _file_errors(path: Path, fix: str) -> Iterator[None]:
    """Turn errors of the file system into InputErrors."""
    try:
        yield
    except BrokenPipeError:
        raise  # who read from the pipe has gone
    except OSError as error:
        raise InputError(str(path), error.strerror or "cannot be written", fix) from error


def _form(path: Path, *, follow_links: bool) -> int:
    """Mode of a file; that of a regular one where a new file may be."""
    try:
        form = path.stat(follow_symlinks=follow_links).st_mode
    except FileNotFoundError:
        return stat.S_IFREG
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        return stat.S_IFREG  # a link to itself gives way to the file
    return stat.S_IFREG if stat.S_ISLNK(form) else form


def _rights(target: Path) -> int | None:
    """Rights of owner, group and others on a file; None where there is none."""
    try:
        form = target.lstat().st_mode
    except FileNotFoundError:
        return None
    return form & 0o777 if stat.S_ISREG(form) else None


def _free_part(target: Path) -> Path:
    """Path of an empty file of ours with the suffix .part.

    Raises:
        OSError: None can be made.

    """
    for number in range(1, _MOST_PARTS):
        numbered = "" if number == 1 else f".{number}"
        path = target.with_name(f"{target.name}{numbered}.part")
        with suppress(FileExistsError):
            os.close(_create(path, 0o600))
            return path
    raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target))


def _create(path: Path, rights: int) -> int:
    """Descriptor of a new file; what is there already, a link too, is an error."""
    return open_descriptor(path, os.O_RDWR | os.O_CREAT | os.O_EXCL, "O_NOFOLLOW", rights=rights)


def _sync_folder(folder: Path) -> None:
    if sys.platform == "win32":
        return
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    except OSError as error:
        if error.errno != errno.EINVAL:  # of a file system whose folders need not be told
            raise
    finally:
        os.close(number)
