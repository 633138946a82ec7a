"""Something odd about data, found before anything is fitted."""

from typing import NamedTuple


class Finding(NamedTuple):
    """Something odd about the data.

    Attributes:
        what: What was seen, with numbers.
        fix: What to do about it.
        fatal: Whether no honest answer is possible.

    """

    what: str
    fix: str
    fatal: bool = True

    @property
    def sentence(self) -> str:
        """Both in one line."""
        return f"{self.what}: {self.fix}"
