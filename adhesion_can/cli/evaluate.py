"""`evaluate`: a model on recordings or tables, as written and with its curve refitted."""

import argparse
from dataclasses import replace
from pathlib import Path

from adhesion_can.api.diagnosis import list_input_files, load_inputs
from adhesion_can.api.evaluation import evaluate_inputs
from adhesion_can.cli.common import (
    add_columns,
    add_configuration,
    add_json,
    configuration,
    progress,
    require_outputs,
    talk,
    write_json,
)
from adhesion_can.cli.next_step import print_next, typed_words
from adhesion_can.cli.reports import (
    add_report,
    is_asked_for,
    page_provenance,
    report_files,
    require_report,
    write_report,
)
from adhesion_can.diagnosis.model_worth import judge_model
from adhesion_can.plurals import counted
from adhesion_can.reporting.evaluation import page, render_evaluation
from adhesion_can.reporting.next_steps.after_recording import after_evaluation
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import console


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Compares an extended model, as written and with its curve refitted, with the plain "
        "curve on recordings or tables, for each recording and each surface."
    )
    parser.add_argument("inputs", nargs="+", type=Path, metavar="LOG|TABLE")
    parser.add_argument(
        "--model", type=Path, metavar="F", required=True, help="model written by 'diagnose'"
    )
    add_columns(parser)
    add_report(parser)
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    written = {"--json": options.json, **report_files(options)}
    require_outputs(options, written, [*options.inputs, config.database.path])
    require_report(options)
    input_files = list_input_files(options.inputs, columns=config.columns)
    with progress("reading", len(input_files), "") as done:
        loaded = load_inputs(
            input_files, config, lambda _work, share: done(share * len(input_files))
        )
    found = evaluate_inputs(loaded, config)
    problems = [problem for one in loaded for problem in one.problems]
    if found.left_out:
        rows = counted(found.left_out, "row")
        problems.append(f"dropped {rows}: the effects of the model have no finite value there")
    origin = provenance(config, options.inputs)
    is_table = any(one.drive.table for one in loaded)
    step = after_evaluation(found, typed_words(options, options.inputs, tables=is_table))
    document = {**found.to_dict(), "worth": judge_model(found.total.refitted).value}
    write_json(options.json, {**document, "problems": problems, "next": step.line, **origin})
    lines = []
    if is_asked_for(options):
        entries = page_provenance(origin, options)
        report = page(found, str(options.model), problems, entries)
        lines = write_report(replace(report, next_step=step.line), options)
    if talk(options):
        out = console()
        for part in render_evaluation(found):
            out.print(part, markup=False) if isinstance(part, str) else out.print(part)
        for line in (*problems, *lines):
            out.print(line, markup=False)
        print_next(step)
    return 0
