"""Common parts of the commands: options, opening a bus, writing JSON, progress."""

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from shutil import which
from typing import TYPE_CHECKING, Any

from adhesion_can.bus.database import DATABASE_SUFFIXES, CanDatabase
from adhesion_can.cli.bars import bar
from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.printable import say
from adhesion_can.recordings.formats import require_text_name

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
        "--dbc", type=Path, metavar="F", help=("CAN database (default: the packaged one)")
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
    there = sorted(str(one) for one in beside if one.suffix.lower() in DATABASE_SUFFIXES)
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


def add_json(parser: argparse.ArgumentParser) -> None:
    """Option --json."""
    parser.add_argument("--json", metavar="F", help="write the result as JSON; - for stdout")


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


def write_json(target: str | None, document: dict[str, Any], *, own_name: bool = False) -> None:
    """Write a result to the target of --json; None for no output; `own_name` as of a whole file."""
    if target is None:
        return
    text = json.dumps(finite(document), indent=2, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
    else:
        with whole_file(Path(target), own_name=own_name) as file:
            file.write(text)


def finite(value: Any) -> Any:
    """Value with None for every number that JSON cannot express."""
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def talk(options: argparse.Namespace) -> bool:
    """Whether stdout is free for text: not when it carries the JSON."""
    return getattr(options, "json", None) != "-"


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


_CANDUMP_OPTIONS = ("--log", "--frames", "--record")
"""Options that name an output of candump text."""


def require_outputs(
    options: argparse.Namespace,
    written: Mapping[str, Path | str | None],
    read: Iterable[Path] = (),
    *,
    renewed: str = "",
) -> None:
    """Raise an InputError where an output cannot be, or would take the place of another file.

    Called before the work, which may take hours or be a recording.

    Args:
        options: Options, of which --config, --dbc and --model are inputs as well.
        written: Outputs by their options; None and '-' are none.
        read: Paths of the other inputs.
        renewed: Option that may name the file of --config, which is read before it is written.

    """
    given = {name: getattr(options, name, None) for name in ("config", "dbc", "model")}
    inputs = (*read, *(path for path in given.values() if path is not None))
    taken = {_place(path): "one of the inputs" for path in inputs}
    config = None if given["config"] is None else _place(given["config"])
    for option, value in written.items():
        if value is None or value == "-":
            continue
        path = Path(value)
        where = f"{option} {path}"
        place = _place(path, where)
        if path.is_dir():
            raise InputError(where, "is a folder", "name a file")
        if not path.resolve().parent.is_dir():
            raise InputError(where, "its folder does not exist", "create the folder first")
        if place in taken and not (option == renewed and place == config):
            raise InputError(where, f"is {taken[place]}", "name another file")
        taken[place] = f"also the file of {option}"
        if option in _CANDUMP_OPTIONS:
            require_text_name(path, where)


def _place(path: Path, where: str = "") -> tuple[int, int] | Path:
    """Identity of a file whatever its name; links are followed."""
    try:
        state = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return path.resolve()
    except OSError as error:
        raise InputError(
            where or str(path), error.strerror or "cannot be used", "check the path"
        ) from error
    return state.st_dev, state.st_ino


def make_folder(path: Path, option: str) -> None:
    """Make an output's folder; raise an InputError where that cannot be done."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"{option} {path}", error.strerror or "cannot be created", "name another folder"
        ) from error
