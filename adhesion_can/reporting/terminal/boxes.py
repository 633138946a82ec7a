"""Lines of a given width, and boxes around them. Nothing is cut: a line that is too wide raises."""

from collections.abc import Iterable, Sequence

from rich.cells import cell_len
from rich.text import Text

BORDER = "bright_black"


def padded(line: Text | str, width: int) -> Text:
    """The line with blanks behind it up to a width.

    Raises:
        ValueError: The line is wider.

    """
    text = line.copy() if isinstance(line, Text) else Text(line)
    room = width - cell_len(text.plain)
    if room < 0:
        raise ValueError(f"a line of {cell_len(text.plain)} cells for {width}: {text.plain!r}")
    text.append(" " * room)
    return text


def boxed(title: str, lines: Sequence[Text | str], width: int, height: int) -> list[Text]:
    """Lines in a frame with a title, of a width and a height that the frame is part of.

    Raises:
        ValueError: There are more lines than fit, or a line or the title is too wide.

    """
    if len(lines) > height - 2:
        raise ValueError(f"{len(lines)} lines for {height - 2} in {title!r}")
    head = padded(Text(f"┌ {title} "), width - 1).plain.rstrip(" ") + " "
    top = Text(head + "─" * (width - 1 - cell_len(head)) + "┐", BORDER)
    top.stylize("bold not dim", 2, 2 + len(title))
    inner = [*lines, *[Text()] * (height - 2 - len(lines))]
    side = Text("│", BORDER)
    rows = [Text.assemble(side, padded(line, width - 2), side) for line in inner]
    return [top, *rows, Text("└" + "─" * (width - 2) + "┘", BORDER)]


def side_by_side(*blocks: Sequence[Text]) -> list[Text]:
    """Blocks of the same height next to each other."""
    return [Text.assemble(*row) for row in zip(*blocks, strict=True)]


def wrapped(sentences: Iterable[Text], width: int, height: int, key: str = "") -> list[Text]:
    """Sentences one after another, broken between words, in a number of lines.

    Those at the end that find no room are counted in the last line.

    Args:
        sentences: Sentences, the most important one first.
        width: Width of a line, cells.
        height: Number of lines.
        key: Key that shows all of them, for the line that counts; '' for none.

    """
    parts = [_broken(sentence, width) for sentence in sentences]
    lines = [line for part in parts for line in part]
    if len(lines) <= height:
        return lines
    hint = f": {key}" if key else ""
    for count in range(len(parts) - 1, 0, -1):
        lines = [line for part in parts[:count] for line in part]
        more = Text(f"(+{len(parts) - count} more{hint})", "dim")
        if len(lines) > height:
            continue
        if cell_len(lines[-1].plain) + 2 + len(more.plain) <= width:
            return [*lines[:-1], Text.assemble(lines[-1], "  ", more)]
        if len(lines) < height and len(more.plain) <= width:
            return [*lines, more]
    none = f"({len(parts)} sentences{hint})"
    return [Text(none, "dim")] if len(none) <= width and height else []


def _broken(sentence: Text, width: int) -> list[Text]:
    """Lines of a sentence; a word that is wider than a line is broken as well."""
    lines: list[Text] = []
    line = Text()
    for word in sentence.split(" "):
        rest = word
        while cell_len(rest.plain) > width:
            if line.plain:
                lines.append(line)
                line = Text()
            lines.append(rest[:width])
            rest = rest[width:]
        space = 1 if line.plain else 0
        if cell_len(line.plain) + space + cell_len(rest.plain) > width:
            lines.append(line)
            line, space = Text(), 0
        line = Text.assemble(line, " " * space, rest)
    return [*lines, line] if line.plain else lines
