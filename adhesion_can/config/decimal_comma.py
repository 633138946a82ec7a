"""A decimal comma in a TOML file, named as such where it is why the file cannot be read."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from adhesion_can.config.toml_tables import LARGEST_FILE
from adhesion_can.errors import ConfigError
from adhesion_can.input_files import read_small_file

_LINE = re.compile(r"\bat line (\d+)\b")
_COMMA = re.compile(
    r"""(?P<key>[\w.]+|"[^"]*")\s*=\s*(?P<whole>[+-]?\d+),(?P<part>\d+(?:[eE][+-]?\d+)?)"""
)


@contextmanager
def decimal_commas_named(path: Path | None) -> Iterator[None]:
    """Let an error of a TOML file name the decimal comma in its line, if there is one.

    Args:
        path: File that is read; None: there is none.

    Raises:
        ConfigError: That of the reader, with the key, the comma and the number to write.

    """
    try:
        yield
    except ConfigError as error:
        line_and_comma = None if path is None else _find(error, path)
        if line_and_comma is None:
            raise
        number, comma = line_and_comma
        given, meant = (f"{comma['whole']}{sign}{comma['part']}" for sign in ",.")
        raise ConfigError(
            f"{path}: line {number}: {comma['key']}",
            f"{given} has a decimal comma",
            f"write {meant}",
        ) from error


def _find(error: ConfigError, path: Path) -> tuple[int, re.Match[str]] | None:
    """Number of the line that an error names, and the number with a comma in it; None: neither."""
    line = _LINE.search(error.what)
    if line is None or error.where != str(path):
        return None
    text = read_small_file(path, LARGEST_FILE, kind=ConfigError).decode("utf-8", "replace")
    lines, number = text.split("\n"), int(line[1])
    comma = _COMMA.search(lines[number - 1]) if number <= len(lines) else None
    return None if comma is None else (number, comma)
