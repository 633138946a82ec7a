"""Whether to work ahead of a due time although a message is still expected shortly before it."""

NEAR_US = 2_000
"""Time before a due time within which messages need not have come, µs."""
LONGEST_PAUSE = 63
"""Largest number of due times for which it is not tried after a failure."""


class EarlyStart:
    """Decides by experience whether the last messages before a due time are worth waiting for.

    Where they complete a sample, the early result is not used. A message that is sent at
    the due times themselves comes before them now, now after them, and mostly completes none. So it
    is tried once a due time; after each failure for twice as many due times not (exponential
    backoff).
    """

    def __init__(self) -> None:
        self._tried_us: int | None = None
        self._in_vain = False
        self._pause = self._left = 0

    def allows(self, t_us: int) -> bool:
        """Whether to start work of a due time, µs, without the messages that are missing."""
        return not self._left and self._tried_us != t_us

    def begin(self, t_us: int) -> None:
        """Take down that work of a due time, µs, starts without them."""
        self._tried_us, self._in_vain = t_us, False

    def repeat(self) -> None:
        """Take down that what was done for this due time has to be done again."""
        self._in_vain = True

    def end(self, t_us: int, *, served: bool) -> None:
        """Learn from a due time, µs, that is over.

        Args:
            t_us: Due time, µs.
            served: Whether work that was done ahead of it could be used.

        """
        if self._tried_us != t_us:
            self._left = max(self._left - 1, 0)
        elif served and not self._in_vain:
            self._pause = 0
        else:
            self._pause = self._left = min(2 * self._pause + 1, LONGEST_PAUSE)
