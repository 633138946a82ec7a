"""Parts of a Markdown page."""

from collections.abc import Iterable, Sequence

GENERATED = "<!-- Written by tools/references: change the code, not this page. -->"


def page(parts: Iterable[str]) -> str:
    """Parts of a page, an empty line between two."""
    return "\n\n".join(part.strip() for part in parts) + "\n"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(' '.join(cell.split()) for cell in line)} |" for line in lines)


def code(text: str) -> str:
    """Text as code, that may stand in a table; nothing for no text."""
    return f"`{text}`".replace("|", "\\|") if text else ""
