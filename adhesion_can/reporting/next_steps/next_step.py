"""A finding with the step that follows it, and the commands that the user can type for it."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple


class NextStep(NamedTuple):
    """What was found, and what to do next.

    Attributes:
        finding: Finding in the user's quantities, sentences; '' where there is none.
        action: What to do, a clause without a full stop; it often is or ends with a command.

    """

    finding: str
    action: str

    @property
    def line(self) -> str:
        """Both as one line."""
        return f"{self.finding} Next: {self.action}".lstrip()


@dataclass(frozen=True, slots=True, kw_only=True)
class Typed:
    """What the user typed, from which the next command is made.

    Attributes:
        inputs: Recordings or tables, one at least.
        tables: Whether the inputs are tables.
        program: Command as it can be typed again.
        configuration: Options that name configuration and database, with their values.
        columns: Options that say what the columns of a table are, with their values.
        formulas: Formulas that `diagnose` tests.
        holdout: Data that were given for the gain alone.
        model: Extended model that was used; None: the plain curve.
        outputs: Files that the user named, by option, such as '--extended'.

    """

    inputs: tuple[Path, ...]
    tables: bool = False
    program: str = "adhesion-can"
    configuration: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    formulas: tuple[str, ...] = ()
    holdout: tuple[Path, ...] = ()
    model: Path | None = None
    outputs: Mapping[str, Path] = field(default_factory=dict)

    def with_configuration(self, path: Path) -> "Typed":
        """The same with another configuration, which names its own database."""
        return replace(self, configuration=("--config", _quote(path)))

    def command(self, name: str, *words: Path | str) -> str:
        """A command with the user's configuration.

        Args:
            name: Name of the command.
            words: Its arguments and options, files as paths.

        """
        typed = [self.program, name, *map(_quote, words), *self.configuration]
        return shlex.join(typed)

    def on_inputs(self, name: str, *words: Path | str) -> str:
        """A command on the user's inputs, with the options that it shares with the typed one.

        Args:
            name: Name of the command.
            words: Further inputs, then options; files as paths.

        """
        shared: list[Path | str] = list(self.columns if name in _WITH_COLUMNS else ())
        if name == "diagnose":
            shared += ["--holdout", *self.holdout] if self.holdout else []
            shared += [word for formula in self.formulas for word in ("--formula", formula)]
        return self.command(name, *self.inputs, *words, *shared)

    def new_file(self, stem: str) -> str:
        """Name for a further recording or table, in the format of the inputs."""
        suffixes = [suffix for suffix in self.inputs[0].suffixes if suffix not in _PACKED]
        return stem + "".join(suffixes[-1:])


LIVE = ("-i", "INTERFACE", "-c", "CHANNEL")
"""Options of a bus, for the user to fill in."""
_WITH_COLUMNS = ("check", "diagnose", "evaluate", "identify")
"""Commands that read tables."""
_PACKED = (".gz", ".zst")
"""Suffixes of compressed files, before which the suffix of the format is."""


def _quote(word: Path | str) -> str:
    """A word as an argument: the name of a file must not look like an option."""
    text = str(word)
    return f"./{text}" if isinstance(word, Path) and text.startswith("-") else text
