"""Filter of the signals that --signals names."""

from collections.abc import Sequence
from fnmatch import fnmatchcase

from adhesion_can.bus.database import CanDatabase
from adhesion_can.errors import InputError, suggest


class SignalFilter:
    """Filter of the signals that --signals names.

    Args:
        database: Database of the signals.
        globs: Patterns of --signals.

    Raises:
        InputError: A pattern matches no message or signal.

    """

    def __init__(self, database: CanDatabase, globs: Sequence[str]) -> None:
        self._globs = globs
        names = [(m.name, s.name) for m in database.db.messages for s in m.signals]
        for glob in globs:
            if not any(_matches(glob, *name) for name in names):
                forms = [form for m, s in names for form in (m, s, f"{m}.{s}")]
                raise InputError(
                    f"--signals {glob}",
                    f"matches no message or signal of {database.path.name}",
                    suggest(glob, forms) or "'cantools dump' lists what there is",
                )

    def __call__(self, message: str, signal: str) -> bool:
        """Whether a pattern names a signal of a message."""
        return any(_matches(glob, message, signal) for glob in self._globs)


def _matches(glob: str, message: str, signal: str) -> bool:
    return any(fnmatchcase(name, glob) for name in (f"{message}.{signal}", signal, message))
