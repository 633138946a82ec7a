"""Text of a table: packed or not, in the encodings that spreadsheets write."""

import gzip
import io
import zlib
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from pathlib import Path

from adhesion_can.errors import TableError
from adhesion_can.recordings.text_columns.text_source import Packing

LARGEST_TEXT = 512 << 20
"""Most text of a table, unpacked, bytes: its cells take many times as much, and a packed file of
1 MiB may hold 1 GiB."""
ALWAYS_READ, MOST_TIMES = 32 << 20, 200
"""Text of a packed table that is read whatever its file's size, bytes, and beyond it how many times
that size: numbers pack to a third, and the same row over and over to a hundredth."""
HEAD = 1 << 18
"""First bytes of a file that show what it is."""


def read_text(path: Path) -> str:
    """Whole text of a file.

    Raises:
        TableError: The file cannot be read, or is too large.

    """
    most = LARGEST_TEXT
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
        if Packing.from_head(content) is Packing.GZIP:
            most = min(max(ALWAYS_READ, MOST_TIMES * len(content)), LARGEST_TEXT)
            content = gzip.GzipFile(fileobj=io.BytesIO(content)).read(most + 1)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise _damaged(path, error) from error
    except OSError as error:
        raise _unreadable(path, error) from error
    if len(content) > most:
        raise TableError(
            str(path),
            f"more than {most >> 20} MiB of text",
            "split it, or write it as Parquet",
        )
    return decode(content)


def read_head(path: Path) -> str:
    """First lines of a file, whole ones but where the file is a single long line.

    Raises:
        TableError: The file cannot be read.

    """
    try:
        with path.open("rb") as file:
            packed = Packing.from_head(file.read(4)) is Packing.GZIP
            file.seek(0)
            content = gzip.GzipFile(fileobj=file).read(HEAD) if packed else file.read(HEAD)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise _damaged(path, error) from error
    except OSError as error:
        raise _unreadable(path, error) from error
    text = decode(content)
    return text[: text.rfind("\n") + 1] if len(content) == HEAD and "\n" in text else text


def decode(content: bytes) -> str:
    """Text of a file's bytes: UTF-8, UTF-16 with its mark, or what is written in Western Europe."""
    if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return content.decode("utf-16", "replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if error.start >= len(content) - 3:  # a head may end within a letter
            return content[: error.start].decode("utf-8-sig")
        # What spreadsheets write in Western Europe, where units hold 'µ' and '°'.
        return content.decode("cp1252", "replace")


def _damaged(path: Path, error: Exception) -> TableError:
    return TableError(str(path), f"the gzip file is damaged ({error})", "compress it again")


def _unreadable(path: Path, error: OSError) -> TableError:
    return TableError(str(path), error.strerror or "cannot be read", "check the path")
