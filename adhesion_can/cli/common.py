"""Common parts of the commands: options of their inputs, configuration and progress."""

import argparse
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING, Any

from adhesion_can.bus.database import DATABASE_SUFFIXES, CanDatabase
from adhesion_can.cli.bars import bar
from adhesion_can.errors import InputError
from adhesion_can.printable import say

if TYPE_CHECKING:
    from adhesion_can.config import Configuration


SHOWN = 4
"""Number of files that an error names."""


def add_configuration(parser: argparse.ArgumentParser) -> None:
    """Options --config and --dbc."""
    group = parser.add_argument_group("vehicle and database")
    group.add_argument(
        "--config", type=Path, metavar="F", help="vehicle, database and roles (TOML)"
    )
    group.add_argument(
        "--dbc", type=Path, metavar="F", help="CAN database (default: the packaged one)"
    )
    add_lenient(group)


def add_lenient(group: argparse._ActionsContainer) -> None:
    """Option --lenient."""
    group.add_argument("--lenient", action="store_true", help="skip faulty messages of a DBC")


def require_database(path: Path | None) -> None:
    """Raise an InputError where --dbc names no file, with the databases that are beside it."""
    if path is None or path.exists():
        return
    beside = path.parent.glob("*")
    there = sorted(str(file) for file in beside if file.suffix.lower() in DATABASE_SUFFIXES)
    fix = f"check the path, which is relative to {Path.cwd()}"
    if there:
        fix = f"databases in that folder: {', '.join(there[:SHOWN])}"
    raise InputError(f"--dbc {path}", "No such file", fix)


def tell_left_out(database: CanDatabase) -> None:
    """Say on stderr which messages were left out of a database."""
    for sentence in database.left_out:
        say(f"{database.path}: {sentence}")


def add_columns(parser: argparse.ArgumentParser) -> None:
    """Option --column."""
    parser.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="NAME=COLUMN[,unit=U][,sign=-1][,late_s=T]",
        help="map a column of a TABLE, for example slip=kappa,unit=percent; may be repeated",
    )
    parser.add_argument(
        "--assume",
        choices=("plausible",),
        help="use data that look wrong; every output shows the warning",
    )


MODEL_ONLINE = "its effects are removed from the measurements and added to the setpoints"


def add_model(parser: argparse.ArgumentParser, what: str) -> None:
    """Option --model.

    Args:
        parser: Parser of the command.
        what: Use that the command makes of the model, for the help.

    """
    parser.add_argument(
        "--model", type=Path, metavar="F", help=f"extended model that 'diagnose' wrote: {what}"
    )


def configuration(options: argparse.Namespace) -> "Configuration":
    """Configuration that the options name, with the extended model where one is named."""
    from adhesion_can.config import load_configuration  # noqa: PLC0415  `convert` needs none
    from adhesion_can.config.decimal_comma import decimal_commas_named  # noqa: PLC0415

    lenient = getattr(options, "lenient", False)
    require_database(options.dbc)
    with decimal_commas_named(options.config):
        config = load_configuration(options.config, options.dbc, lenient=lenient)
    tell_left_out(config.database)
    stated = getattr(options, "column", [])
    if stated:
        from adhesion_can.recordings.tables.choice import parse_choice  # noqa: PLC0415

        choices = [parse_choice(text) for text in stated]
        named = {choice.name for choice in choices}
        kept = (choice for choice in config.columns if choice.name not in named)
        config = replace(config, columns=(*kept, *choices))
    if getattr(options, "assume", None) is not None:
        config = replace(config, assume_plausible=True)
    model = getattr(options, "model", None)
    if model is None:
        return config
    from adhesion_can.config.model_file import read_model  # noqa: PLC0415  who has a model pays

    return replace(config, model=read_model(model))


@contextmanager
def progress(what: str, total: float, unit: str) -> Iterator[Callable[[float], None]]:
    """Progress of work that is counted; gives the function that takes how much is done."""
    of_all = f"of {total:g} {unit}".rstrip()
    with bar(what) as shown:
        yield lambda done: shown.update(done / total if total else 1.0, f"{done:.0f} {of_all}")


def own_command() -> str:
    """The command as it can be typed again: the path by which it was called, from here."""
    called = Path(sys.argv[0])
    if called.name != "adhesion-can" or which(called.name) == str(called):
        return "adhesion-can"
    here = Path.cwd()
    return str(called.relative_to(here) if called.is_relative_to(here) else called)


def left_out_lines(left_out: Mapping[str, int]) -> list[str]:
    """Sentences about samples without the channels of the extended model, by reason."""
    return [
        f"the extended model dropped {count} samples: {reason}"
        for reason, count in left_out.items()
    ]


def require_positive(value: float, name: str, unit: str = "seconds") -> None:
    """Raise an InputError where an option must be a positive number of a unit and is not."""
    if not (math.isfinite(value) and value > 0):
        raise InputError(name, f"{value:g} is not a positive number", f"give {unit} above 0")


def tell_all(observers: Sequence[Callable[..., None]], *told: Any) -> None:
    """Call each observer with the same arguments."""
    for observer in observers:
        observer(*told)
