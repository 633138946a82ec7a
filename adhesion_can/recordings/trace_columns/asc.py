"""Lines of Vector's text logs (.asc)."""

import re
from collections.abc import Sequence

import can

from adhesion_can.bus.block import Kind
from adhesion_can.recordings.candump import DIFFERENCES, FD_LENGTHS, LAST_US, ReadReport
from adhesion_can.recordings.trace_columns.line_layouts import Layout, learn_layout
from adhesion_can.recordings.trace_columns.odd_lines import OddLine, PythonCanLines

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
_EVENTS = re.compile(rb"\s*(?:no)?\s*internal\s+events\s+logged", re.IGNORECASE)
_STAMPED = re.compile(rb"\s*(\d{1,10})\.(\d{1,9})\s")
_AROUND = re.compile(
    rb"\s*(?:$|//|;|#|date\s|base\s|(?:no\s*)?internal\s+events|(?:begin|end)\s+triggerblock"
    rb"|previous\s+log)",
    re.IGNORECASE,
)
"""Lines without a stamp that Vector's tools write around the events."""
_BEGINS = re.compile(rb"\s*\d+\.\d+\s+Start of measurement")
_CODES = sorted(FD_LENGTHS)
"""Lengths of payloads by their code, bytes."""


class AscForm:
    """Form of the lines of one file, and what its lines say together.

    Args:
        first: First lines of the file, as far as its head may reach.

    Raises:
        Exception: The head cannot be read; python-can raises whatever it meets.

    """

    start_ns = 0
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
        self._open = 0

    def find_layout(self, line: bytes) -> Layout | None:
        """Layout of a line; None where only python-can can read it."""
        if not self._is_hex or self._clock_ns is not None:
            return None
        match = _CLASSIC.match(line)
        kind = Kind.DATA
        if not match:
            match = _FD.match(line)
            kind = Kind.FD
        if not match:
            return None
        length = int(match["length"])
        if kind is Kind.FD and not 0 < length == _CODES[int(match["code"], 16)]:
            return None
        return learn_layout(
            match,
            unit_ns=10**9,
            length=length,
            kind=kind,
            extended=bool(match["x"]),
            is_last=False,
        )

    def read(self, lines: Sequence[bytes]) -> list[OddLine]:
        """What python-can makes of each line, and its stamp."""
        for line in lines:
            lower = line[:20].lower()
            self._open += lower.startswith(b"begin triggerblock")
            self._open -= lower.startswith(b"end triggerblock")
        return list(map(OddLine, self._lines.read(lines), map(self._stamp, lines)))

    def _stamp(self, line: bytes) -> int | None:
        match = _STAMPED.match(line)
        t_ns = int(match[1]) * 10**9 + int(match[2].ljust(9, b"0")) if match else None
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
        if self._open > 0:
            report.notes.append("the file lacks its last line 'End TriggerBlock': it may be cut")
