"""A DBC file message by message: those with a fault are reported and left out."""

import re

import cantools
from cantools.database import UnsupportedDatabaseFormatError  # type: ignore[attr-defined]
from cantools.database.can import Database
from cantools.database.errors import Error as CantoolsError

_NAMED = re.compile(r"in message (?P<name>\w+)")
_UNUSED = re.compile(r"^\s*(VAL_|SIG_VALTYPE_) (\d+) (\w+)", re.MULTILINE)
"""A line of cantools' error on statements whose signal is not there."""
_OF_A_SIGNAL = re.compile(
    r'^[ \t]*(VAL_|SIG_VALTYPE_)\s+(\d+)\s+(\w+)(?:"(?:\\"|[^"])*?"|[^";])*;[ \t]*\n?', re.MULTILINE
)


def load_without_faulty_messages(text: str) -> tuple[Database, tuple[str, ...]]:
    """A database, and a sentence for each message that was left out.

    Args:
        text: Text of a DBC file.

    Raises:
        CantoolsError: The text has a fault that belongs to no message.

    """
    left_out: list[str] = []
    gone: set[str] = set()
    while True:
        try:
            db = cantools.database.load_string(text, database_format="dbc", strict=False)
        except (UnsupportedDatabaseFormatError, CantoolsError, ValueError) as error:
            reason = " ".join(str(error).split())[:200]
            unused = set(_UNUSED.findall(str(error)))
            match = _NAMED.search(reason)
            if unused:
                shorter = _without_statements(text, unused)
                left_out += [
                    f"skipped {keyword} {number} {name}: there is no such signal"
                    for keyword, number, name in sorted(unused)
                    if number not in gone
                ]
            elif match is not None:
                shorter, number = _without_message(text, match["name"])
                gone.add(number)
                left_out.append(f"skipped message {match['name']}: {reason}")
            else:
                raise
            if shorter == text:
                raise
            text = shorter
        else:
            if not isinstance(db, Database):
                raise CantoolsError("not a CAN database")
            return db, tuple(left_out)


def is_unused(reason: str) -> bool:
    """Whether an error of cantools says that a statement has no signal."""
    return "unused VAL_" in reason or "unused SIG_VALTYPE_" in reason


def _without_statements(text: str, unused: set[tuple[str, str, str]]) -> str:
    """The text without the statements of some signals: keyword, id and name of each."""
    return _OF_A_SIGNAL.sub(lambda it: "" if it.group(1, 2, 3) in unused else it.group(), text)


def _without_message(text: str, name: str) -> tuple[str, str]:
    """The text without the lines that define a message and its signals; and the message's id."""
    kept, inside, number = [], False, ""
    for line in text.splitlines(keepends=True):
        words = line.split()
        if words[:1] == ["BO_"] and len(words) > 2:
            inside = words[2].rstrip(":") == name
            number = words[1] if inside else number
        elif words[:1] != ["SG_"] and line.strip():
            inside = False
        if not inside:
            kept.append(line)
    return "".join(kept), number
