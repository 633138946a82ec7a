"""Lines of a trace that no layout fits, by python-can's own reader."""

from collections.abc import Iterator, Sequence
from typing import Generic, NamedTuple, TypeVar, cast

import can
from can.io.generic import TextIOMessageReader

from adhesion_can.bus.frame import MAX_PAYLOAD, Frame
from adhesion_can.recordings.candump import LAST_US
from adhesion_can.recordings.frame_rows import bus_from_1

Reader = TypeVar("Reader", bound=TextIOMessageReader)

_LAST_ID = 0x1FFFFFFF
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
        found: list[can.Message | Exception | None] = [None] * len(texts)
        begin = 0
        while begin < len(texts):
            feed = _Feed(self._head, texts[begin:])
            try:
                for message in self._reader(cast("str", feed)):
                    found[begin + feed.place] = message
                break
            except Exception as error:  # its parser raises whatever it meets
                if feed.place < 0:
                    raise
                found[begin + feed.place] = error
                begin += feed.place + 1
        return found


def _text(line: bytes) -> str:
    # Editors and tools write the local code page into names and comments.
    return line.decode("utf-8", "replace")


def to_frame(message: can.Message, first_bus: int) -> tuple[Frame, int]:
    """A message of a reader whose buses are numbers: the frame, and its bus from 1.

    Args:
        message: Message as the reader gives it.
        first_bus: Number of the first bus in the reader's messages.

    Raises:
        ValueError: No bus can carry it.
        OverflowError: Its stamp is not a time.

    """
    bus = message.channel + 1 - first_bus if isinstance(message.channel, int) else 1
    t_us = round(message.timestamp * 1e6)
    has_data = not (message.is_error_frame or message.is_remote_frame)
    data = bytes(message.data) if has_data else b""
    if not (0 <= bus <= _LAST_BUS and 0 <= message.arbitration_id <= _LAST_ID):
        raise ValueError("an invalid bus or id")
    if len(data) > MAX_PAYLOAD or abs(t_us) > LAST_US:
        raise ValueError("an invalid payload or stamp")
    frame = Frame(
        t_us=t_us,
        arbitration_id=message.arbitration_id,
        data=data,
        channel=bus_from_1(bus),
        is_extended=message.is_extended_id and not message.is_error_frame,
        is_fd=message.is_fd,
        is_remote=message.is_remote_frame,
        is_error=message.is_error_frame,
    )
    return frame, bus
