"""The errors that a caller may want to catch, in one small tree.

    AdhesionCanError
        InputError               something that the user handed in
            ConfigError          a configuration, a model or a plan
            DatabaseError        a CAN database
            RecordingError       a recording
            TableError           a table of samples
            BusError             a bus
            PluginError          an installed extension
        LimitError               a file that takes more than its reader may (recordings.limited)

Every message names what is wrong, where, and how to fix it, on one line.
"""

from collections.abc import Iterable


class AdhesionCanError(Exception):
    """Base of every error that this package raises on purpose."""


class InputError(AdhesionCanError):
    """Something that the user handed in cannot be used.

    Args:
        where: File, line, key or signal, as the user would look it up.
        what: Fault of the input.
        fix: Advice how to fix it.

    """

    def __init__(self, where: str, what: str, fix: str) -> None:
        # A key or a file name may hold a line break; the message may not.
        self.where, self.what, self.fix = (" ".join(text.split()) for text in (where, what, fix))
        super().__init__(f"{self.where}: {self.what}; {self.fix}")


class ConfigError(InputError):
    """A configuration file with an unknown key, a wrong unit or a wrong value."""


class DatabaseError(InputError):
    """A CAN database that cannot be read, or that lacks a needed message or signal."""


class RecordingError(InputError):
    """A recording that cannot be read, or that holds no known frame."""


class TableError(InputError):
    """A table of samples without the columns that it needs."""


class BusError(InputError):
    """A bus that does not exist or cannot be opened."""


class PluginError(InputError):
    """An installed extension that cannot be loaded, or that is no effect or estimator."""


def suggest(name: str, known: Iterable[str]) -> str:
    """Names that are written alike, as a clause for an error; '' where there is none.

    Args:
        name: Name that was given.
        known: Names that there are.

    """
    from difflib import get_close_matches  # noqa: PLC0415  needed where a name is wrong, no sooner

    forms = {known_name.lower(): known_name for known_name in known}
    matches = get_close_matches(name.lower(), forms, n=3, cutoff=0.5)
    return f"similar names: {', '.join(forms[form] for form in matches)}" if matches else ""
