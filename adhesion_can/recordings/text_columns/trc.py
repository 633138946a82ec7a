"""Lines of PEAK's traces (.trc), versions 1.0 to 1.3, 2.0 and 2.1.

Version 1.2, and columns that a trace may lack, are written out as python-can's reader knows them.
"""

import re
from collections.abc import Sequence

import can
from can.io.trc import TRCFileVersion

from adhesion_can.bus.block import Kind
from adhesion_can.recordings.candump import FD_LENGTHS, LAST_US, ReadReport, since_1970_us
from adhesion_can.recordings.text_columns.line_layouts import Layout, learn_layout
from adhesion_can.recordings.text_columns.odd_lines import (
    LENGTH_CODES,
    OddLine,
    PythonCanLines,
    TraceForm,
)

_NUMBER = rb"\s*(?P<number>\d{1,10})"
_TIME = rb"(?P<whole>\d{1,13})(?:\.(?P<fraction>\d{1,6}))?"
_BUS = rb"(?P<bus>\d{1,3})"
_ID = rb"(?P<id>[0-9A-Fa-f]{1,8})"
_DATA = rb"(?P<data>(?: +[0-9A-Fa-f]{2}(?: [0-9A-Fa-f]{2})*)?)"
_LENGTH = rb"(?P<length>\d{1,2})"
_FIRST = (_NUMBER + rb"\)", _TIME)
_LAST = (_ID, _LENGTH + _DATA + rb"(?=\s|$)")
_FORMS = {
    TRCFileVersion.V1_0: (*_FIRST, *_LAST),
    TRCFileVersion.V1_1: (*_FIRST, rb"[RT]x", *_LAST),
    TRCFileVersion.V1_2: (*_FIRST, _BUS, rb"[RT]x", *_LAST),
    TRCFileVersion.V1_3: (*_FIRST, _BUS, rb"[RT]x", _ID, rb"[!-~]+", _LAST[1]),
}
_COLUMNS = {
    "N": _NUMBER,
    "O": _TIME,
    "T": rb"(?P<type>DT|FD|FB|FE|BI)",
    "B": _BUS,
    "I": _ID,
    "d": rb"[RT]x",
    "R": rb"[!-~]+",
    "l": _LENGTH,
    "L": _LENGTH,
}
_VERSION = re.compile(rb"\s*;\$FILEVERSION=([\d.]+)")
_NAMED = re.compile(rb"\s*;\$COLUMNS=([A-Za-z,]+)")
_VERSIONS = {
    b"1.0": TRCFileVersion.V1_0,
    b"1.1": TRCFileVersion.V1_1,
    b"1.2": TRCFileVersion.V1_2,
    b"1.3": TRCFileVersion.V1_3,
    b"2.0": TRCFileVersion.V2_0,
    b"2.1": TRCFileVersion.V2_1,
}
_WITHOUT_RESERVED = re.compile(rb"(\s*\d+\)\s+\S+\s+\d+\s+\S+\s+[0-9A-Fa-f]+)\s+")
# Behind the head: makes the reader end it, and is no frame in any version.
_NO_FRAME = b"0 0 FFFFFFFF" + b" x" * 20 + b"\n"


class TrcForm(TraceForm):
    """Form of the lines of one file.

    Args:
        first: First lines of the file, as far as its head may reach.

    Raises:
        Exception: The head cannot be read; python-can raises whatever it meets.

    """

    first_bus = 1  # of python-can's messages

    def __init__(self, first: Sequence[bytes]) -> None:
        head = []
        for line in first:
            if not line.lstrip().startswith(b";"):
                break
            head.append(line)
        stated = next((match[1] for line in head if (match := _VERSION.match(line))), b"1.0")
        if stated not in _VERSIONS:
            known = ", ".join(version.decode() for version in _VERSIONS)
            raise ValueError(f"version {stated.decode()} of PEAK's format; supported: {known}")
        version = _VERSIONS[stated]
        named = next((match[1] for line in head if (match := _NAMED.match(line))), b"")
        self._columns = named.decode("latin-1").split(",") if version >= TRCFileVersion.V2_0 else []
        self._lacks_way = bool(self._columns) and "d" not in self._columns
        self._lacks_reserved = version is TRCFileVersion.V1_2
        self._lines = PythonCanLines(can.TRCReader, list(map(self._plain_head, head)))
        reader = self._lines.reader_behind(_NO_FRAME)
        self._form = _form(version, self._columns)
        start = reader.start_time if version >= TRCFileVersion.V1_1 else None
        self._start_ns = since_1970_us(start) * 1000 if start else 0
        has_stray_columns = bool(reader.columns) and not self._columns
        if abs(self._start_ns) > LAST_US * 1000 or has_stray_columns:
            self._form = None
        self._lost = 0

    def find_layout(self, line: bytes) -> Layout | None:
        """Layout of a line; None where only python-can can read it."""
        match = self._form and self._form.match(line)
        if not match:
            return None
        stated = int(match["length"])
        kind = Kind.DATA
        if self._columns and match["type"] != b"DT":
            kind = Kind.FD
        # A code of a length up to 8 is that length.
        is_code = "l" not in self._columns and kind is Kind.FD
        length = LENGTH_CODES[stated] if is_code and stated < len(LENGTH_CODES) else stated
        if length not in FD_LENGTHS if kind is Kind.FD else length > 8:
            return None
        if not length and line[match.end() :].strip():
            return None  # the mark of a remote frame stands where the payload would
        return learn_layout(
            match,
            unit_ns=10**6,
            start_ns=self._start_ns,
            length=length,
            kind=kind,
            is_extended=len(match["id"]) > 4,
            is_last=bool(self._columns) or not length,
        )

    def messages(self, lines: Sequence[bytes]) -> list[OddLine]:
        """What python-can makes of each line, comments and blank lines left out."""
        odd_lines = [OddLine(None)] * len(lines)
        held = [n for n, line in enumerate(lines) if line.strip() and not _is_comment(line)]
        plain = [self._plain(lines[n]) for n in held]
        for place, outcome in zip(held, self._lines.read(plain), strict=True):
            odd_lines[place] = OddLine(outcome)
            self._lost += not isinstance(outcome, can.Message)
        return odd_lines

    def _plain_head(self, line: bytes) -> bytes:
        """A line of the head for python-can's reader."""
        if self._lacks_way and _NAMED.match(line):
            columns = self._columns
            place = columns.index("I") + 1 if "I" in columns else len(columns)
            filled = ",".join([*columns[:place], "d", *columns[place:]])
            return f";$COLUMNS={filled}\n".encode()
        return _VERSION.sub(b";$FILEVERSION=1.3", line) if self._lacks_reserved else line

    def _plain(self, line: bytes) -> bytes:
        """A line for python-can's reader, with the columns that it needs."""
        if self._lacks_reserved:
            return _WITHOUT_RESERVED.sub(rb"\1 - ", line, count=1)
        if self._lacks_way and "I" in self._columns:
            words = line.split(maxsplit=self._columns.index("I") + 1)
            return b" ".join([*words[:-1], b"Rx", words[-1]]) if len(words) > 1 else line
        return line

    def kind_without_frame(self, line: bytes) -> str | None:
        """Kind of a line that holds no frame, as the report counts it; None: not counted."""
        return "other" if line.strip() and not _is_comment(line) else None

    def tell(self, report: ReadReport) -> None:
        """Put what the lines say together into the notes of the recording."""
        if self._lost:
            frames = sum(report.kinds[kind] for kind in ("frame", "fd", "remote", "error"))
            report.notes.append(
                f"python-can recognises no frame in {self._lost} of {self._lost + frames} lines"
            )


def _is_comment(line: bytes) -> bool:
    return line.lstrip().startswith(b";")


def _form(version: TRCFileVersion, columns: Sequence[str]) -> re.Pattern[bytes] | None:
    """Form of the lines; None where the columns are others than PEAK's."""
    if not columns:
        parts = _FORMS.get(version)
        return re.compile(rb" +".join(parts)) if parts else None
    *front, last = columns
    lengths = {"l", "L"} & set(columns)
    if not {"O", "T", "I"} <= set(front) <= _COLUMNS.keys() or last != "D":
        return None
    if len(lengths) != 1 or columns[-2] not in lengths:
        return None
    start = b"" if columns[0] == "N" else rb"\s*"
    named = [_COLUMNS[column] for column in front]
    return re.compile(start + rb" +".join(named) + _DATA + rb"\s*$")
