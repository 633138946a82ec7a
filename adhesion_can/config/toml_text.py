"""Values as TOML writes them."""

import json


def quoted(text: str) -> str:
    """Text as a TOML string; a character that UTF-8 does not have is written as its number."""
    valid = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return json.dumps(valid, ensure_ascii=False).replace("\x7f", "\\u007f")
