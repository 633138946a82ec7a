"""Recognition of our own frames among those received, as some interfaces return them."""

from collections import deque

from adhesion_can.bus.frame import Frame

ECHO_US = 1_000_000
"""Longest time between sending a frame and its echo, µs."""
MEMORY_FRAMES = 4096
"""Largest number of sent frames that are remembered."""


class EchoFilter:
    """Remembers the frames sent within the last `ECHO_US`, to recognise their echoes."""

    def __init__(self) -> None:
        self._sent: deque[tuple[int, int, bytes]] = deque(maxlen=MEMORY_FRAMES)

    def add_sent(self, frame: Frame, now_us: int) -> None:
        """Remember a frame sent at a time, µs."""
        self._sent.append((now_us, frame.arbitration_id, frame.data))

    def is_echo(self, frame: Frame, now_us: int) -> bool:
        """Whether a frame received at a time, µs, is an echo; each echo is expected once."""
        while self._sent and now_us - self._sent[0][0] > ECHO_US:
            self._sent.popleft()
        for index, (_, number, data) in enumerate(self._sent):
            if (number, data) == (frame.arbitration_id, frame.data):
                del self._sent[index]
                return True
        return False
