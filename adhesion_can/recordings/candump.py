"""candump text: a reader that no line can stop, and a writer.

Reads what can-utils writes: `candump -L` and `-l` lines, the columns of `-ta`, `-tz`, `-td`, `-tA`
and `-x`, CAN FD, remote and error frames, LF and CR LF. A line of any other form is counted with
its number and passed over.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from itertools import accumulate, chain, islice, pairwise

from adhesion_can.bus.frame import MARKS, Frame, Mark

ERROR_FLAG = 0x20000000
LAST_US = 9_223_372_036_000_000
"""Latest stamp of a recording, in the year 2262: later ones do not fit 64 bits as ns."""
HEAD_LINES = 256
"""Number of first lines that show whether stamps are differences."""
DIFFERENCES = "time stamps read as differences (candump -td) and summed"
FD_LENGTHS = frozenset((*range(9), 12, 16, 20, 24, 32, 48, 64))
_LINE_LIMIT = 16384  # a CAN XL line has 4200 characters; past this a file is not text

_LOG = re.compile(
    rb"\((\d{1,15})\.(\d{1,9})\)\s+(\S{1,64})\s+([0-9A-Fa-f]{1,8})#(#?)([0-9A-Fa-fRr.:]*)"
    rb"(?:_[0-9A-Fa-f])?(?:\s+[RrTt])?$"
)
_MARK = re.compile(rb"<(\d{1,15})\.(\d{6})> ([a-z-]{1,32}) 000#\s*$")
_COLUMNS = re.compile(
    rb"\s*\(([^)]{1,40})\)\s+(\S{1,64})\s+(?:[RT]X\s+\S+\s+\S+\s+)?([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+"
    rb"(?:\[(\d{1,2})\]|\{[0-9A-Fa-f]\})\s*(remote request|(?:[0-9A-Fa-f]{2}(?:\s+|$))*)(.*)$"
)
_UNTIMED = re.compile(rb"\s*\S{1,64}\s+(?:[0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})\s+\[\d{1,2}\]\s")
_FINE_STAMP = re.compile(rb"\s*[(<]\s*(\d+)\.(\d{7,9})\d*\s*[)>]")


@dataclass
class ReadReport:
    """Statistics of a read file.

    Attributes:
        kinds: Number of lines or frames by kind: 'frame', 'fd', 'remote', 'error', 'mark',
            'blank', 'comment', 'malformed', 'untimed', 'cut', and 'other' for what is no frame in
            formats that hold other things too.
        bad_lines: Numbers of the first lines that were passed over.
        backwards: Number of frames stamped before the frame in front of them.
        notes: What is wrong with the file, a sentence each.
        remarks: What the user should know of it and is not wrong, a sentence each.

    """

    kinds: Counter[str] = field(default_factory=Counter)
    bad_lines: list[int] = field(default_factory=list)
    backwards: int = 0
    notes: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    @property
    def passed_over(self) -> int:
        """Number of lines that could not be read."""
        return sum(self.kinds[kind] for kind in ("malformed", "untimed", "cut"))

    def take(self, other: "ReadReport") -> None:
        """Become as another one is."""
        self.kinds, self.bad_lines = other.kinds, other.bad_lines
        self.backwards, self.notes = other.backwards, other.notes
        self.remarks = other.remarks

    def skip(self, kind: str, number: int, *, is_whole: bool) -> None:
        """Count a line that gave no frame.

        Args:
            kind: Kind of the line, as `parse_line` names it.
            number: Number of the line, from 1 on.
            is_whole: Whether the line has its line end.

        """
        self.kinds["cut" if kind == "malformed" and not is_whole else kind] += 1
        if kind not in ("blank", "comment", "other") and len(self.bad_lines) < 10:
            self.bad_lines.append(number)


def looks_like_candump(line: bytes) -> bool:
    """Whether a line is one that candump, or our own log, writes."""
    text = line.strip()
    if len(text) > _LINE_LIMIT:
        return False
    return any(form.match(text) for form in (_LOG, _COLUMNS, _MARK, _UNTIMED))


def read_candump(lines: Iterable[bytes], report: ReadReport) -> Iterator[Frame | Mark]:
    """Frames of candump text, in the order of its lines.

    Args:
        lines: Lines with their line ends; the last one may be cut.
        report: Statistics, filled while reading.

    """
    numbered = enumerate(lines, start=1)
    head = list(islice(numbered, HEAD_LINES))
    differences = times_are_differences(line for _, line in head)
    if differences:
        report.notes.insert(0, DIFFERENCES)
    clock = last = 0
    for number, line in chain(head, numbered):
        item = read_line(line)
        if isinstance(item, str):
            report.skip(item, number, is_whole=line.endswith(b"\n"))
            continue
        if isinstance(item, Mark):
            report.kinds["mark"] += 1
        else:
            if differences:
                clock = add_difference(clock, item.t_us)
                item = item._replace(t_us=clock)
            report.kinds[frame_kind(item)] += 1
            report.backwards += item.t_us < last
            last = item.t_us
        yield item


def frame_kind(frame: Frame) -> str:
    """Kind of a frame, as `ReadReport` counts it."""
    if frame.is_error:
        return "error"
    if frame.is_remote:
        return "remote"
    return "fd" if frame.is_fd else "frame"


def add_difference(t_us: int, difference_us: int) -> int:
    """A stamp and the difference to the next, kept within what a stamp can be."""
    return max(-LAST_US, min(t_us + difference_us, LAST_US))


def read_line(line: bytes) -> Frame | Mark | str:
    """One line as `parse_line` reads it; a stamp that does not fit 64 bits as ns is malformed."""
    item = parse_line(line)
    return item if isinstance(item, str) or abs(item.t_us) <= LAST_US else "malformed"


def stamp_ns(line: bytes, t_us: int) -> int:
    """Stamp of a line that `parse_line` reads, to all its digits, ns.

    Args:
        line: Line with a frame or a mark.
        t_us: Time stamp of the line, µs.

    """
    match = _FINE_STAMP.match(line)
    if not match:
        return t_us * 1000
    return int(match[1]) * 10**9 + int(match[2].ljust(9, b"0"))


def parse_line(line: bytes) -> Frame | Mark | str:
    """One line: a frame, a mark, or the kind of line that it is instead."""
    text = line.strip() if len(line) <= _LINE_LIMIT else b"?"
    if not text:
        return "blank"
    if text[:1] == b"(" and (match := _LOG.match(text)):
        return _log_frame(match)
    if match := _COLUMNS.match(text):
        return _column_frame(match)
    if text[:1] == b"<" and (match := _MARK.match(text)):
        name = match[3].decode()
        return (
            Mark(int(match[1]) * 1_000_000 + int(match[2]), name) if name in MARKS else "malformed"
        )
    if text[:1] in (b"#", b";", b"*") or text[:2] == b"//":
        return "comment"
    return "untimed" if _UNTIMED.match(line) else "malformed"


def _micros(seconds: bytes, fraction: bytes) -> int:
    digits = len(fraction)
    value = int(fraction)
    micros = value * 10 ** max(6 - digits, 0)
    if digits > 6:
        micros = round(value / 10 ** (digits - 6))
    return int(seconds) * 1_000_000 + int(micros)


def _log_frame(match: re.Match[bytes]) -> Frame | str:
    seconds, fraction, channel, can_id, fd, payload = match.groups()
    if len(can_id) not in (3, 8):
        return "malformed"
    remote = payload[:1] in (b"R", b"r") and not fd
    frame = _frame_without_data(_micros(seconds, fraction), channel, can_id, is_remote=remote)
    if isinstance(frame, str) or not frame.is_data:
        return frame
    if fd:
        flags, payload = payload[:1], payload[1:]
        if not flags.isalnum():
            return "malformed"
    data = _bytes(payload.replace(b".", b""))
    if data is None or not (len(data) in FD_LENGTHS if fd else len(data) <= 8):
        return "malformed"
    return frame._replace(data=data, is_fd=bool(fd))


def _frame_without_data(
    t_us: int, channel: bytes, can_id: bytes, *, is_remote: bool
) -> Frame | str:
    """Frame of an id of 3 or 8 digits, whose payload is still to come where it has one."""
    name, number, extended = channel.decode("latin-1"), int(can_id, 16), len(can_id) == 8
    if extended and number & ERROR_FLAG:
        return Frame(t_us, number & 0x1FFFFFFF, b"", name, is_error=True)
    if number > (0x1FFFFFFF if extended else 0x7FF):
        return "malformed"
    return Frame(t_us, number, b"", name, extended, is_remote=is_remote)


def _column_frame(match: re.Match[bytes]) -> Frame | str:
    stamp, channel, can_id, length, payload, _ = match.groups()
    t_us = _column_time(stamp.decode("latin-1").strip())
    if t_us is None:
        return "malformed"
    remote = payload.startswith(b"remote")
    frame = _frame_without_data(t_us, channel, can_id, is_remote=remote)
    if isinstance(frame, str) or not frame.is_data:
        return frame
    # What follows the payload (-a) may look like more of it: the length gives its end.
    # {E} in place of [8] is the raw length code of a frame with all its 8 bytes (-8).
    size = 8 if length is None else int(length)
    data = _bytes(b"".join(payload.split()[:size]))
    if data is None or len(data) != size or size not in FD_LENGTHS:
        return "malformed"
    return frame._replace(data=data, is_fd=len(length or b"8") == 2)


def _column_time(stamp: str) -> int | None:
    """Stamp of -ta, -tz, -td (seconds) or -tA (date, read as UTC), µs."""
    whole, _, fraction = stamp.partition(".")
    if whole.isascii() and whole.isdigit() and fraction.isascii() and fraction.isdigit():
        return _micros(whole.encode(), fraction.encode()[:9])
    try:
        date = datetime.strptime(stamp, "%Y-%m-%d %H:%M:%S.%f").replace(tzinfo=UTC)
    except ValueError:
        return None
    return since_1970_us(date)


def since_1970_us(date: datetime) -> int:
    """Time from the start of 1970 in UTC to a date with a zone, µs, exact."""
    return (date - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1)


def _bytes(digits: bytes) -> bytes | None:
    if len(digits) % 2:
        return None
    try:
        return bytes.fromhex(digits.decode("ascii"))
    except ValueError:
        return None


def times_are_differences(lines: Iterable[bytes]) -> bool:
    """Whether columns carry -td stamps: they start at 0 and do not keep rising."""
    times = []
    for line in lines:
        match = _COLUMNS.match(line.rstrip())
        t_us = _column_time(match[1].decode("latin-1").strip()) if match else None
        if t_us is not None:
            times.append(t_us)
    if len(times) < 3 or times[0] != 0:
        return False
    # Stamps reach the highest so far nearly always, but for a step back now and then; differences
    # reach it once in a burst of frames.
    highest = accumulate(times, max)
    reached = sum(t == top for t, top in zip(times, highest, strict=True))
    falls = any(b < a for a, b in pairwise(times))
    return falls and reached < 0.8 * len(times)


def format_frame(frame: Frame, channel: str = "can0") -> str:
    """A frame as `candump -L` writes it, with its line end.

    Args:
        frame: Data, remote or FD frame, stamped at 0 or later.
        channel: Name of the bus where the frame has none.

    """
    seconds, micros = divmod(frame.t_us, 1_000_000)
    number = f"{frame.arbitration_id:08X}" if frame.is_extended else f"{frame.arbitration_id:03X}"
    if frame.is_error:
        number = f"{frame.arbitration_id | ERROR_FLAG:08X}"
    payload = "R" if frame.is_remote else frame.data.hex().upper()
    flags = "#0" if frame.is_fd else ""
    return f"({seconds}.{micros:06d}) {frame.channel or channel} {number}#{flags}{payload}\n"


def format_mark(mark: Mark) -> str:
    """A mark as a line: canplayer and cantools pass over it, python-can reads an empty frame."""
    seconds, micros = divmod(mark.t_us, 1_000_000)
    return f"<{seconds}.{micros:06d}> {mark.name} 000#\n"
