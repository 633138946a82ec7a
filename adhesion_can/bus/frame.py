"""CAN frame and service mark, as readers give and writers accept them."""

from typing import NamedTuple

MAX_PAYLOAD = 64
"""Length of the longest payload, that of CAN FD, bytes."""
MOST_ID = (1 << 29) - 1
"""Largest identifier, of 29 bits."""


class Frame(NamedTuple):
    """One frame with its time stamp.

    Attributes:
        t_us: Time stamp, µs, on the clock of the bus or the recording.
        arbitration_id: Identifier of 11 or 29 bits.
        data: Payload; empty for a remote frame.
        channel: Name of the bus; '' where unknown.
        is_extended: Whether the identifier has 29 bits.
        is_fd: Whether the frame is one of CAN FD.
        is_remote: Whether the frame is a remote request.
        is_error: Whether the frame is an error frame; its payload is not used.

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
    """Event of a service between two frames, as recorded in its log.

    Attributes:
        t_us: Time stamp, µs.
        name: Kind of the event: 'advance', 'second-sender' or 'stop'.

    """

    t_us: int
    name: str


ADVANCE = "advance"
SECOND_SENDER = "second-sender"
STOP = "stop"
MARKS = frozenset({ADVANCE, SECOND_SENDER, STOP})


def to_us(seconds: float) -> int:
    """Seconds to integer µs, rounded to the nearest."""
    return round(seconds * 1e6)
