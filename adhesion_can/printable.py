"""Text of strangers on its way to a terminal: the one place where it is made harmless.

Headings, channel names, units, comments and file names come from the maker of a file. On a terminal
a control character in them may set its title, move the cursor over other lines or forge one.
"""

import re
import sys
from typing import TextIO

# Control characters of both sets; marks that turn the direction of writing; separators of lines;
# halves of characters, which stand for bytes of a file name that are no text.
_HARMFUL = re.compile(
    "[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)


def printable(text: str) -> str:
    r"""The text with an escape such as `\x1b` in place of what is no letter, sign or blank."""
    return _HARMFUL.sub(lambda match: match[0].encode("unicode_escape").decode("ascii"), text)


def say(line: str, file: TextIO | None = None, end: str = "\n") -> None:
    """Write a line for people.

    Args:
        line: The line, without its end.
        file: Stream to write to; None: stderr.
        end: End of the line.

    """
    print(printable(line), file=file or sys.stderr, end=end, flush=True)
