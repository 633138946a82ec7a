"""Outputs of the commands: the row of each makes its option and its check; and JSON."""

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.recordings.formats import require_text_name

Check = Callable[[Any, str], object]
"""Raises an InputError where the value of an option cannot serve; takes the value and the name."""


class Output(NamedTuple):
    """Option that asks for an output.

    Attributes:
        option: Name of the option.
        check: Check of its value before the work, besides that of a file's place; None: none.
        is_file: Whether its value names a file.

    """

    option: str
    check: Check | None = None
    is_file: bool = True

    def add(
        self,
        parser: argparse.ArgumentParser,
        group: argparse._ActionsContainer | None = None,
        **settings: Any,
    ) -> None:
        """Add the option to a parser, or to a group of it, so that `require_outputs` finds it."""
        (group or parser).add_argument(self.option, **settings)
        parser.set_defaults(outputs=(*(parser.get_default("outputs") or ()), self))

    def value(self, options: argparse.Namespace) -> Any:
        """Value that was given; None or False where there is none."""
        return getattr(options, self.option.removeprefix("--").replace("-", "_"))


def add_file(
    parser: argparse.ArgumentParser,
    option: str,
    metavar: str,
    what: str,
    check: Check | None = None,
    group: argparse._ActionsContainer | None = None,
) -> None:
    """Option that names a file to be written.

    Args:
        parser: Parser of the command.
        option: Name of the option.
        metavar: Name of the file in the help.
        what: What the help says about it.
        check: Check of its value before the work, besides that of its place; None: none.
        group: Group of the help; None: none.

    """
    Output(option, check).add(parser, group, type=Path, metavar=metavar, help=what)


def add_json(parser: argparse.ArgumentParser, what: str = "write the result as JSON") -> None:
    """Option --json."""
    Output("--json").add(parser, metavar="F", help=f"{what}; - for stdout")


def require_candump_name(path: Path, option: str) -> None:
    """Raise an InputError where a file of candump text has the name of another format."""
    require_text_name(path, f"{option} {path}")


def require_outputs(
    options: argparse.Namespace,
    read: Iterable[Path] = (),
    *,
    own: Mapping[str, Path] | None = None,
    renewed: str = "",
) -> None:
    """Raise an InputError where an output cannot be, or would take the place of another file.

    Called before the work, which may take hours or be a recording.

    Args:
        options: Options, of which --config, --dbc and --model are inputs as well.
        read: Paths of the other inputs.
        own: Further outputs, whose names the command makes, by what the user calls them.
        renewed: Option that may name the file of --config, which is read before it is written.

    """
    given = {name: getattr(options, name, None) for name in ("config", "dbc", "model")}
    inputs = (*read, *(path for path in given.values() if path is not None))
    taken = {_place(path): "one of the inputs" for path in inputs}
    config = None if given["config"] is None else _place(given["config"])
    written: list[tuple[Output, Any]] = [(Output(name), path) for name, path in (own or {}).items()]
    written += [(output, output.value(options)) for output in options.outputs]
    for output, value in written:
        if value in (None, False, "-"):
            continue
        if output.is_file:
            option, path = output.option, Path(value)
            where = f"{option} {path}"
            place = _place(path, where)
            if path.is_dir():
                raise InputError(where, "is a folder", "name a file")
            if not path.resolve().parent.is_dir():
                raise InputError(where, "its folder does not exist", "create the folder first")
            if place in taken and not (option == renewed and place == config):
                raise InputError(where, f"is {taken[place]}", "name another file")
            taken[place] = f"also the file of {option}"
        if output.check is not None:
            output.check(value, output.option)


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
