"""Parts of a Markdown page."""

import re
from collections.abc import Iterable, Sequence

GENERATED = "<!-- Written by tools/references: change the code, not this page. -->"


def page(parts: Iterable[str]) -> str:
    """Parts of a page, an empty line between two."""
    return "\n\n".join(part.strip() for part in parts) + "\n"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(map(_cell, line))} |" for line in lines)


def _cell(text: str) -> str:
    """Text on one line, its own bars kept from ending the cell."""
    return " ".join(text.split()).replace("|", "\\|")


def code(text: str) -> str:
    """Text as code; nothing for no text."""
    return f"`{text}`" if text else ""


def plain(text: object) -> str:
    """Text without markup: its stars and angle brackets are meant as they are."""
    return re.sub(r"([*<])", r"\\\1", str(text))
