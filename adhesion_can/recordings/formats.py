"""What a file is: by its first bytes, and by its name where they show nothing."""

from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
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
FRAME_TABLE = "frame table"
"""Name of the logs of other tools that have a line a frame, as a format."""
FORMAT_NAMES = {
    CANDUMP: "candump text",
    FRAME_TABLE: "a table of frames",
    ".asc": "a Vector log (.asc)",
    ".blf": "a Vector log (.blf)",
    ".trc": "a PEAK trace (.trc)",
    ".csv": "python-can's .csv",
    MF4: "a measurement file (.mf4)",
    SQLITE: "python-can's data base (.db)",
}
"""What a format is called in sentences."""
HEAD = 1 << 14
"""Number of first bytes that show a format."""

_SUFFIXES = {".mdf": MF4, ".dat": MF4, ".sqlite": SQLITE, ".sqlite3": SQLITE}
"""Formats by further suffixes."""
_TEXT = frozenset({".log", ".txt", ""})
_PACKED = (".gz", ".zst")
_MEASUREMENT = (b"MDF ", b"UnFinMF ")
_FIRST_BYTES = {
    b"LOGG": ".blf",
    **dict.fromkeys(_MEASUREMENT, MF4),
    b"SQLite format 3\0": SQLITE,
    b"date ": ".asc",
    b";$FILEVERSION": ".trc",
    b"timestamp,arbitration_id": ".csv",
}
_OTHERS = {
    b"PAR1": ("a Parquet file", "give a table of samples as .parquet, or frames as candump text"),
    b"PK\x03\x04": ("a packed file (.zip, .xlsx)", "unpack it, or save the sheet as .csv"),
    b"\x89HDF": ("a HDF5 file", "export it as .csv or .parquet"),
    b"MATLAB": ("a MATLAB file", "name it .mat"),
    b"VERSION": ("a CAN database", "name it with --dbc, and give a recording"),
    b"%PDF": ("a document", "give a recording"),
}
"""Files that are no recordings: what they are by their first bytes, and what to do."""
_ANOTHER_TEXT = "record with 'candump -L', or give a .asc, .blf, .trc, .csv, .db or .mf4 file"


def _inner_suffix(path: Path) -> str:
    """Suffix in lower case, without the one of a compression."""
    packed = path.suffix.lower() in _PACKED
    return Path(path.stem if packed else path.name).suffix.lower()


def detect_format(path: Path, head: bytes) -> str:
    """Suffix of the format of a recording, `CANDUMP` for candump text, or `FRAME_TABLE`.

    What the first bytes show counts, whatever the name. First bytes of no known format are no
    error, for text may start with anything: then the name counts.

    Args:
        path: Path of the file.
        head: First bytes of the file, unpacked.

    Raises:
        RecordingError: The name is of no known format, and the content neither.

    """
    seen = format_of(head)
    if seen == MF4 and head[8:9] in (b"2", b"3"):
        version = head[8:12].decode("latin-1")
        raise RecordingError(
            str(path), f"a measurement file of version {version}", "save it as version 4.10"
        )
    if seen is not None:
        return seen
    for first, (what, fix) in _OTHERS.items():
        if head.startswith(first):
            raise RecordingError(str(path), f"{what}, not a recording of a bus", fix)
    named = _format_by_name(path)
    if named is None:
        raise RecordingError(
            str(path),
            "not candump text, and python-can reads no file with this suffix",
            _ANOTHER_TEXT,
        )
    return named


def is_measurement(head: bytes) -> bool:
    """Whether the first bytes are those of a measurement file (MDF)."""
    return head.startswith(_MEASUREMENT)


def is_misnamed(path: Path, file_format: str) -> bool:
    """Whether the name of a file says another format than the one that it has."""
    return file_format not in (_format_by_name(path) or file_format, FRAME_TABLE)


def _format_by_name(path: Path) -> str | None:
    """Format that the name of a file says; None where it is that of no recording."""
    suffix = _inner_suffix(path)
    named = CANDUMP if suffix in _TEXT else _SUFFIXES.get(suffix, suffix)
    return named if named in PYTHON_CAN | {CANDUMP} else None


def format_of(head: bytes) -> str | None:
    """Format that the first bytes of a file show, unpacked; None where they show none."""
    text = as_utf8(head)
    for first, suffix in _FIRST_BYTES.items():
        if text.startswith(first):
            return suffix
    lines = text.splitlines()[:200]
    if any(map(looks_like_candump, lines)):
        return CANDUMP
    # Imported here: its forms are looked at where nothing else is seen.
    from adhesion_can.recordings.frame_tables.forms import find_form  # noqa: PLC0415

    return FRAME_TABLE if find_form(lines) is not None else None


def is_candump(path: Path) -> bool:
    """Whether the first bytes of a file are candump text, not packed."""
    try:
        with path.open("rb") as file:
            return format_of(file.read(HEAD)) == CANDUMP
    except OSError:
        return False  # its reader says what is wrong


def as_utf8(text: bytes) -> bytes:
    """First bytes of a text as UTF-8 without its mark; others as they are."""
    if text.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return text.decode("utf-16", "replace").encode()
    return text.removeprefix(BOM_UTF8)


def require_text_name(path: Path, where: str) -> None:
    """Raise an InputError where a file of candump text would have the name of another format.

    Args:
        path: Path of the file to write.
        where: Option and path, for the error.

    """
    suffix = _inner_suffix(path)
    if path.suffix.lower() == ".zst":
        raise InputError(where, "candump text is compressed as .gz only", f"name it {path.stem}.gz")
    if suffix in PYTHON_CAN:
        text = path.name[: path.name.lower().rindex(suffix)] + CANDUMP
        fix = f"name it {text}, then convert it with 'can_logconvert {text} {path.name}'"
        raise InputError(where, "the file is written as candump text, not in that format", fix)
