"""A DBC file message by message: those with a fault are told and left out."""

import re

import cantools
from cantools.database import UnsupportedDatabaseFormatError  # type: ignore[attr-defined]
from cantools.database.can import Database
from cantools.database.errors import Error as CantoolsError

_NAMED = re.compile(r"in message (?P<name>\w+)")


def load_without_faulty_messages(text: str) -> tuple[Database, tuple[str, ...]]:
    """A database, and a sentence for each message that was left out.

    Args:
        text: Text of a DBC file.

    Raises:
        CantoolsError: The text has a fault that belongs to no message.

    """
    left_out: list[str] = []
    while True:
        try:
            db = cantools.database.load_string(text, database_format="dbc", strict=False)
        except (UnsupportedDatabaseFormatError, CantoolsError, ValueError) as error:
            reason = " ".join(str(error).split())[:200]
            found = _NAMED.search(reason)
            shorter = text if found is None else _without_message(text, found["name"])
            if found is None or shorter == text:
                raise
            left_out.append(f"message {found['name']} left out: {reason}")
            text = shorter
        else:
            if not isinstance(db, Database):
                raise CantoolsError("not a CAN database")
            return db, tuple(left_out)


def _without_message(text: str, name: str) -> str:
    """The text without the lines that define a message and its signals."""
    kept, inside = [], False
    for line in text.splitlines(keepends=True):
        words = line.split()
        if words[:1] == ["BO_"] and len(words) > 2:
            inside = words[2].rstrip(":") == name
        elif words[:1] != ["SG_"] and line.strip():
            inside = False
        if not inside:
            kept.append(line)
    return "".join(kept)
