"""Lines of a trace that no layout fits, by python-can's own reader."""

from abc import abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from typing import ClassVar, Generic, NamedTuple, TypeVar, cast

import can
from can.io.generic import TextIOMessageReader

from adhesion_can.bus.frame import Frame
from adhesion_can.recordings.candump import FD_LENGTHS
from adhesion_can.recordings.frame_rows import bus_from_1
from adhesion_can.recordings.python_can_messages import from_message
from adhesion_can.recordings.python_can_readers import require_valid
from adhesion_can.recordings.text_columns.form import Form, SingleLine

Reader = TypeVar("Reader", bound=TextIOMessageReader)

LENGTH_CODES = sorted(FD_LENGTHS)
"""Lengths of payloads by their code, bytes."""
_LAST_BUS = 0xFFFF


class OddLine(NamedTuple):
    """A line as python-can's reader takes it.

    Attributes:
        found: Message of the line, None where it holds none, or what the reader's parser raises.
        t_ns: Stamp of the line to all its digits, ns; None where only the message has one.

    """

    found: can.Message | Exception | None
    t_ns: int | None = None


class _Feed:
    """Lines as python-can's readers take a file.

    Args:
        head: Head of the file.
        lines: Lines behind it.

    """

    def __init__(self, head: Sequence[str], lines: Sequence[str]) -> None:
        self.place = -1
        """Index of the line that was taken last, below 0 while those of the head are."""
        self._head, self._lines = head, lines

    def __iter__(self) -> Iterator[str]:
        lines = (*self._head, *self._lines)
        for place, line in enumerate(lines, start=-len(self._head)):
            self.place = place
            yield line

    def close(self) -> None:
        pass


class PythonCanLines(Generic[Reader]):
    """Lines of a file, some at a time, as a reader of python-can takes them.

    Args:
        reader: Class of the reader.
        head: Lines that the reader takes for the head of the file.

    """

    def __init__(self, reader: type[Reader], head: Sequence[bytes]) -> None:
        self._reader = reader
        self._head = [_text(line) for line in head]

    def reader_behind(self, line: bytes) -> Reader:
        """A reader that has read the head and one more line."""
        reader = self._reader(cast("str", _Feed(self._head, [_text(line)])))
        for _ in reader:
            pass
        return reader

    def read(self, lines: Sequence[bytes]) -> list[can.Message | Exception | None]:
        """What the reader makes of each line: a message, nothing, or an exception.

        Raises:
            Exception: The reader fails at the head of the file, with whatever its parser raises.

        """
        texts = [_text(line) for line in lines]
        outcomes: list[can.Message | Exception | None] = [None] * len(texts)
        begin = 0
        while begin < len(texts):
            feed = _Feed(self._head, texts[begin:])
            try:
                for message in self._reader(cast("str", feed)):
                    outcomes[begin + feed.place] = message
                break
            except Exception as error:  # its parser raises whatever it meets
                if feed.place < 0:
                    raise
                outcomes[begin + feed.place] = error
                begin += feed.place + 1
        return outcomes


def _text(line: bytes) -> str:
    # Editors and tools write the local code page into names and comments.
    return line.decode("utf-8", "replace")


class TraceForm(Form):
    """Form of the lines of a trace, of which python-can reads those that no layout fits."""

    ends_at_cr = True
    first_bus: ClassVar[int]
    """Number of the first bus in python-can's messages."""

    @abstractmethod
    def messages(self, lines: Sequence[bytes]) -> Iterable[OddLine]:
        """What python-can makes of each line."""

    @abstractmethod
    def kind_without_frame(self, line: bytes) -> str | None:
        """Kind of a line that holds no frame, as the report counts it; None: not counted."""

    def bus_name(self, text: bytes) -> str | None:
        """Name of a bus from its number in a line; that of bus 1 where lines have no number."""
        digits = text.lstrip(b" ") if text else b"1"
        return bus_from_1(int(digits)) if digits.isdigit() and int(digits) <= _LAST_BUS else None

    def read(self, lines: Sequence[bytes]) -> Iterator[SingleLine]:
        """Lines as python-can's reader takes them."""
        for line, (outcome, t_ns) in zip(lines, self.messages(lines), strict=True):
            if outcome is None:
                yield SingleLine(self.kind_without_frame(line))
            elif isinstance(outcome, can.Message) and (frame := self._frame(outcome)):
                yield SingleLine(frame, frame.t_us * 1000 if t_ns is None else t_ns)
            else:
                yield SingleLine("malformed")

    def _frame(self, message: can.Message) -> Frame | None:
        """A message of a reader whose buses are numbers; None where no bus can carry it."""
        bus = message.channel + 1 - self.first_bus if isinstance(message.channel, int) else 1
        if not 0 <= bus <= _LAST_BUS:
            return None
        try:
            frame = from_message(message, round(message.timestamp * 1e6))
            require_valid(frame)
        except (ValueError, OverflowError):
            return None
        return frame._replace(channel=bus_from_1(bus))
