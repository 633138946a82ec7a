"""Comments in the service's own log, in a form that no reader of candump's text stumbles over.

cantools and can-utils pass over lines that begin with '#', but the can-utils of Debian 12 end at a
line of 399 bytes. python-can knows no comments: it expects a stamp, a channel and a frame. So a
comment has three words, the last of which is an empty frame, and goes on in further lines.
"""

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

LONGEST_LINE = 390
"""Largest length of a line with its end, bytes."""
_EMPTY_FRAME = "000#"
_LINE = re.compile(rb"#(\d{1,15})\.(\d{6})# [a-z-]+(\+?):(\S+) 000#\s*$")


class LogComment(NamedTuple):
    """A comment of one line or more.

    Attributes:
        t_us: Time, µs.
        text: Text without blanks, ASCII.

    """

    t_us: int
    text: bytes


def format_stamp(t_us: int) -> str:
    """Time, µs, as the log writes it: seconds with six digits behind the point."""
    seconds, micros = divmod(t_us, 1_000_000)
    return f"{seconds}.{micros:06d}"


def stamp_of(line: str) -> str:
    """Stamp of a line that the service wrote: a frame, a mark or a comment."""
    return line.partition(" ")[0][1:-1]


def format_comment(stamp: str, name: str, text: str) -> str:
    """Lines of a comment, with their ends.

    Args:
        stamp: Time as `format_stamp` writes it.
        name: Kind of the comment, in small letters and hyphens.
        text: Text, not empty; its blanks become underscores, and what is not ASCII escapes.

    """
    word = "_".join(text.replace("±", "+-").split()).encode("ascii", "backslashreplace").decode()
    room = LONGEST_LINE - len(f"#{stamp}# {name}+: {_EMPTY_FRAME}\n")
    return "".join(
        f"#{stamp}# {name}{'+' if place else ''}:{word[place : place + room]} {_EMPTY_FRAME}\n"
        for place in range(0, len(word), room)
    )


def read_comments(lines: Iterable[bytes], name: str) -> Iterator[LogComment]:
    """Comments of one kind.

    Args:
        lines: Comment lines of a log, or all its lines.
        name: Kind of the comments.

    Raises:
        ValueError: A line of that kind is damaged; the message begins with that line.

    """
    begins = (f" {name}:".encode(), f" {name}+:".encode())
    comment: LogComment | None = None
    for line in lines:
        if not any(begin in line[:60] for begin in begins):
            continue
        match = _LINE.match(line)
        if match is None:
            raise ValueError(f"{line[:50].decode('latin-1')}: no comment")
        t_us = int(match[1]) * 1_000_000 + int(match[2])
        if not match[3]:
            if comment is not None:
                yield comment
            comment = LogComment(t_us, match[4])
        elif comment is None or comment.t_us != t_us:
            raise ValueError(f"{line[:50].decode('latin-1')}: its start is missing")
        else:
            comment = LogComment(t_us, comment.text + match[4])
    if comment is not None:
        yield comment
