"""`check`: whether a recording or a table is usable."""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import RenderableType

from adhesion_can.api.inputs import describe_left_out
from adhesion_can.api.samples import are_tables
from adhesion_can.cli.common import add_columns, add_configuration, configuration
from adhesion_can.cli.next_step import typed_words
from adhesion_can.cli.outputs import add_json, require_outputs
from adhesion_can.cli.reading import reading
from adhesion_can.cli.reports import Result, add_report
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
    column_rows,
    noise_row,
    recording_page,
    signal_rows,
    table_page,
)
from adhesion_can.reporting.check_words import KINDS, NOISE_NOTE, Checked, legend, verdict
from adhesion_can.reporting.data_quality import MESSAGE_COLUMNS, message_rows
from adhesion_can.reporting.drive.signal_panels import SIGNAL_COLUMNS
from adhesion_can.reporting.next_steps.after_recording import after_check
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import FittingTable


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
    require_outputs(options, [*options.log, config.database.path])
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
    Result(
        document=result.to_dict(),
        origin=provenance(config, options.log),
        parts=_parts(result),
        step=after_check([result], typed_words(options, options.log)),
        page=lambda said: recording_page(result, config, said),
    ).deliver(options)
    return 1 if result.failures else 0


def _check_tables(options: argparse.Namespace, config: Configuration) -> int:
    slip_max = config.estimators.identifiability.slip_max
    results = []
    for name, path in zip(distinct_names(options.log), options.log, strict=True):
        rows = read_table(path, config.columns)
        results.append(check_table(name, rows, describe_left_out(rows, slip_max), config))
    Result(
        document={"tables": [result.to_dict() for result in results]},
        origin=provenance(config, options.log),
        parts=_table_parts(results),
        step=after_check(results, typed_words(options, options.log, tables=True)),
        page=lambda said: table_page(results, said),
    ).deliver(options)
    return 1 if any(result.failures for result in results) else 0


def _table_parts(results: Sequence[TableCheck]) -> Iterator[RenderableType]:
    for result in results:
        title = f"{result.name}: {result.rows} rows"
        yield FittingTable(title, COLUMN_COLUMNS, column_rows(result))
        yield from _sentences(result)


def _parts(result: CheckResult) -> Iterator[RenderableType]:
    yield (
        f"{result.frames} frames in {result.duration_s:.1f} s{result.times.note}, "
        f"{result.unknown} with other ids; {len(result.samples)} samples"
    )
    yield FittingTable("Messages", MESSAGE_COLUMNS, message_rows(result.receiver.records))
    if result.misfit is None or not result.misfit.of_other_bus:
        yield FittingTable("Signals", SIGNAL_COLUMNS, signal_rows(result))
        if result.noise:
            noise = [noise_row(compared) for compared in result.noise]
            yield FittingTable("Noise, standard deviation", NOISE_COLUMNS, noise)
            yield NOISE_NOTE
            yield ""
    yield from _sentences(result)


def _sentences(result: Checked) -> Iterator[str]:
    yield f"({legend([result])})"
    yield from (f"{kind.tag}: {line}" for kind in KINDS for line in kind.lines([result]))
    yield f"verdict: {verdict([result])}"
