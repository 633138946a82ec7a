"""Choices from bytes: the same bytes give the same choices, and every part of them matters."""


class Octets:
    """A source of choices; zeros where its bytes are used up.

    Args:
        data: Bytes of an input.

    """

    def __init__(self, data):
        self._data, self._at = data, 0

    def __bool__(self):
        return self._at < len(self._data)

    def take(self, size):
        """The next bytes."""
        found = self._data[self._at : self._at + size].ljust(size, b"\0")
        self._at += size
        return found

    def rest(self):
        """All bytes that are left."""
        return self.take(max(len(self._data) - self._at, 0))

    def number(self, size=1):
        """Unsigned number of so many bytes."""
        octets = self._data[self._at : self._at + size]  # zeros behind them would not matter
        self._at += size
        return int.from_bytes(octets, "little")

    def below(self, limit):
        """A number from 0 to below the limit."""
        return self.number(1 if limit <= 256 else 2) % limit

    def among(self, options):
        """One of some options."""
        return options[self.below(len(options))]
