"""Lines of Vector's text logs (.asc)."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import can

from adhesion_can.bus.block import Kind
from adhesion_can.plurals import counted
from adhesion_can.recordings.candump import DIFFERENCES, LAST_US, ReadReport
from adhesion_can.recordings.text_columns.line_layouts import Layout, learn_layout
from adhesion_can.recordings.text_columns.odd_lines import (
    LENGTH_CODES,
    OddLine,
    PythonCanLines,
    TraceForm,
)

_STAMP = rb"\s*(?P<whole>\d{1,10})\.(?P<fraction>\d{1,9}) +"
_DATA = rb"(?P<data>(?: +[0-9A-Fa-f]{2}(?: [0-9A-Fa-f]{2})*)?)(?=\s|$)"
_CLASSIC = re.compile(
    _STAMP
    + rb"(?P<bus>\d{1,4}) +(?P<id>[0-9A-Fa-f]{1,8})(?P<x>x?) +[RT]x +d +(?P<length>[0-8])"
    + _DATA
)
_FD = re.compile(
    _STAMP
    + rb"CANFD +(?P<bus>\d{1,4}) +[RT]x +(?P<id>[0-9A-Fa-f]{1,8})(?P<x>x?) +(?:[A-Za-z_][!-~]* +)?"
    + rb"[01] +[01] +(?P<code>[0-9A-Fa-f]) +(?P<length>\d{1,2})"
    + rb"(?P<data> +[0-9A-Fa-f]{2}(?: [0-9A-Fa-f]{2})*)(?=\s|$)"
)
_HEAD = re.compile(
    rb"\s*(?:date\s+\w+\s+.+|base\s+(?P<base>hex|dec)(?:\s+timestamps\s+(?P<form>\w+))?|//.*)",
    re.IGNORECASE,
)
_LONG = re.compile(
    _STAMP
    + rb"(?P<bus>\d{1,4}) +(?P<id>[0-9A-Fa-f]{1,8})(?P<x>x?) +[RT]x +d +(?P<length>9|1[0-5])"
    + _DATA
)
"""CAN FD in a line of classic CAN, as some converters write it: the number codes the length."""
_PARTS = re.compile(
    rb"(?P<stamp>\d{1,10}\.\d{1,9})\s+(?P<bus>\d{1,4})\s+(?P<name>\S+)(?P<rest>\s+(?P<way>[RT]x)\s+"
    rb"[dr](?:\s+(?P<code>\d{1,2})(?P<data>(?:\s+[0-9A-Fa-f]{2})*))?(?=\s|$).*)",
    re.DOTALL,
)
_SAID = re.compile(rb"\bID = (?P<id>\d{1,10})(?P<x>x?)\s*$")
"""Id at the end of a line whose name may stand in its place in front."""
_STAMPED = re.compile(rb"\s*(-?)(\d{1,10})\.(\d{1,9})\s")
_AROUND = re.compile(
    rb"\s*(?:$|//|;|#|date\s|base\s|(?:no\s*)?internal\s+events|(?:begin|end)\s+triggerblock"
    rb"|previous\s+log)",
    re.IGNORECASE,
)
"""Lines without a stamp that Vector's tools write around the events."""
_BEGINS = re.compile(rb"\s*\d+\.\d+\s+Start of measurement")
_NUMBER = {True: re.compile(rb"[0-9A-Fa-f]{1,8}[xX]?"), False: re.compile(rb"\d{1,10}[xX]?")}
"""Ids by whether they are hexadecimal."""
_MONTHS = {
    name: number
    for number, names in enumerate(
        ("jan", "feb", "mar mär", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov",
         "dec dez"), 1,
    )
    for name in names.split()
}  # fmt: skip
_DATE = re.compile(
    r"date\s+\w+\s+(?P<month>\w{3})\s+(?P<day>\d{1,2})\s+(?P<hour>\d{1,2}):(?P<min>\d\d):(?P<s>\d\d)"
    r"(?:\.(?P<f>\d+))?(?:\s+(?P<half>[AaPp][Mm]))?\s+(?P<year>\d{4})$",
    re.IGNORECASE,
)


def head_date_us(first: Sequence[bytes]) -> int | None:
    """Date in a head, µs since 1970 of a clock without a zone; None where it has none.

    Args:
        first: First lines of a file.

    """
    for line in first:
        if not _HEAD.match(line):
            break
        if match := _DATE.match(line.decode("utf-8", "replace").strip()):
            year, month = int(match["year"]), _MONTHS.get(match["month"].lower())
            hour = int(match["hour"])
            if match["half"]:
                hour = hour % 12 + 12 * (match["half"].lower() == "pm")
            try:
                date = datetime(
                    year, month or 0, int(match["day"]), hour, int(match["min"]), int(match["s"]),
                    tzinfo=UTC,
                )  # fmt: skip
            except ValueError:
                return None
            part = int((match["f"] or "0").ljust(6, "0")[:6])
            return round(date.timestamp()) * 1_000_000 + part
    return None


class AscForm(TraceForm):
    """Form of the lines of one file, and what its lines say together.

    Args:
        first: First lines of the file, as far as its head may reach.

    Raises:
        Exception: The head cannot be read; python-can raises whatever it meets.

    """

    first_bus = 0  # of python-can's messages

    def __init__(self, first: Sequence[bytes]) -> None:
        head: list[bytes] = []
        base, stamps = b"hex", b""
        for line in first:
            match = _HEAD.match(line)
            if not match:
                break
            head.append(line)
            if match["base"]:
                base, stamps = match["base"].lower(), (match["form"] or b"").lower()
        # python-can drops the line behind a head that this one does not end.
        self._lines = PythonCanLines(can.ASCReader, [*head, b"no internal events logged\n"])
        self._lines.reader_behind(b"\n")
        self._is_hex = base == b"hex"
        self._clock_ns = 0 if stamps == b"relative" else None
        self._has_names = any(self._is_named(line) for line in first)
        self._open = self._nameless = 0

    def find_layout(self, line: bytes) -> Layout | None:
        """Layout of a line; None where only python-can can read it."""
        if not self._is_hex or self._clock_ns is not None or self._has_names:
            return None
        kind = Kind.FD
        if match := _CLASSIC.match(line):
            kind, length = Kind.DATA, int(match["length"])
        elif match := _FD.match(line):
            length = int(match["length"])
            if not 0 < length == LENGTH_CODES[int(match["code"], 16)]:
                return None
        elif match := _LONG.match(line):
            length = LENGTH_CODES[int(match["length"])]
        else:
            return None
        return learn_layout(
            match,
            unit_ns=10**9,
            length=length,
            kind=kind,
            is_extended=bool(match["x"]),
            is_last=False,
        )

    def messages(self, lines: Sequence[bytes]) -> list[OddLine]:
        """What python-can makes of each line, and its stamp."""
        for line in lines:
            lower = line[:20].lower()
            self._open += lower.startswith(b"begin triggerblock")
            self._open -= lower.startswith(b"end triggerblock")
        read = self._lines.read(list(map(self._plain, lines)))
        return list(map(OddLine, read, map(self._stamp, lines)))

    def _is_named(self, line: bytes) -> bool:
        """Whether a name stands in the place of a line's id."""
        parts, said = _PARTS.match(line.lstrip()), _SAID.search(line)
        if parts is None or said is None or parts["name"][:1].isdigit():
            return False  # no name of a database begins with a digit
        return bool(parts["name"].lower() != self._id_text(said).lower())

    def _id_text(self, said: re.Match[bytes]) -> bytes:
        """Id as the lines of the file have it."""
        number = int(said["id"])
        return (b"%X" if self._is_hex else b"%d") % number + said["x"]

    def _plain(self, line: bytes) -> bytes:
        """A line as python-can reads it: stamp above 0, id in its place, CAN FD said to be it."""
        stamped = _STAMPED.match(line)
        plain = line.lstrip().removeprefix(b"-") if stamped and stamped[1] else line
        parts = _PARTS.match(plain.lstrip())
        if parts is None:
            return plain
        name, said = parts["name"], _SAID.search(plain)
        if said and self._is_named(plain):
            name = self._id_text(said)
        elif not said and not _NUMBER[self._is_hex].fullmatch(name):
            self._nameless += 1
        code, data = int(parts["code"] or 0), (parts["data"] or b"").split()
        if 8 < code < len(LENGTH_CODES) and len(data) >= LENGTH_CODES[code]:
            length, octets = LENGTH_CODES[code], b" ".join(data)
            text = b"%s CANFD %s %s %s 0 0 %x %d %s\n"
            return text % (parts["stamp"], parts["bus"], parts["way"], name, code, length, octets)
        if name is parts["name"]:
            return plain
        return b"%s %s %s%s" % (parts["stamp"], parts["bus"], name, parts["rest"])

    def _stamp(self, line: bytes) -> int | None:
        match = _STAMPED.match(line)
        t_ns = int(match[2]) * 10**9 + int(match[3].ljust(9, b"0")) if match else None
        t_ns = -t_ns if t_ns is not None and match and match[1] else t_ns
        if self._clock_ns is None or t_ns is None:
            return t_ns
        # Each event counts from the one before, frame or not; python-can takes no notice of it.
        self._clock_ns = min(self._clock_ns + t_ns, LAST_US * 1000)
        return self._clock_ns

    def kind_without_frame(self, line: bytes) -> str | None:
        """Kind of a line that holds no frame, as the report counts it; None: not counted."""
        if _STAMPED.match(line):
            return None if _BEGINS.match(line) else "other"
        return None if _AROUND.match(line) else "malformed"

    def tell(self, report: ReadReport) -> None:
        """Put what the lines say together into the notes of the recording."""
        if self._clock_ns is not None:
            report.notes.insert(0, DIFFERENCES)
        if self._nameless:
            count = counted(self._nameless, "line")
            report.notes.append(f"{count} with a name in place of the id: log ids as numbers")
        if self._open > 0:
            report.notes.append(
                "the file lacks its last line 'End TriggerBlock': it may be truncated"
            )
