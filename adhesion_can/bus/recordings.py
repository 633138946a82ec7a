"""Recordings of any format as frames, and files that appear whole or not at all."""

import gzip
import io
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from hashlib import sha256
from pathlib import Path
from typing import IO, Any, BinaryIO, cast

import can

from adhesion_can.bus.candump import ReadReport, kind_of, looks_like_candump, read_candump
from adhesion_can.bus.frame import Frame, Mark, to_us
from adhesion_can.errors import InputError, RecordingError

_LINE_LIMIT = 1 << 16


class Recording:
    """A file of frames.

    Args:
        path: candump text (gzip too), or any format that python-can reads by its suffix.

    Raises:
        RecordingError: the file is missing, or of no known format.

    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.report = ReadReport()
        """Filled while the frames are read."""
        try:
            with path.open("rb") as file:
                self._gzip = file.read(2) == b"\x1f\x8b"
        except OSError as error:
            raise RecordingError(
                str(path), error.strerror or "cannot be read", "check the path"
            ) from error
        self._text = self._is_candump()
        if not self._text:
            _require_known_format(path)

    def __iter__(self) -> Iterator[Frame | Mark]:
        """Frames in the order of the file."""
        return self._candump() if self._text else self._python_can()

    @property
    def sha256(self) -> str:
        """Of the file's bytes, hex."""
        return file_sha256(self.path)

    @property
    def size(self) -> int:
        """Of the file, bytes."""
        return self.path.stat().st_size

    def _open(self) -> IO[bytes]:
        if self._gzip:
            return cast(IO[bytes], gzip.open(self.path, "rb"))
        return self.path.open("rb")

    def _is_candump(self) -> bool:
        """Whether the file is text as candump writes it: by its suffix, else by its first lines."""
        suffix = _inner_suffix(self.path)
        if suffix in (".log", ".txt", ""):
            return True
        if suffix in PYTHON_CAN:
            return False
        try:
            with self._open() as file:
                return any(looks_like_candump(file.readline(_LINE_LIMIT)) for _ in range(200))
        except (EOFError, OSError, zlib.error):
            return False

    def _candump(self) -> Iterator[Frame | Mark]:
        with self._open() as file:
            yield from read_candump(_lines(file, self.report), self.report)

    def _python_can(self) -> Iterator[Frame]:
        # python-can's readers stop at what they cannot read, with whatever their parser raises;
        # what was read until then is kept and the rest is reported.
        last = 0
        trc = _inner_suffix(self.path) == ".trc"
        try:
            with can.LogReader(self.path) as reader:
                for message in reader:
                    if trc and isinstance(message.channel, int):
                        message.channel -= 1  # PEAK counts its buses from 1
                    frame = from_message(message)
                    self.report.kinds[kind_of(frame)] += 1
                    self.report.backwards += frame.t_us < last
                    last = frame.t_us
                    yield frame
        except Exception as error:
            # Its parsers raise whatever they meet, struct.error and sqlite3.Error among them.
            if isinstance(error, NotImplementedError | ImportError):
                raise RecordingError(
                    str(self.path), "this format needs asammdf", "pip install 'adhesion-can[mf4]'"
                ) from error
            reason = " ".join(str(error).split())[:120] or type(error).__name__
            raise RecordingError(
                str(self.path),
                f"python-can stops after {sum(self.report.kinds.values())} frames ({reason})",
                "convert the file to candump text, whose bad lines are passed over",
            ) from error


def _lines(file: IO[bytes], report: ReadReport) -> Iterator[bytes]:
    while True:
        try:
            line = file.readline(_LINE_LIMIT)
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            report.kinds["cut"] += 1
            report.notes.append(
                f"the compressed file ends early ({error}); what came before is used"
            )
            return
        if not line:
            return
        yield line


PYTHON_CAN = frozenset({".asc", ".blf", ".trc", ".csv", ".db", ".mf4"})
"""Suffixes that python-can's readers know, besides candump's."""


def _inner_suffix(path: Path) -> str:
    """Suffix without the one of a compression."""
    return Path(path.stem if path.suffix.lower() == ".gz" else path.name).suffix.lower()


def _require_known_format(path: Path) -> None:
    if _inner_suffix(path) not in PYTHON_CAN:
        raise RecordingError(
            str(path),
            "not candump text, nor of a suffix that python-can reads",
            "record with 'candump -L', or give a .asc, .blf, .trc, .csv, .db or .mf4 file",
        )


def from_message(message: can.Message) -> Frame:
    """python-can's message as a frame."""
    channel = message.channel
    name = "" if channel is None else str(channel)
    return Frame(
        t_us=to_us(message.timestamp),
        arbitration_id=message.arbitration_id,
        data=b"" if message.is_error_frame or message.is_remote_frame else bytes(message.data),
        channel=f"can{name}" if name.isdigit() else name,
        is_extended=message.is_extended_id,
        is_fd=message.is_fd,
        is_remote=message.is_remote_frame,
        is_error=message.is_error_frame,
    )


def to_message(frame: Frame) -> can.Message:
    """A frame as python-can's message."""
    return can.Message(
        timestamp=frame.t_us / 1e6,
        arbitration_id=frame.arbitration_id,
        data=frame.data,
        is_extended_id=frame.is_extended,
        is_fd=frame.is_fd,
        is_rx=False,
        check=False,
    )


def file_sha256(path: Path) -> str:
    """Hash of a file's bytes, hex."""
    digest = sha256()
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


@contextmanager
def whole_file(path: Path, mode: str = "w", *, keep_part: bool = False) -> Iterator[Any]:
    """Write a file under a temporary name; it gets its own when all is written, else vanishes.

    Args:
        path: of the finished file; a suffix .gz compresses it.
        mode: 'w' or 'wb'.
        keep_part: leave what was written until an exception under the name with .part: a recording
            cannot be made again.

    Raises:
        InputError: the folder does not exist or cannot be written to.

    """
    part = path.with_name(path.name + ".part")
    if path.is_dir():
        raise InputError(str(path), "is a folder", "name a file")
    try:
        raw: BinaryIO = part.open("wb")
    except OSError as error:
        raise InputError(
            str(path), error.strerror or "cannot be written", "name a folder that can be written to"
        ) from error
    try:
        with ExitStack() as stack:
            file: Any = stack.enter_context(raw)
            if path.suffix == ".gz":
                packed = gzip.GzipFile(path.stem, "wb", fileobj=raw, mtime=0)
                file = stack.enter_context(packed)
            if "b" not in mode:
                text = io.TextIOWrapper(file, encoding="utf-8", newline="")
                file = stack.enter_context(text)
            yield file
    except BaseException:
        if not keep_part:
            part.unlink(missing_ok=True)
        raise
    part.replace(path)
