"""A CAN frame as every reader gives it and every writer takes it."""

from typing import NamedTuple

LONGEST = 64
"""Bytes of the longest payload, that of CAN FD."""


class Frame(NamedTuple):
    """One frame with its time stamp.

    Attributes:
        t_us: time stamp, µs, on the clock of the bus or the recording.
        arbitration_id: 11 or 29 bits.
        data: payload; empty for a remote frame.
        channel: name of the bus; '' where unknown.
        is_extended: 29-bit id.
        is_fd: CAN FD.
        is_remote: remote request.
        is_error: error frame, which carries no payload of ours.

    """

    t_us: int
    arbitration_id: int
    data: bytes
    channel: str = ""
    is_extended: bool = False
    is_fd: bool = False
    is_remote: bool = False
    is_error: bool = False

    @property
    def is_data(self) -> bool:
        """Whether the frame carries a payload."""
        return not (self.is_remote or self.is_error)


class Mark(NamedTuple):
    """Something that happened to a service between two frames, as its own log tells it.

    Attributes:
        t_us: when, µs.
        name: what: 'advance' or 'second-sender'.

    """

    t_us: int
    name: str


ADVANCE = "advance"
SECOND_SENDER = "second-sender"
MARKS = frozenset({ADVANCE, SECOND_SENDER})


def to_us(seconds: float) -> int:
    """Seconds to integer µs, rounded to the nearest."""
    return round(seconds * 1e6)
