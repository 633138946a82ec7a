"""`check`: whether a recording or a table is usable."""

import argparse
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
from adhesion_can.cli.reading import reading
from adhesion_can.config import Configuration
from adhesion_can.offline.check import CheckResult, check, mean_cycle_ms
from adhesion_can.offline.check_table import TableCheck, check_table
from adhesion_can.offline.compare_noise import ComparedNoise
from adhesion_can.offline.extract_samples import require_accepted_frame
from adhesion_can.offline.stamps import in_seconds
from adhesion_can.recordings.problems import describe_problems, distinct_names
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.recordings.tables.sample_table import read_table
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import console, table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Goes through recordings as the service would: signals, rates, gaps, checksum "
        "and counter faults, excitation; of a table it says what each column was taken for. Exit "
        "status 1 where slip or adhesion do not come out plausible, or something else is wrong."
    )
    parser.add_argument("log", nargs="+", type=Path, metavar="LOG|TABLE")
    add_columns(parser)
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    require_outputs(options, {"--json": options.json}, [*options.log, config.database.path])
    if are_tables(options.log, config):
        return _check_tables(options, config)
    recordings = open_recordings(options.log)
    where = ", ".join(map(str, options.log))
    with reading("checking", recordings) as watched:
        blocks = watched(blocks_in_sequence(recordings))
        result = check(in_seconds(blocks, config.messages, where), config)
    require_known_id(result, options)
    problems = describe_problems(recordings)
    result.failures.extend(problems)
    write_json(options.json, {**result.as_json(), **provenance(config, options.log)})
    if talk(options):
        _print(result)
    return 1 if result.failures else 0


def _check_tables(options: argparse.Namespace, config: Configuration) -> int:
    slip_max = config.estimators.identifiability.slip_max
    results = []
    for name, path in zip(distinct_names(options.log), options.log, strict=True):
        rows = read_table(path, config.columns)
        results.append(check_table(name, rows, describe_left_out(rows, slip_max), config))
    document = {"tables": [result.to_dict() for result in results]}
    write_json(options.json, {**document, **provenance(config, options.log)})
    if talk(options):
        for result in results:
            _print_table(result)
    return 1 if any(result.failures for result in results) else 0


def _print_table(result: TableCheck) -> None:
    out = console()
    rows = [
        (
            column.name,
            "-" if column.lowest is None else f"{column.lowest:.6g}",
            "-" if column.highest is None else f"{column.highest:.6g}",
            str(column.missing),
            column.meaning,
        )
        for column in result.columns
    ]
    title = f"{result.name}: {result.rows} rows"
    out.print(table(title, ("column", "lowest", "highest", "empty", "taken for"), rows))
    _print_sentences(result)


def require_known_id(result: CheckResult, options: argparse.Namespace) -> None:
    """Raise a RecordingError where no frame has a known id; a faulty recording is a verdict."""
    if not any(record.frames for record in result.receiver.records):
        require_accepted_frame(result.receiver, result.frames, ", ".join(map(str, options.log)))


def _print(result: CheckResult) -> None:
    out = console()
    out.print(
        f"{result.frames} frames in {result.duration_s:.1f} s, {result.unknown} of ids that nobody "
        f"listens to; {len(result.samples)} samples"
    )
    rows = []
    for record in result.receiver.records:
        cycle, nominal = mean_cycle_ms(record), record.message.cycle_us
        rows.append(
            (
                f"{record.message.plan.name} {record.message.plan.frame_id:#x}",
                str(record.frames),
                "-" if cycle is None else f"{cycle:.2f} ms",
                "-" if nominal is None else f"{nominal / 1e3:.0f} ms",
                f"{record.longest_gap_us / 1e3:.0f} ms",
                str(sum(record.rejected.values())),
                str(record.lost),
                str(record.not_available),
            )
        )
    columns = ("message", "frames", "cycle", "nominal", "longest gap", "rejected", "lost", "n/a")
    out.print(table("Messages", columns, rows))
    ranges = [
        (
            name,
            str(seen.readings),
            "-" if seen.readings == seen.not_available else f"{seen.lowest:.6g}",
            "-" if seen.readings == seen.not_available else f"{seen.highest:.6g}",
        )
        for name, seen in result.signals.items()
        if seen.readings
    ]
    out.print(table("Signals (SI units)", ("role", "readings", "lowest", "highest"), ranges))
    if result.noise:
        noise = [_noise_row(compared) for compared in result.noise]
        heads = ("sensor", "estimated", "configured", "errors last", "unit")
        out.print(table("Noise, standard deviation", heads, noise))
    _print_sentences(result)


def _print_sentences(result: CheckResult | TableCheck) -> None:
    out = console()
    for head, lines in (
        ("WRONG", result.failures),
        ("WARNING", result.warnings),
        ("NOT KNOWABLE", result.limits),
        ("FOUND", result.findings),
    ):
        for line in lines:
            out.print(f"{head}: {line}", markup=False)
    out.print("verdict: not usable as it is" if result.failures else "verdict: usable")


def _noise_row(compared: ComparedNoise) -> tuple[str, ...]:
    """Estimated and configured noise of a sensor, as text."""
    found, lasts = compared.estimate, "not known"
    if found.std is None:
        estimated = f"not known: {found.reason}"
    elif found.reason:
        estimated = f"below {found.std_error:.3g}"
    else:
        estimated = f"{found.std:.3g}"
    if found.std is not None and found.lasts_s is not None:
        lasts = (
            f"{found.lasts_s:.2g} s" if found.lasts_s else f"not seen up to {found.seen_s:.2g} s"
        )
    return compared.name, estimated, f"{compared.configured:.3g}", lasts, compared.unit
