"""`diagnose`: what the simulation gets wrong, why, the extended model and its gain."""

import argparse
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain
from pathlib import Path

from adhesion_can.api.diagnosis import (
    diagnose_inputs,
    explain_empty,
    list_input_files,
    load_inputs,
)
from adhesion_can.api.formulas import read_formulas
from adhesion_can.cli.bars import bar
from adhesion_can.cli.common import add_columns, add_configuration, configuration
from adhesion_can.cli.next_step import typed_words
from adhesion_can.cli.outputs import add_file, add_json, require_outputs
from adhesion_can.cli.reports import Result, add_report, is_asked_for
from adhesion_can.config.model_file import write_model
from adhesion_can.config.plan_file import write_plan
from adhesion_can.diagnosis.diagnose import ShowProgress
from adhesion_can.diagnosis.result import Diagnosis
from adhesion_can.estimation.extended.model import ExtendedModel
from adhesion_can.reporting.diagnosed_drives import drive_parts, spans_of_a_drive
from adhesion_can.reporting.diagnosis import has_extension, terminal
from adhesion_can.reporting.diagnosis_page import page
from adhesion_can.reporting.next_steps.after_diagnosis import after_diagnosis
from adhesion_can.reporting.provenance import provenance
from adhesion_can.simulation.plan_limits import limits_of
from adhesion_can.version import __version__


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Compares the adhesion curve and the configured vehicle with recordings or tables of "
        "samples. Reports where they are wrong, the cause if the data identify it, a model "
        "extended by the cause, and its gain on held-out data."
    )
    parser.add_argument("inputs", nargs="+", type=Path, metavar="LOG|TABLE")
    parser.add_argument(
        "--holdout",
        nargs="+",
        type=Path,
        default=[],
        metavar="LOG|TABLE",
        help=(
            "measure the gain on these only (default: on blocks of the inputs, or on a third of "
            "several recordings of similar length)"
        ),
    )
    add_report(parser)
    add_file(
        parser,
        "--extended",
        "MODEL.toml",
        "write the extended model, for --model of run, replay, identify and simulate",
    )
    add_file(
        parser,
        "--next-drive",
        "PLAN.toml",
        "compute the shortest drive that distinguishes the remaining explanations, within "
        "[limits] of the configuration, and write it for --plan of control and simulate",
    )
    parser.add_argument(
        "--witness",
        action="store_true",
        help=(
            "use the service as a second witness of named causes: if its doubt on the longest "
            "recording remains with the extended model, they are not named"
        ),
    )
    parser.add_argument(
        "--formula",
        action="append",
        default=[],
        metavar="TEXT",
        help=(
            "test your own formula like an effect: the factor of the adhesion, and start values "
            "of its constants, the size first: '1 + a * max(wind - b, 0) where a=0.1, b=5'; "
            "with the prefix 'speed:' or 'effort:', the factor of that reading over its true "
            "value"
        ),
    )
    add_columns(parser)
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    require_outputs(options, [*options.inputs, *options.holdout, config.database.path])
    formulas, planned = read_formulas(options.formula), options.next_drive is not None
    input_files = list_input_files(options.inputs, options.holdout, config.columns)
    with _progress() as show:
        spans = spans_of_a_drive(len(input_files)) if is_asked_for(options) else 0
        loaded = load_inputs(input_files, config, show, spans)
        sourced = limits_of(config.vehicle, config.limits, config.messages) if planned else None
        diagnosis = diagnose_inputs(
            loaded,
            show,
            formulas,
            limits=sourced.limits if sourced else None,
            witness=config if options.witness else None,
        )
    is_table = any(read.drive.table for read in loaded)
    step = after_diagnosis(diagnosis, typed_words(options, options.inputs, tables=is_table), config)
    diagnosis = replace(diagnosis, next_step=step.line)
    command = build_command_line(options)
    problems = [problem for read in loaded for problem in read.problems]
    problems += [
        f"{read.input_file.name}: no usable row: {explain_empty(read)}"
        for read in loaded
        if not len(read.drive)
    ]
    origin = provenance(config) | {"command": command}
    del origin["inputs"]  # the diagnosis has more about them
    written = []
    if options.extended is not None:
        problems += _describe_model_file(diagnosis, options)
        if diagnosis.model is not None:
            write_model(_with_provenance(diagnosis.model, diagnosis, command), options.extended)
            written.append(options.extended)
    if sourced is not None:
        plan = None if diagnosis.next_drive is None else diagnosis.next_drive.plan
        if plan is not None:
            write_plan(plan, options.next_drive, sourced.sources_of(plan.limits))
            written.append(options.next_drive)
        else:
            problems.append(f"--next-drive {options.next_drive}: not written, there is no plan")
    written += [] if options.json is None else [options.json]
    drives = {read.input_file.name: read.signals for read in loaded if read.signals is not None}
    Result(
        document={**diagnosis.to_dict(), "problems": problems},
        origin=origin,
        parts=chain(terminal(diagnosis), problems, (f"written: {path}" for path in written)),
        step=step,
        page=lambda said: page(diagnosis, said, problems, drive_parts(drives, config, diagnosis)),
    ).deliver(options)
    return 0


def build_command_line(options: argparse.Namespace) -> str:
    """The command line that repeats a diagnosis, for a shell."""
    arguments = ["adhesion-can", "diagnose", *map(_quote_argument, options.inputs)]
    if options.holdout:
        arguments += ["--holdout", *map(_quote_argument, options.holdout)]
    for text in options.formula:
        arguments += ["--formula", text]
    for text in options.column:
        arguments += ["--column", text]
    named = {output.option: output.value(options) for output in options.outputs if output.is_file}
    for option, value in {**named, "--config": options.config, "--dbc": options.dbc}.items():
        if value is not None:
            arguments += [option, _quote_argument(value)]
    arguments += [f"--{name}" for name in ("witness", "open", "lenient") if getattr(options, name)]
    return shlex.join(arguments)


def _quote_argument(value: Path | str) -> str:
    """A file as an argument: its name must not look like an option, but for the '-' of --json."""
    text = str(value)
    return f"./{text}" if text.startswith("-") and isinstance(value, Path) else text


# ------------------------------------------------------------------------------------ work


@contextmanager
def _progress() -> Iterator[ShowProgress]:
    """Progress of the work."""
    with bar("reading") as shown:
        yield lambda work, done: shown.update(done, what=work)


# --------------------------------------------------------------------------------- results


def _with_provenance(model: ExtendedModel, diagnosis: Diagnosis, command: str) -> ExtendedModel:
    inputs = {
        f"input {number}": f"{input_file.path} sha256 {input_file.sha256}"
        + (" (held out)" if input_file.held_out else "")
        for number, input_file in enumerate(diagnosis.input_files, start=1)
    }
    origin = {"version": __version__, "command": command, "verdict": diagnosis.verdict.value}
    return replace(model, provenance={**origin, **inputs})


def _describe_model_file(diagnosis: Diagnosis, options: argparse.Namespace) -> list[str]:
    """Notes about the file of --extended."""
    if diagnosis.model is None:
        return [f"--extended {options.extended}: not written, because no curve could be fitted"]
    if not has_extension(diagnosis):
        what = "contains the plain curve, because there is no extension"
        return [f"--extended {options.extended}: {what}"]
    return []
