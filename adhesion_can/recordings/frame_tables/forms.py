"""Forms of the lines of other tools: where each has stamp, id, bus and payload.

A form is a pattern with named groups, or a heading whose words name the columns. The names are
those of `Fields`. Sources: examples and readers of SavvyCAN, mdf4-converters of CSS Electronics,
the file heads of BUSMASTER and Kvaser, the car-hacking data sets of HCRL.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple


class Clock(Enum):
    """What the stamps of a form are."""

    SECONDS = "s"
    MILLIS = "ms"
    MICROS = "us"
    TIME_OF_DAY = "time of day"
    DIGITS = "digits of date and time"


class Fields(NamedTuple):
    """Texts of a line; '' where the form has none.

    Attributes:
        time: Stamp.
        id: Identifier.
        data: Payload.
        length: Length, bytes.
        bus: Number of the bus.
        extended: Whether the id has 29 bits.
        remote: Whether it is a remote frame.
        error: Whether it is an error frame.
        fd: Whether it is a CAN FD frame.

    """

    time: str
    id: str
    data: str = ""
    length: str = ""
    bus: str = ""
    extended: str = ""
    remote: str = ""
    error: str = ""
    fd: str = ""


@dataclass(frozen=True, slots=True)
class LineForm:
    """Form of the lines of one tool.

    Attributes:
        name: Name of the tool or of the format, for sentences.
        clock: What its stamps are.
        pattern: Pattern of a line, with the names of `Fields` as groups; None: by columns.
        decimal_id: Whether ids are decimal.
        is_base64: Whether payloads are base64, else hex digits.
        delimiter: What parts the columns.
        places: Places of the columns of each field; several for a payload of a byte a column.

    """

    name: str
    clock: Clock
    pattern: re.Pattern[str] | None = None
    decimal_id: bool = False
    is_base64: bool = False
    delimiter: str = ","
    places: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    def fields(self, line: str) -> Fields | None:
        """Fields of a line; None where it is none of this form."""
        if self.pattern is not None:
            match = self.pattern.fullmatch(line.strip())
            return Fields(**{k: v or "" for k, v in match.groupdict().items()}) if match else None
        cells = [cell.strip().strip('"') for cell in line.strip().split(self.delimiter)]
        # A frame of fewer bytes may lack the columns of the others.
        needed = [max(places) for places in self.places.values() if len(places) == 1]
        if len(cells) <= max(needed):
            return None
        return Fields(**{
            name: " ".join(cells[place] for place in places if place < len(cells))
            for name, places in self.places.items()
        })  # fmt: skip

    @property
    def has_times(self) -> bool:
        """Whether its lines have stamps."""
        return self.pattern is not None or "time" in self.places


_BYTES = r"(?P<data>(?:[0-9A-Fa-f]{1,2}\s*)*)"
_HEX = r"(?P<id>(?:0[xX])?[0-9A-Fa-f]{1,8})"


def _form(name: str, clock: Clock, pattern: str) -> LineForm:
    return LineForm(name, clock, re.compile(pattern))


LINES: tuple[LineForm, ...] = (
    _form(
        "BUSMASTER",
        Clock.TIME_OF_DAY,
        r"(?P<time>\d{1,2}:\d\d:\d\d:\d{1,4})\s+[RT]x\s+(?P<bus>\d+)\s+"
        r"(?P<id>(?:0[xX])?[0-9A-Fa-f]{1,10})\s+"
        r"(?P<extended>[sx])(?P<remote>r?)(?P<fd>(?:-?fd)?)\s+(?P<length>\d+)\s*"
        r"(?P<data>(?:[0-9A-Fa-f]{1,3}\s*)*)",
    ),
    _form(
        "the car-hacking data of HCRL",
        Clock.SECONDS,
        rf"Timestamp:\s*(?P<time>\d+\.\d+)\s+ID:\s*{_HEX}\s+[01]+\s+DLC:\s*(?P<length>\d+)\s*{_BYTES}",
    ),
    _form(
        "the car-hacking data of HCRL",
        Clock.SECONDS,
        rf"(?P<time>\d+\.\d+),{_HEX},(?P<length>\d+),(?P<data>(?:[0-9A-Fa-f]{{2}},?)*)[RT]?",
    ),
    _form(
        "Microchip's CAN analyzer",
        Clock.MILLIS,
        rf"(?P<time>\d+(?:\.\d+)?);[RT]X;{_HEX};(?P<length>\d+);(?P<data>(?:0x[0-9A-Fa-f]{{2}};?)*)",
    ),
    _form(
        "CRTD",
        Clock.SECONDS,
        rf"(?P<time>\d+\.\d+)\s+(?P<bus>\d*)[RT](?:(?:11)|(?P<extended>29))\s+{_HEX}\s*{_BYTES}",
    ),
    _form(
        "CARBUS Analyzer",
        Clock.SECONDS,
        rf"(?P<time>\d+,\d{{3,6}})\t(?P<bus>\d+)\t\d+\t{_HEX}\t(?P<length>\d+)\t{_BYTES}\t.*",
    ),
    _form(
        "Kvaser's text",
        Clock.SECONDS,
        rf"(?P<bus>\d+)\s+{_HEX}\s+(?P<extended>X?)(?P<remote>R?)\s*(?P<length>\d+)\s+{_BYTES}\s"
        r"\s*(?P<time>\d+\.\d+)\s+[RT]",
    ),
    _form(
        "IXXAT's text",
        Clock.TIME_OF_DAY,
        rf'"(?P<time>\d{{1,2}}:\d\d:\d\d[.,]\d+)","{_HEX}","(?:Std|(?P<extended>Ext))","[^"]*","{_BYTES}"',
    ),
)
"""Forms without a heading that names their columns."""

COLUMNS: Mapping[str, tuple[str, ...]] = {
    "time": ("time stamp", "timestamp", "timestampepoch", "time", "time_s", "abs time(sec)",
             "abs time", "time (s)", "time(s)", "time [s]", "t"),
    "id": ("id", "can id", "canid", "can_id", "arbitration_id", "arb id", "arbid", "identifier",
           "addr", "address", "msgid", "message id", "frame id"),
    "extended": ("extended", "ide", "ext", "xtd", "type"),
    "bus": ("bus", "buschannel", "channel", "chn"),
    "length": ("datalength", "len", "length", "dlc"),
    "data": ("databytes", "data bytes", "data", "payload", "data (hex)"),
    "remote": ("rtr", "remote"),
    "error": ("error", "er"),
    "fd": ("edl", "fd"),
}  # fmt: skip
"""Words of a heading, in lower case, by the field that they name; the first ones count most."""
_BYTE = re.compile(r"(?:d|b|db|data|byte)[ _]?(\d{1,2})")
_DELIMITERS = (",", ";", "\t", "|")
_CLOCKS = {"time stamp": Clock.MICROS}
"""What stamps are where their heading is not of seconds."""
_DECIMAL_IDS = frozenset({"addr", "address"})
_COMMENT = re.compile(r"\s*(?:#|//|\*\*\*|;|@)")
LOOKED_AT = 40
"""Lines, behind the first that has a form, of which most must have it."""


def find_form(lines: Sequence[bytes]) -> LineForm | None:
    """Form of the first lines of a file; None where they have none.

    Args:
        lines: First lines of a file of text.

    """
    texts = [line.decode("utf-8", "replace") for line in lines]
    plain = [text for text in texts if text.strip() and not _COMMENT.match(text)]
    if plain and (headed := _of_heading(plain[0])) is not None:
        return headed
    for form in LINES:
        first = next((n for n, text in enumerate(plain) if form.fields(text)), None)
        if first is not None and _is_usual(form, plain[first : first + LOOKED_AT]):
            return form
    return None


def _is_usual(form: LineForm, lines: Sequence[str]) -> bool:
    return 2 * sum(form.fields(line) is not None for line in lines) > len(lines)


def _of_heading(line: str) -> LineForm | None:
    """Form of a heading that names an id and a payload; None where it does not."""
    for delimiter in _DELIMITERS:
        cells = [cell.strip().strip('"').lower() for cell in line.strip().split(delimiter)]
        places: dict[str, tuple[int, ...]] = {}
        for name, words in COLUMNS.items():
            place = next((cells.index(word) for word in words if word in cells), None)
            if place is not None:
                places[name] = (place,)
        octets = _octets(cells)
        if octets:
            places["data"] = octets
        if "id" in places and "data" in places and len(cells) > 1:
            time = cells[places["time"][0]] if "time" in places else ""
            clock = _CLOCKS.get(time, Clock.SECONDS)
            if cells == ["timestamp", "type", "id", "data"]:
                clock = Clock.DIGITS
            named = cells[places["id"][0]]
            return LineForm(
                f"a table of frames ({line.strip()[:60]})",
                clock,
                decimal_id=named in _DECIMAL_IDS,
                is_base64=named == "arbitration_id" and not octets,
                delimiter=delimiter,
                places=places,
            )
    return None


def _octets(cells: Iterable[str]) -> tuple[int, ...]:
    """Places of columns of a byte each, in the order of their numbers."""
    by_number = {
        int(match[1]): place for place, cell in enumerate(cells) if (match := _BYTE.fullmatch(cell))
    }
    return tuple(by_number[number] for number in sorted(by_number)) if len(by_number) > 1 else ()
