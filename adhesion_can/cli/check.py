"""`check`: whether a recording or a table is usable."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from adhesion_can.api.inputs import describe_left_out
from adhesion_can.api.samples import are_tables
from adhesion_can.cli.common import (
    add_columns,
    add_configuration,
    add_json,
    configuration,
    require_outputs,
    talk,
    write_json,
)
from adhesion_can.cli.next_step import print_next, typed_words
from adhesion_can.cli.reading import reading
from adhesion_can.cli.reports import (
    add_report,
    is_asked_for,
    page_provenance,
    report_files,
    require_report,
    write_report,
)
from adhesion_can.config import Configuration
from adhesion_can.offline.check import CheckResult, check
from adhesion_can.offline.check_table import TableCheck, check_table
from adhesion_can.offline.recording_fit import SeenIds, require_accepted
from adhesion_can.offline.stamps import in_seconds
from adhesion_can.recordings.problems import describe_problems, describe_remarks, distinct_names
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.recordings.tables.sample_table import read_table
from adhesion_can.reporting.check_page import (
    COLUMN_COLUMNS,
    NOISE_COLUMNS,
    SIGNAL_COLUMNS,
    column_rows,
    noise_row,
    recording_page,
    signal_rows,
    table_page,
)
from adhesion_can.reporting.check_words import KINDS, NOISE_NOTE, Checked, legend, verdict
from adhesion_can.reporting.data_quality import MESSAGE_COLUMNS, message_rows
from adhesion_can.reporting.next_steps.after_recording import after_check
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import console, table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Processes recordings as the service would, and reports signals, rates, gaps, checksum "
        "and counter faults, and excitation. For a table, it reports how each column is read. "
        "The exit status is 1 if slip or adhesion are implausible or something else is wrong."
    )
    parser.add_argument("log", nargs="+", type=Path, metavar="LOG|TABLE")
    add_columns(parser)
    add_report(parser)
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    written = {"--json": options.json, **report_files(options)}
    require_outputs(options, written, [*options.log, config.database.path])
    require_report(options)
    if are_tables(options.log, config):
        return _check_tables(options, config)
    recordings = open_recordings(options.log)
    where = ", ".join(map(str, options.log))
    with reading("checking", recordings) as watched:
        blocks = watched(blocks_in_sequence(recordings, config.service.restart_s))
        seen = SeenIds()
        result = check(seen.watch(in_seconds(blocks, config.messages, where)), config)
    if not any(record.frames for record in result.receiver.records):
        require_accepted(result.receiver, result.frames, seen, config, where)
    result.failures.extend(describe_problems(recordings, with_remarks=False))
    result.warnings.extend(describe_remarks(recordings))
    names = distinct_names(options.log)
    result.findings[:0] = [f"{n}: {r.kind}" for n, r in zip(names, recordings, strict=True)]
    origin = provenance(config, options.log)
    step = after_check([result], typed_words(options, options.log))
    write_json(options.json, {**result.as_json(), "next": step.line, **origin})
    lines = []
    if is_asked_for(options):
        report = recording_page(result, config, page_provenance(origin, options))
        lines = write_report(replace(report, next_step=step.line), options)
    if talk(options):
        _print(result)
        _print_lines(lines)
        print_next(step)
    return 1 if result.failures else 0


def _check_tables(options: argparse.Namespace, config: Configuration) -> int:
    slip_max = config.estimators.identifiability.slip_max
    results = []
    for name, path in zip(distinct_names(options.log), options.log, strict=True):
        rows = read_table(path, config.columns)
        results.append(check_table(name, rows, describe_left_out(rows, slip_max), config))
    step = after_check(results, typed_words(options, options.log, tables=True))
    document = {"tables": [result.to_dict() for result in results], "next": step.line}
    origin = provenance(config, options.log)
    write_json(options.json, {**document, **origin})
    lines = []
    if is_asked_for(options):
        report = table_page(results, page_provenance(origin, options))
        lines = write_report(replace(report, next_step=step.line), options)
    if talk(options):
        for result in results:
            _print_table(result)
        _print_lines(lines)
        print_next(step)
    return 1 if any(result.failures for result in results) else 0


def _print_lines(lines: Sequence[str]) -> None:
    for line in lines:
        console().print(line, markup=False)


def _print_table(result: TableCheck) -> None:
    out = console()
    title = f"{result.name}: {result.rows} rows"
    out.print(table(title, COLUMN_COLUMNS, column_rows(result)))
    _print_sentences(result)


def _print(result: CheckResult) -> None:
    out = console()
    out.print(
        f"{result.frames} frames in {result.duration_s:.1f} s{result.times.note}, "
        f"{result.unknown} with other ids; {len(result.samples)} samples"
    )
    out.print(table("Messages", MESSAGE_COLUMNS, message_rows(result.receiver.records)))
    if result.misfit is None or not result.misfit.of_other_bus:
        _print_signals(result)
    _print_sentences(result)


def _print_signals(result: CheckResult) -> None:
    out = console()
    out.print(table("Signals", SIGNAL_COLUMNS, signal_rows(result)))
    if result.noise:
        noise = [noise_row(compared) for compared in result.noise]
        out.print(table("Noise, standard deviation", NOISE_COLUMNS, noise))
        out.print(NOISE_NOTE)
        out.print()


def _print_sentences(result: Checked) -> None:
    out = console()
    out.print(f"({legend([result])})", markup=False)
    for kind in KINDS:
        for line in kind.lines([result]):
            out.print(f"{kind.tag}: {line}", markup=False)
    out.print(f"verdict: {verdict([result])}")
