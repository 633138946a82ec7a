"""Ranges in the text of a database: cantools writes out each number of them."""

import re
from collections.abc import Iterator

from adhesion_can.errors import DatabaseError

MOST_SELECTORS = 1 << 20
"""Most values of multiplexers in all ranges of a DBC; each takes some 40 bytes."""
MOST_IDS = 1 << 16
"""Most identifiers in all ranges of a .sym file; each is a message of its own."""
_NO_STATEMENT = re.compile(rb'"(?:\\"|[^"])*?"|//[^\n]*\n')
"""Strings and comments, in which a keyword is none."""
_SELECTORS = re.compile(
    rb"SG_MUL_VAL_(?!\w)\s*[-+]?\d[\d.eE+-]*\s*[A-Za-z_]\w*\s+\w+(?P<ranges>[^;]*)", re.ASCII
)
"""`SG_MUL_VAL_ 256 Signal Selector 1-3, 5-5;`: the bare keyword is in the list NS_ as well."""
_NUMBER = re.compile(rb"[-+]?\d+")
_LONGEST_NUMBER = 30
"""Most digits of a number whose value is looked at."""
_ID_RANGE = re.compile(rb"\bID\s*=\s*([0-9A-Fa-f]{1,16})h\s*\S([0-9A-Fa-f]{1,64})h")


def require_small_ranges(content: bytes, where: str) -> None:
    """Refuse a database whose ranges would fill the memory.

    Args:
        content: Content of a file of any format.
        where: Path of the file, for the error.

    Raises:
        DatabaseError: The ranges of multiplexer values (DBC) or identifiers (.sym) are too wide.

    """
    for what, counts, most in (
        ("of multiplexer values (SG_MUL_VAL_)", _selectors(content), MOST_SELECTORS),
        ("of identifiers (ID=)", _identifiers(content), MOST_IDS),
    ):
        numbers = sum(max(count, 0) for count in counts)
        if numbers > most:
            raise DatabaseError(
                where, f"ranges {what} contain {numbers} numbers", f"write at most {most} in all"
            )


def _selectors(content: bytes) -> Iterator[int]:
    """Number of values of each range of a DBC's statements `SG_MUL_VAL_`."""
    if b"SG_MUL_VAL_" not in content:
        return
    for statement in _SELECTORS.finditer(_NO_STATEMENT.sub(b" ", content)):
        numbers = _NUMBER.findall(statement["ranges"])
        for first, last in zip(numbers[::2], numbers[1::2], strict=False):
            if max(len(first), len(last)) > _LONGEST_NUMBER:
                yield MOST_SELECTORS + 1
            else:
                yield int(last[1:] or b"0") - int(first) + 1  # the first character is the dash


def _identifiers(content: bytes) -> Iterator[int]:
    """Number of identifiers of each range of a .sym file, as in `ID=100h-10Fh`."""
    for first, last in _ID_RANGE.findall(content):
        yield int(last, 16) - int(first, 16) + 1
