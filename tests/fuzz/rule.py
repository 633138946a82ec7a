"""The rule of every target: a value, or an error of the project with what, where and the fix.

Any other exception, a wrong answer, a hang or a heap of memory is a finding.
"""

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

from adhesion_can.errors import InputError

LONGEST_S = 5
"""Time after which an input counts as a hang, s."""
MOST_MIB = 1024
"""Memory that an input may take, MiB."""


def value_or_refusal(call, *arguments, own=(), **options):
    """Value of a call, or None where an error of the project refuses the input.

    Args:
        call: Parser.
        arguments: Its arguments.
        own: Error classes inside the project that its caller turns into an `InputError`.
        options: Its arguments by name.

    """
    try:
        return call(*arguments, **options)
    except (InputError, *own) as error:
        _require_mend(error)
        return None


def _require_mend(error):
    """Every part of an error is there, on one line."""
    for name in ("where", "what", "fix") if isinstance(error, InputError) else ():
        assert getattr(error, name).strip(), f"{error!r} has no {name}"
    assert str(error).strip(), f"{error!r} says nothing"
    assert "\n" not in str(error) or not isinstance(error, InputError), "more than a line"


@cache
def _folder() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="fuzz-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def file_of(name: str, data: bytes) -> Path:
    """A file of that name with these bytes; the next one of that name takes its place."""
    path = _folder() / name
    path.write_bytes(data)
    return path
