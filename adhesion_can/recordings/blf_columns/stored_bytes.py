"""Bytes of a .blf file, one after the other, and the marks among them with which objects start."""

from collections.abc import Callable

MARK = b"LOBJ"
"""First bytes of every object, containers among them."""
PIECE = 1 << 18
"""Bytes read and unpacked at once, however large a container claims to be."""
ROOM = 8
"""Bytes behind an object in which the next one starts."""


class StoredBytes:
    """Bytes of the file, with a look ahead.

    Args:
        read: Function that gives the next bytes of the file, fewer than asked for at its end.

    """

    def __init__(self, read: Callable[[int], bytes]) -> None:
        self._read = read
        self._ahead = b""
        self._at = 0  # of `_ahead`, whose bytes before that are taken
        self.position = 0
        """Number of bytes taken so far."""

    def _fill(self, count: int) -> None:
        held = len(self._ahead) - self._at
        if held < count:
            more = self._read(max(count - held, 1 << 12))
            self._ahead, self._at = self._ahead[self._at :] + more, 0

    def peek(self, count: int) -> bytes:
        """Next bytes, which are not taken by that."""
        self._fill(count)
        return self._ahead[self._at : self._at + count]

    def take(self, count: int) -> bytes:
        """Next bytes."""
        taken = self.peek(count)
        self._at += len(taken)
        self.position += len(taken)
        return taken

    def put_back(self, data: bytes) -> None:
        """Make bytes that were taken the next ones again."""
        self._ahead, self._at = data + self._ahead[self._at :], 0
        self.position -= len(data)

    def skip(self, count: int) -> int:
        """Pass over so many bytes; how many there were."""
        left = count
        while left and (taken := self.take(min(left, PIECE))):
            left -= len(taken)
        return count - left

    def skip_to_mark(self) -> int:
        """Pass over everything in front of the next object; how many bytes that is."""
        begin = self.position
        while True:
            self._fill(ROOM)
            place = self._ahead.find(MARK, self._at)
            if place >= 0:
                self.skip(place - self._at)
                break
            held = len(self._ahead) - self._at
            if held < ROOM:
                self.skip(held)
                break
            self.skip(held - len(MARK) + 1)
        return self.position - begin
