"""Format of a recording, by its name and by its first bytes."""

from pathlib import Path

from adhesion_can.errors import InputError, RecordingError
from adhesion_can.recordings.candump import looks_like_candump

PYTHON_CAN = frozenset({".asc", ".blf", ".trc", ".csv", ".db", ".mf4"})
"""Suffixes of the formats that python-can reads, besides candump's."""
COLUMNS = frozenset({".asc", ".blf", ".trc"})
"""Those of them that are read in columns, and what is odd in them by python-can."""
MF4, SQLITE = ".mf4", ".db"
"""Those of them whose files a process of its own, and our own reader, look into."""
CANDUMP = ".log"
"""Name of candump text as a format; its files may have another suffix or none."""
HEAD = 1 << 14
"""Number of first bytes that show a format."""

_TEXT = frozenset({".log", ".txt", ""})
_PACKED = (".gz", ".zst")
_FIRST_BYTES = {
    b"LOGG": ".blf",
    b"MDF ": ".mf4",
    b"SQLite format 3\0": ".db",
    b"date ": ".asc",
    b";$FILEVERSION": ".trc",
    b"timestamp,arbitration_id": ".csv",
}


def _inner_suffix(path: Path) -> str:
    """Suffix in lower case, without the one of a compression."""
    packed = path.suffix.lower() in _PACKED
    return Path(path.stem if packed else path.name).suffix.lower()


def detect_format(path: Path, head: bytes) -> str:
    """Suffix of the format of a recording, `CANDUMP` for candump text.

    A name of one format and first bytes of another are an error: reading by the name would give
    rubbish, and reading by the content would be a guess. First bytes of no known format are no
    error, for text may begin with anything.

    Args:
        path: Path of the file.
        head: First bytes of the file, unpacked.

    Raises:
        RecordingError: The name is of no known format, or of another one than the content.

    """
    named, seen = _inner_suffix(path), _by_content(head)
    if named in _TEXT:
        named = CANDUMP
    elif named not in PYTHON_CAN:
        if seen == CANDUMP:
            return seen
        raise RecordingError(
            str(path),
            "not candump text, nor of a suffix that python-can reads",
            "record with 'candump -L', or give a .asc, .blf, .trc, .csv, .db or .mf4 file",
        )
    if seen not in (None, named):
        what = "candump text" if seen == CANDUMP else f"a {seen} file"
        raise RecordingError(
            str(path), f"{what} by its content, and not what its name says", f"name it {seen}"
        )
    return named


def require_text_name(path: Path, where: str) -> None:
    """Raise an InputError where a file of candump text would have the name of another format.

    Args:
        path: Path of the file to write.
        where: Option and path, for the error.

    """
    suffix = _inner_suffix(path)
    if path.suffix.lower() == ".zst":
        raise InputError(where, "candump text is packed as .gz alone", f"name it {path.stem}.gz")
    if suffix in PYTHON_CAN:
        text = path.name[: path.name.lower().rindex(suffix)] + CANDUMP
        mend = f"name it {text}, and let 'can_logconvert {text} {path.name}' make the other"
        raise InputError(where, "candump text is what is written, not that format", mend)


def _by_content(head: bytes) -> str | None:
    """Suffix of the format that the first bytes show; None where they show none."""
    for first, suffix in _FIRST_BYTES.items():
        if head.startswith(first):
            return suffix
    return CANDUMP if any(map(looks_like_candump, head.splitlines()[:200])) else None
