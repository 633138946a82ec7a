"""Command `diagnose`: what the simulation gets wrong, why, the extended model and its gain."""

import argparse
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from adhesion_can import __version__
from adhesion_can.cli.common import (
    add_configuration,
    add_json,
    configuration,
    names_of,
    read_problems,
    require_outputs,
    talk,
    write_json,
)
from adhesion_can.config import Configuration
from adhesion_can.config.model_file import write_model
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.from_table import build_drive_data_from_table
from adhesion_can.diagnosis.drive.from_traces import build_drive_data_from_traces
from adhesion_can.diagnosis.result import Diagnosis
from adhesion_can.errors import InputError
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.files import file_sha256
from adhesion_can.offline.load_traces import LoadedTraces, load_traces
from adhesion_can.recordings.sample_table import is_table, read_table
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.reporting.diagnosis import (
    InputFile,
    diagnosis_json,
    extends,
    terminal,
)
from adhesion_can.reporting.diagnosis_page import page
from adhesion_can.reporting.page import require_extra, write_page
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import console

ShowProgress = Callable[[str, float], None]
"""Callback with the name of the work in progress and the share of it that is done."""


@dataclass(frozen=True, slots=True)
class _LoadedInput:
    """An input file with its drive data.

    Attributes:
        input_file: File with its name and hash.
        drive: Drive data of the file.
        problems: Sentence for each kind of content that was left out.

    """

    input_file: InputFile
    drive: DriveData
    problems: list[str]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Holds the adhesion curve and the configured vehicle against recordings or "
        "tables of samples: what they get wrong, the cause where the data identify it, a model "
        "extended by it, and what that gains on data that were held out."
    )
    parser.add_argument("inputs", nargs="+", type=Path, metavar="LOG|TABLE")
    parser.add_argument(
        "--holdout",
        nargs="+",
        type=Path,
        default=[],
        metavar="LOG|TABLE",
        help="measure the gain on these alone (default: on blocks of the inputs)",
    )
    parser.add_argument("--html", type=Path, metavar="F", help="write a page (extra 'report')")
    parser.add_argument(
        "--extended",
        type=Path,
        metavar="MODEL.toml",
        help="write the extended model, for --model of run, replay, identify and simulate",
    )
    add_json(parser)
    add_configuration(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    _require_outputs(options, config)
    input_files = _list_input_files(options)
    with _progress() as show:
        loaded = _load_all(input_files, config, show)
        found = _diagnose(loaded, show)
    command = build_command_line(options)
    problems = [problem for read in loaded for problem in read.problems]
    problems += [
        f"{read.input_file.name}: not one usable row: {_explain_empty(read)}"
        for read in loaded
        if not len(read.drive)
    ]
    origin = provenance(config) | {"command": command}
    del origin["inputs"]  # the diagnosis has more about them
    written = []
    if options.extended is not None:
        problems += _describe_model_file(found, options)
        if found.model is not None:
            write_model(
                _with_provenance(found.model, found, input_files, command), options.extended
            )
            written.append(options.extended)
    write_json(options.json, {**diagnosis_json(found, input_files), "problems": problems, **origin})
    if options.html is not None:
        write_page(page(found, input_files, _page_provenance(origin), problems), options.html)
        written.append(options.html)
    if talk(options):
        written += [] if options.json is None else [options.json]
        _print(found, [*problems, *(f"written: {path}" for path in written)])
    return 0


def build_command_line(options: argparse.Namespace) -> str:
    """The command line that repeats a diagnosis, for a shell."""
    arguments = ["adhesion-can", "diagnose", *map(_quote_argument, options.inputs)]
    if options.holdout:
        arguments += ["--holdout", *map(_quote_argument, options.holdout)]
    for name in ("html", "extended", "json", "config", "dbc"):
        value = getattr(options, name)
        if value is not None:
            arguments += [f"--{name}", _quote_argument(value)]
    return shlex.join(arguments)


def _quote_argument(value: Path | str) -> str:
    """A file as an argument: its name must not look like an option, but for the '-' of --json."""
    text = str(value)
    return f"./{text}" if text.startswith("-") and isinstance(value, Path) else text


# ------------------------------------------------------------------------- before the work


def _require_outputs(options: argparse.Namespace, config: Configuration) -> None:
    """Raise an InputError for outputs that could not be written after the work."""
    written = {f"--{name}": getattr(options, name) for name in ("html", "extended", "json")}
    read = [*options.inputs, *options.holdout, config.database.path]
    require_outputs(options, written, read)
    if options.html is not None:
        require_extra(str(options.html))


def _list_input_files(options: argparse.Namespace) -> list[InputFile]:
    """Input files without duplicates: recordings or tables, not both."""
    given = [(path, False) for path in options.inputs]
    given += [(path, True) for path in options.holdout]
    for path, _ in given:
        if not path.is_file():
            reason = "is a folder" if path.is_dir() else "No such file or directory"
            raise InputError(str(path), reason, "check the path")
    tables = [path for path, _ in given if is_table(path)]
    if tables and len(tables) < len(given):
        raise InputError("diagnose", "recordings and tables together", "give one kind at a time")
    names = names_of([path for path, _ in given])
    input_files: dict[str, InputFile] = {}
    for name, (path, held_out) in zip(names, given, strict=True):
        input_file = InputFile(path, name, file_sha256(path), held_out)
        before = input_files.get(input_file.sha256)
        if before is not None:
            raise _duplicate_error(input_file, before)
        input_files[input_file.sha256] = input_file
    return list(input_files.values())


def _duplicate_error(input_file: InputFile, before: InputFile) -> InputError:
    if input_file.held_out and not before.held_out:
        return InputError(
            f"--holdout {input_file.path}",
            f"holds the same as the input {before.path}",
            "hold out another drive, or leave --holdout away",
        )
    return InputError(str(input_file.path), f"holds the same as {before.path}", "give it once")


# ------------------------------------------------------------------------------------ work


@contextmanager
def _progress() -> Iterator[ShowProgress]:
    """Progress bar on stderr where it is a terminal."""
    err = console(sys.stderr)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=err,
        transient=True,
        disable=not err.is_terminal,
    )
    with bar:
        task = bar.add_task("reading", total=1.0)
        yield lambda work, done: bar.update(task, description=work, completed=done)


def _load_all(
    input_files: Sequence[InputFile], config: Configuration, show: ShowProgress
) -> list[_LoadedInput]:
    tables = is_table(input_files[0].path)
    if not tables:
        config.require_identification()
    loaded = []
    for number, input_file in enumerate(input_files):
        show(f"reading {input_file.name}", number / len(input_files))
        one = _load_table(input_file, config) if tables else _load_log(input_file, config)
        loaded.append(one)
    return loaded


def _load_log(input_file: InputFile, config: Configuration) -> _LoadedInput:
    recordings = open_recordings([input_file.path])
    received = load_traces(blocks_in_sequence(recordings), config, str(input_file.path))
    drive = build_drive_data_from_traces(
        input_file.name,
        received.traces(),
        config.vehicle,
        config.sampling.v_min,
        config.estimators.identifiability.slip_max,
    )
    problems = read_problems(recordings, names=[input_file.name])
    return _LoadedInput(
        input_file, drive, [*problems, *_describe_unused_frames(input_file, received)]
    )


def _describe_unused_frames(input_file: InputFile, received: LoadedTraces) -> list[str]:
    problems = []
    if received.rejected:
        problems.append(f"{input_file.name}: {received.rejected} frames failed their checks")
    if received.derived:
        problems.append(
            f"{input_file.name}: {received.derived} vehicle speeds derived from the driven axles "
            "were left out: they carry no slip"
        )
    if received.trailing:
        problems.append(
            f"{input_file.name}: the vehicle speed comes from a trailing axle, and the error of "
            "its radius is in every slip"
        )
    return problems


def _load_table(input_file: InputFile, config: Configuration) -> _LoadedInput:
    rows = read_table(input_file.path)
    slip_max = config.estimators.identifiability.slip_max
    drive = build_drive_data_from_table(input_file.name, rows.samples, rows.segment, slip_max)
    problems = []
    if rows.left_out:
        problems.append(
            f"{input_file.name}: {rows.left_out} of {rows.rows} rows without a finite time, slip "
            "and adhesion"
        )
    return _LoadedInput(input_file, drive, problems)


def _diagnose(loaded: Sequence[_LoadedInput], show: ShowProgress) -> Diagnosis:
    """The diagnosis of what was read."""
    from adhesion_can.diagnosis.diagnose import diagnose  # noqa: PLC0415  heavy, and here alone

    parts = [
        [read for read in loaded if read.input_file.held_out is held] for held in (False, True)
    ]
    for part in parts:
        if part and not any(len(read.drive) for read in part):
            raise InputError(
                ", ".join(str(read.input_file.path) for read in part),
                f"not one usable row: {_explain_empty(part[0])}",
                "give a drive in which the vehicle moves and its axles pull or brake",
            )
    drives, holdout = ([read.drive for read in part] for part in parts)
    return diagnose(drives, holdout, show=show)


def _explain_empty(read: _LoadedInput) -> str:
    """Why a file gave no rows."""
    reasons = [f"{count} {reason}" for reason, count in read.drive.lost.items() if count]
    return "; ".join([*reasons, *read.problems]) or "no signal was received"


# --------------------------------------------------------------------------------- results


def _with_provenance(
    model: ExtendedModel, found: Diagnosis, input_files: Sequence[InputFile], command: str
) -> ExtendedModel:
    inputs = {
        f"input {number}": f"{input_file.path} sha256 {input_file.sha256}"
        + (" (held out)" if input_file.held_out else "")
        for number, input_file in enumerate(input_files, start=1)
    }
    origin = {"version": __version__, "command": command, "verdict": found.verdict.value}
    return replace(model, provenance={**origin, **inputs})


def _describe_model_file(found: Diagnosis, options: argparse.Namespace) -> list[str]:
    """Notes about the file of --extended."""
    if found.model is None:
        return [f"--extended {options.extended}: not written, for no curve could be fitted"]
    if not extends(found):
        return [f"--extended {options.extended}: the plain curve, for there is no extension"]
    return []


def _page_provenance(origin: dict[str, Any]) -> dict[str, str]:
    """Provenance for a page."""
    entries = {"command": str(origin["command"]), "version": str(origin["version"])}
    for name in ("dbc", "configuration"):
        one = origin[name]
        hashed = f", sha256 {one['sha256']}" if one["sha256"] else ""
        entries[name] = f"{one['path']}{hashed}"
    return entries


def _print(found: Diagnosis, notes: Sequence[str]) -> None:
    out = console()
    for part in terminal(found):
        if isinstance(part, str):
            # Names of files hold brackets, which are no markup.
            out.print(part, markup=False)
        else:
            out.print(part)
    for note in notes:
        out.print(note, markup=False)
