"""Files of text, packed or not, as lines and as chunks of whole lines."""

import gzip
import io
import zlib
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE, getincrementaldecoder
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from enum import Enum
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from adhesion_can.errors import RecordingError
from adhesion_can.extras import install_extra
from adhesion_can.recordings.candump import ReadReport

Text = NDArray[np.uint8]

LINE_LIMIT = 1 << 16
"""Longest line, bytes with the line end; a longer one is read as several."""

FRONT, BACK = 8, 128
"""Numbers of bytes before and behind the lines of a chunk: room for words across their edges."""

_PIECE = 1 << 16
_ZSTD_PIECE = 1 << 11  # packed; of zeros it holds 64 MiB


class Packing(Enum):
    """Compression of a file, by its first bytes."""

    NONE = b""
    GZIP = b"\x1f\x8b"
    ZSTD = b"\x28\xb5\x2f\xfd"

    @classmethod
    def from_head(cls, head: bytes) -> "Packing":
        """Compression that a file's first bytes show."""
        return next(way for way in (cls.GZIP, cls.ZSTD, cls.NONE) if head.startswith(way.value))


class Chunk(NamedTuple):
    """Some lines of a file.

    Attributes:
        text: Whole lines, the last one of a file perhaps cut, behind `FRONT` other bytes.
        stop: Position of the end of the last line in `text`; at least `BACK` other bytes follow.
        position: Number of bytes of the file, as stored, that were read up to here.

    """

    text: Text
    stop: int
    position: int


class TextSource:
    """A file of text that is open for reading, once; a context manager.

    A compressed file that cannot be read to its end gives the whole lines in front of the fault.

    Args:
        path: Path of the file.
        packing: Compression of the file.
        report: Statistics, to which a note is added where a compressed file ends early.

    Raises:
        RecordingError: The package zstandard, which reading needs, is not installed.

    """

    def __init__(self, path: Path, packing: Packing, report: ReadReport) -> None:
        self._report = report
        self._is_reported = False
        self._stored = path.open("rb")
        self._unpacked: _Unpacked | None = None
        self._file: io.BufferedReader = self._stored
        if packing is not Packing.NONE:
            pieces = (
                _gzip_pieces(self._stored)
                if packing is Packing.GZIP
                else _zstd_pieces(self._stored, path)
            )
            self._unpacked = _Unpacked(pieces)
            self._file = io.BufferedReader(self._unpacked, _PIECE)
        try:
            mark = self._file.peek(2)[:2]
        except BaseException:
            self._stored.close()
            raise
        if mark in (BOM_UTF16_LE, BOM_UTF16_BE):
            fault = self._unpacked
            self._unpacked = _Unpacked(_utf8_pieces(self._file), fault)
            self._file = io.BufferedReader(self._unpacked, _PIECE)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()
        self._stored.close()

    def lines(self) -> Iterator[bytes]:
        """Lines with their ends, the last one perhaps without."""
        self._skip_mark()
        while line := self._file.readline(LINE_LIMIT):
            is_whole = line.endswith(b"\n") or len(line) == LINE_LIMIT
            if is_whole or not self._fault:
                yield line
        self._report_fault()

    def head(self, size: int) -> bytes:
        """First bytes of the text, fewer where it is shorter; nothing else may be read after it."""
        self._skip_mark()
        return bytes(self._file.read(size) or b"")

    def read(self, size: int) -> bytes:
        """Next bytes of a file that is no text, fewer than asked for at its end alone."""
        data = bytes(self._file.read(size) or b"")
        if len(data) < size:
            self._report_fault()
        return data

    @property
    def position(self) -> int:
        """Number of bytes of the file, as stored, that were read up to here."""
        return self._stored.tell()

    def chunks(self, size: int) -> Iterator[Chunk]:
        """Chunks of whole lines.

        Args:
            size: Number of bytes of text of a chunk, at least 1, to within a line.

        """
        if self._unpacked is None:
            yield from self._chunks(size)
            return
        # Unpacking takes as long as all the rest: it runs one chunk ahead on a core of its own.
        chunks = self._chunks(size)
        with ThreadPoolExecutor(1, "unpack") as pool:
            ahead = pool.submit(next, chunks, None)
            while chunk := ahead.result():
                ahead = pool.submit(next, chunks, None)
                yield chunk

    def comments(self, size: int) -> Iterator[bytes]:
        """Whole lines that begin with '#', found in chunks of so many bytes: they are few."""
        for chunk in self.chunks(size):
            text = b"\n" + chunk.text[FRONT : chunk.stop].tobytes()
            begin = text.find(b"\n#") + 1
            while begin and (end := text.find(b"\n", begin)) >= 0:
                yield text[begin : end + 1]
                begin = text.find(b"\n#", end) + 1

    def _chunks(self, size: int) -> Iterator[Chunk]:
        self._skip_mark()
        rest = np.empty(0, np.uint8)
        is_end = False
        while not is_end:
            start = FRONT + len(rest)
            text = np.empty(start + size + BACK, np.uint8)
            text[:FRONT] = 0
            text[FRONT:start] = rest
            end = start + self._file.readinto(text[start : start + size].data)
            is_end = end < start + size
            lines_end = _end_of_lines(text[FRONT:end]) + FRONT
            # Where a packed file ends early, a last line without its end is cut and left out.
            stop = end if is_end and not self._fault else lines_end
            rest = text[stop:end]
            if stop > FRONT:
                yield Chunk(text, stop, self._stored.tell())
        self._report_fault()

    def _skip_mark(self) -> None:
        # An editor that stores UTF-8 may put it in front: it belongs to no line.
        if self._file.peek(len(BOM_UTF8)).startswith(BOM_UTF8):
            self._file.read(len(BOM_UTF8))

    @property
    def _fault(self) -> Exception | None:
        return self._unpacked.fault if self._unpacked else None

    def _report_fault(self) -> None:
        if self._fault and not self._is_reported:
            self._is_reported = True
            self._report.kinds["cut"] += 1
            self._report.notes.append(
                f"the compressed file ends early ({self._fault}); using what precedes the end"
            )


def _end_of_lines(text: Text) -> int:
    """End of the last whole line, also of those that the limit makes of a longer one."""
    end = 0
    for tail in (text[-512:], text):  # nearly always in the first
        if end_in_tail := tail.tobytes().rfind(b"\n") + 1:
            end = len(text) - len(tail) + end_in_tail
            break
    return end + (len(text) - end) // LINE_LIMIT * LINE_LIMIT


class _Unpacked(io.RawIOBase):
    """Pieces of bytes as a file, which ends where they cannot be unpacked.

    Args:
        pieces: The pieces.
        inner: What they were unpacked from before, which may have a fault of its own.

    """

    def __init__(self, pieces: Iterator[bytes], inner: "_Unpacked | None" = None) -> None:
        self._fault: Exception | None = None
        self._inner = inner
        self._pieces = pieces
        self._piece = memoryview(b"")

    @property
    def fault(self) -> Exception | None:
        """Error that ends the file early; None while there is none."""
        return self._fault or (self._inner.fault if self._inner else None)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        if not self._piece and not self._fault:
            try:
                self._piece = memoryview(next(self._pieces, b""))
            except (EOFError, zlib.error, gzip.BadGzipFile) as error:
                self._fault = error
        count = min(len(buffer), len(self._piece))
        buffer[:count] = self._piece[:count]
        self._piece = self._piece[count:]
        return count


def _utf8_pieces(file: io.BufferedReader) -> Iterator[bytes]:
    """Text in UTF-16, as some shells and editors write it, in UTF-8."""
    decoder = getincrementaldecoder("utf-16")("replace")
    while piece := file.read(_PIECE):
        if text := decoder.decode(piece).encode():
            yield text
    if text := decoder.decode(b"", final=True).encode():
        yield text


def _gzip_pieces(stored: BinaryIO) -> Iterator[bytes]:
    with gzip.GzipFile(fileobj=stored) as file:
        # read1: what stands in front of a fault is given before the fault is raised.
        while piece := file.read1(_PIECE):
            yield piece


def _zstd_pieces(stored: BinaryIO, path: Path) -> Iterator[bytes]:
    try:
        import zstandard  # noqa: PLC0415  an extra is imported where it is needed
    except ImportError as error:
        raise RecordingError(
            str(path), "zstd needs the package zstandard", install_extra("zstd")
        ) from error
    frame = None
    packed = b""
    while packed := packed or stored.read(_ZSTD_PIECE):
        frame = frame or zstandard.ZstdDecompressor().decompressobj()
        try:
            piece = frame.decompress(packed)
        except zstandard.ZstdError as error:
            raise EOFError(str(error)) from error
        if piece:
            yield piece
        packed = frame.unused_data if frame.eof else b""
        frame = None if frame.eof else frame
    if frame is not None:
        raise EOFError("its last frame is incomplete")
