"""`evaluate`: a model on recordings or tables, as written and with its curve refitted."""

import argparse
from itertools import chain
from pathlib import Path

from adhesion_can.api.diagnosis import list_input_files, load_inputs
from adhesion_can.api.evaluation import evaluate_inputs
from adhesion_can.cli.common import add_columns, add_configuration, configuration, progress
from adhesion_can.cli.next_step import typed_words
from adhesion_can.cli.outputs import add_json, require_outputs
from adhesion_can.cli.reports import Result, add_report
from adhesion_can.diagnosis.model_worth import judge_model
from adhesion_can.plurals import counted
from adhesion_can.reporting.evaluation import page, render_evaluation
from adhesion_can.reporting.next_steps.after_recording import after_evaluation
from adhesion_can.reporting.provenance import provenance


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
    require_outputs(options, [*options.inputs, config.database.path])
    input_files = list_input_files(options.inputs, columns=config.columns)
    with progress("reading", len(input_files), "") as done:
        loaded = load_inputs(
            input_files, config, lambda _work, share: done(share * len(input_files))
        )
    evaluation = evaluate_inputs(loaded, config)
    problems = [problem for loaded_input in loaded for problem in loaded_input.problems]
    if evaluation.left_out:
        rows = counted(evaluation.left_out, "row")
        problems.append(f"dropped {rows}: the effects of the model have no finite value there")
    is_table = any(loaded_input.drive.table for loaded_input in loaded)
    worth = judge_model(evaluation.total.refitted).value
    Result(
        document={**evaluation.to_dict(), "worth": worth, "problems": problems},
        origin=provenance(config, options.inputs),
        parts=chain(render_evaluation(evaluation), problems),
        step=after_evaluation(evaluation, typed_words(options, options.inputs, tables=is_table)),
        page=lambda said: page(evaluation, str(options.model), problems, said),
    ).deliver(options)
    return 0
