"""`completion`: a script by which a shell completes commands, options, files and names."""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from adhesion_can.cli.commands import COMMANDS
from adhesion_can.errors import InputError
from adhesion_can.estimation.registry import known_estimators
from adhesion_can.extras import install_extra
from adhesion_can.physics.effects import EFFECTS
from adhesion_can.simulation.scenarios import SCENARIOS

SHELLS = ("bash", "zsh", "fish")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Writes a completion script to stdout (extra 'completion'). bash: run source "
        "<(adhesion-can completion bash), once or in ~/.bashrc. zsh: write it as _adhesion-can "
        "to a folder of $fpath. fish: write it to ~/.config/fish/completions/adhesion-can.fish."
    )
    parser.add_argument("shell", choices=SHELLS, metavar="|".join(SHELLS))


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    try:
        import shtab  # noqa: PLC0415  an extra
    except ImportError as error:
        raise InputError("shtab", "is not installed", install_extra("completion")) from error
    from adhesion_can.cli.main import build_parser  # noqa: PLC0415  it imports this one

    parser = build_parser()
    for name, subparser in _commands(parser).items():
        if name in COMMANDS:
            _complete(name, subparser, shtab.FILE)
    sys.stdout.write(shtab.complete(parser, options.shell))
    return 0


def _commands(parser: argparse.ArgumentParser) -> Mapping[str, argparse.ArgumentParser]:
    """Parsers of the commands, with their options."""
    (action,) = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))  # noqa: SLF001
    parsers: dict[str, argparse.ArgumentParser] = dict(action.choices)
    for subparser in parsers.values():
        subparser.load()  # type: ignore[attr-defined]
    return parsers


def _complete(name: str, parser: argparse.ArgumentParser, file: object) -> None:
    """Say of each option whether it takes a file or one of some names."""
    for action in parser._actions:  # noqa: SLF001
        if action.type is Path or action.dest == "json":
            action.complete = file  # type: ignore[attr-defined]
        elif (names := _NAMES.get((name, action.dest))) is not None:
            action.choices = names()


_NAMES: Mapping[tuple[str, str], Callable[[], Sequence[str]]] = {
    ("simulate", "scenario"): lambda: [scenario.name for scenario in SCENARIOS],
    ("simulate", "effect"): lambda: list(dict.fromkeys(effect.id for effect in EFFECTS)),
    ("replay", "estimator"): lambda: list(known_estimators()),
}
"""Names that an option takes, by command and destination."""
