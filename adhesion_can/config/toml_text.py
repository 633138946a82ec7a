"""Values as TOML writes them."""

import json
from typing import TypeAlias

TomlValue: TypeAlias = "float | str | tuple[TomlValue, ...]"
"""What a key of our files can have."""


def quoted(text: str) -> str:
    """Text as a TOML string; a character that UTF-8 does not have is written as its number."""
    valid = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return json.dumps(valid, ensure_ascii=False).replace("\x7f", "\\u007f")


def toml_value(value: TomlValue) -> str:
    """A value as TOML has it, a number with all its digits."""
    if isinstance(value, tuple):
        return f"[{', '.join(map(toml_value, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return quoted(value)
    return repr(value if isinstance(value, int) else float(value))
