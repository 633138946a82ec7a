"""Frames of a log of another tool, line by line, by its form."""

import base64
import binascii
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

from adhesion_can.bus.frame import MOST_ID, Frame
from adhesion_can.recordings.candump import FD_LENGTHS, LAST_US, ReadReport, since_1970_us
from adhesion_can.recordings.frame_tables.forms import Clock, Fields, LineForm

_LARGEST_STANDARD = 0x7FF
_DAY_US = 86_400_000_000
_UNITS_US = {Clock.SECONDS: 1_000_000, Clock.MILLIS: 1000, Clock.MICROS: 1}
_NUMBER = re.compile(r"(\d{1,19})(?:[.,](\d{1,12}))?")
_CLOCK = re.compile(r"(\d{1,2}):(\d\d):(\d\d)([:.,])(\d{1,9})")
_DIGITS = re.compile(r"(?:(\d{2}|\d{4}|\d{8})T)?(\d{2}):?(\d{2}):?(\d{2})[.:]?(\d{3})")
_BEGUN = re.compile(r"(?:START DATE AND TIME )(\d{1,2}):(\d{1,2}):(\d{4})\b")
_HEAD_TIME = re.compile(r"#\s*Time:\s*(\d{4})(\d{2})(\d{2})T")
_TRUE = frozenset({"1", "true", "t", "x", "ext", "29", "9", "yes"})
_NO_DATA_BYTE = re.compile(r"0[xX]|[\s,;]")


@dataclass(slots=True)
class _Head:
    """What the lines in front of the frames say.

    Attributes:
        day: Day on which the recording began; None where it is not said.
        is_decimal: Whether ids and payloads are decimal.
        is_relative: Whether each stamp counts from the one before.

    """

    day: datetime | None = None
    is_decimal: bool = False
    is_relative: bool = False

    def take(self, line: str) -> None:
        """Take a line that is no frame."""
        self.is_decimal |= "***DEC***" in line
        self.is_relative |= "***RELATIVE MODE***" in line
        if match := _BEGUN.search(line):
            self.day = _date(match[3], match[2], match[1])
        elif match := _HEAD_TIME.match(line):
            self.day = _date(match[1], match[2], match[3])


def read_frame_table(lines: Iterable[bytes], form: LineForm, report: ReadReport) -> Iterator[Frame]:
    """Frames of the lines of a file, in their order.

    Args:
        lines: Lines with their line ends.
        form: Their form.
        report: Statistics, in which lines without a frame are counted.

    """
    report.remarks.insert(0, f"read as {form.name}")
    head = _Head()
    clock = _StampReader(form.clock, head)
    is_behind_head = False
    for number, raw in enumerate(_split(lines), start=1):
        line = raw.decode("utf-8", "replace")
        fields = form.fields(line)
        frame = None if fields is None else _frame(fields, clock, form, head)
        if frame is not None:
            is_behind_head = True
            yield frame
            continue
        head.take(line)
        kind = "malformed" if line.strip() else "blank"
        if line.lstrip().startswith(("***", "#", "//", ";", "@")) or not is_behind_head:
            kind = "comment"
        report.skip(kind, number, is_whole=raw.endswith(b"\n"))


def _split(lines: Iterable[bytes]) -> Iterator[bytes]:
    """Lines of a file of which some end with CR alone."""
    rest = b""
    for line in lines:
        *whole, rest = (rest + line).splitlines(keepends=True)
        yield from whole
        if rest.endswith((b"\n", b"\r")):
            yield rest
            rest = b""
    if rest:
        yield rest


def _frame(fields: Fields, clock: "_StampReader", form: LineForm, head: _Head) -> Frame | None:
    """Frame of a line; None where its texts are none."""
    try:
        number = int(fields.id, 10 if form.decimal_id or head.is_decimal else 16)
        data = _payload(fields, form, is_decimal=head.is_decimal)
        t_us = clock.read(fields.time)
    except (ValueError, binascii.Error):
        return None
    if t_us is None or abs(t_us) > LAST_US or not 0 <= number <= MOST_ID:
        return None
    is_extended = _is_true(fields.extended) or number > _LARGEST_STANDARD
    is_fd = _is_true(fields.fd) or fields.fd.lower().endswith("fd") or len(data) > 8
    if len(data) not in FD_LENGTHS or (len(data) > 8 and not is_fd):
        return None
    is_remote, is_error = _is_remote(fields), _is_true(fields.error)
    bus = fields.bus.strip()
    return Frame(
        t_us=t_us,
        arbitration_id=number,
        data=b"" if is_remote or is_error else data,
        channel=f"can{bus}" if bus.isdigit() else bus,
        is_extended=is_extended and not is_error,
        is_fd=is_fd,
        is_remote=is_remote,
        is_error=is_error,
    )


def _is_remote(fields: Fields) -> bool:
    return _is_true(fields.remote) or fields.remote in ("r", "R")


def _is_true(text: str) -> bool:
    return text.strip().lower() in _TRUE


def _payload(fields: Fields, form: LineForm, *, is_decimal: bool) -> bytes:
    """Payload of a line, no longer than its length says.

    Raises:
        ValueError: It is none.

    """
    text = fields.data.strip()
    if is_decimal:
        data = bytes(map(int, text.split()))
    elif form.is_base64:
        data = base64.b64decode(text, validate=True)
    else:
        data = bytes.fromhex(_NO_DATA_BYTE.sub("", text))
    stated = int(fields.length) if fields.length.strip() else len(data)
    has_data = not (_is_remote(fields) or _is_true(fields.error))
    if has_data and len(data) < stated:
        raise ValueError("its payload is truncated")
    # A number above 8 may code the length.
    return data[:stated] if stated <= 8 and fields.fd.strip() != "1" else data


class _StampReader:
    """Stamps of lines, µs.

    Args:
        clock: What they are.
        head: What the file's head says.

    """

    def __init__(self, clock: Clock, head: _Head) -> None:
        self._clock, self._head = clock, head
        self._last_us = self._days_us = 0

    def read(self, text: str) -> int | None:
        """Stamp of a text, µs; None where it is none."""
        if self._clock in _UNITS_US:
            match = _NUMBER.fullmatch(text.strip())
            if match is None:
                return None
            unit = _UNITS_US[self._clock]
            part = (match[2] or "").ljust(12, "0")
            return int(match[1]) * unit + round(int(part) * unit / 10**12)
        of_day = self._of_day(text.strip())
        if of_day is None:
            return None
        day, t_us = of_day
        if self._head.is_relative:
            self._last_us += t_us
            return self._last_us
        if day is None:
            if t_us + self._days_us < self._last_us - _DAY_US // 2:
                self._days_us += _DAY_US
            t_us += self._days_us
            self._last_us = t_us
            day = self._head.day
        return t_us if day is None else t_us + since_1970_us(day)

    def _of_day(self, text: str) -> tuple[datetime | None, int] | None:
        """Day, where the text has it, and time of the day, µs."""
        if self._clock is Clock.TIME_OF_DAY:
            match = _CLOCK.fullmatch(text)
            if match is None:
                return None
            hours, minutes, seconds, mark, part = match.groups()
            # Behind a colon stand whole milliseconds, not always padded, or tenths of them.
            part = part.zfill(3) if mark == ":" else part
            return None, _micros(hours, minutes, seconds, part)
        match = _DIGITS.fullmatch(text)
        if match is None:
            return None
        return self._date_of(match[1]), _micros(*match.groups()[1:])

    def _date_of(self, digits: str | None) -> datetime | None:
        """Day of a stamp's digits, of which the head gives what they lack."""
        base = self._head.day
        if not digits or (base is None and len(digits) < 8):
            return _date("1970", "1", digits[-2:]) if digits else None
        year = digits[:-4] or str(base.year if base else 1970)
        month = digits[-4:-2] or str(base.month if base else 1)
        return _date(year, month, digits[-2:])


def _micros(hours: str, minutes: str, seconds: str, fraction: str) -> int:
    whole = int(hours) * 3600 + int(minutes) * 60 + int(seconds)
    return whole * 1_000_000 + round(int(fraction.ljust(9, "0")) / 1000)


def _date(year: str, month: str, day: str) -> datetime | None:
    try:
        return datetime(int(year), int(month), int(day), tzinfo=UTC)
    except ValueError:
        return None
