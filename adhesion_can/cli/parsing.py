"""Parsers of the whole and of each command: loading, help, and errors on one line."""

import argparse
import gc
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any, NoReturn

from adhesion_can.cli.commands import COMMANDS, GROUPS, example_lines
from adhesion_can.errors import suggest
from adhesion_can.printable import say


class HelpFormatter(argparse.HelpFormatter):
    """Help with commands by their use, texts in lines as they are, and folded options left out."""

    def add_usage(
        self,
        usage: str | None,
        actions: Iterable[argparse.Action],
        groups: Iterable[Any],
        prefix: str | None = None,
    ) -> None:
        """Usage without the folded options."""
        shown = [action for action in actions if not is_folded(action)]
        super().add_usage(usage, shown, groups, prefix)

    def add_argument(self, action: argparse.Action) -> None:
        """Line of an argument; none of a folded option."""
        if not is_folded(action):
            super().add_argument(action)

    def _format_action(self, action: argparse.Action) -> str:
        if not isinstance(action, argparse._SubParsersAction):  # noqa: SLF001
            return super()._format_action(action)
        width = max(map(len, COMMANDS))
        lines = []
        for group, about in GROUPS.items():
            lines.append(f"  {group}: {about}")
            names = (name for name in action.choices if COMMANDS[name].group == group)
            lines += [f"    {name:{width}}  {COMMANDS[name].line}" for name in names]
        return "\n".join(lines) + "\n"

    def _format_action_invocation(self, action: argparse.Action) -> str:
        """'-i, --interface NAME', as from Python 3.13 on."""
        if not action.option_strings or action.nargs == 0:
            return super()._format_action_invocation(action)
        value = self._format_args(action, self._get_default_metavar_for_optional(action))
        return f"{', '.join(action.option_strings)} {value}"

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        if "\n" not in text:
            return super()._fill_text(text, width, indent)
        return "".join(f"{indent}{line}" for line in text.splitlines(keepends=True))


def fold(action: argparse.Action) -> None:
    """Leave an option out of the help; it is taken, and completed by a shell, all the same."""
    action.is_folded = True  # type: ignore[attr-defined]


def is_folded(action: argparse.Action) -> bool:
    """Whether an option is left out of the help."""
    return getattr(action, "is_folded", False)


class Parser(argparse.ArgumentParser):
    """One line on stderr for wrong usage, as for every other error."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **{"formatter_class": HelpFormatter, **kwargs})

    def error(self, message: str) -> NoReturn:
        """End with status 2 and one line that names the help."""
        self.exit(2, f"{self.prog}: {message}; see '{self.prog} --help'\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        """An error names words that were given; help has several lines of our own."""
        text = message.rstrip("\n")
        if file is sys.stderr:
            say(text)
        else:
            super()._print_message(message, file)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """A value that is none of the choices, with those that are written alike."""
        if action.choices is None or value in action.choices:
            return
        known = [str(choice) for choice in action.choices]
        near = suggest(str(value), known)
        fix = near or f"known: {', '.join(known)}"
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001
            self.error(f"no command {value!r}; {fix}")
        name = "/".join(action.option_strings) or str(action.metavar or action.dest)
        self.error(f"{name}: no {str(value)!r}; {fix}")


class CommandParser(Parser):
    """Parser of one command, whose options are added when the command is called."""

    command: str | None = None
    """Command whose options have not been added yet; None: they have."""

    def load(self) -> None:
        """Add the options of the command, once."""
        name, self.command = self.command, None
        if name is None:
            return
        with _garbage_collection_paused():
            module = import_module(f"adhesion_can.cli.{name}")
        module.add_arguments(self)
        self.add_argument(
            "--progress",
            action=argparse.BooleanOptionalAction,
            help="report the progress of long work on stderr (default: on a terminal)",
        )
        self.epilog = "\n".join(["examples:", *(f"  {line}" for line in example_lines(name))])
        self.set_defaults(run=module.run)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Options of the command, loaded before; an unknown word is an error of this command."""
        self.load()
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            self.error(self._describe_unknown(unknown[0]))  # its own help, not that of the whole
        return options, unknown

    def _describe_unknown(self, word: str) -> str:
        if not word.startswith("-"):
            return f"{word!r} is one argument too many"
        name = word.partition("=")[0]
        near = suggest(name, self._option_string_actions)
        return f"no option {name}" + (f"; {near}" if near else "")


@contextmanager
def _garbage_collection_paused() -> Iterator[None]:
    """No garbage collection: modules that load leave no garbage, and looking takes a tenth."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
