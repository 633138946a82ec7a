"""`check`: whether a recording is usable."""

import argparse
from pathlib import Path

from adhesion_can.cli.common import (
    add_configuration,
    add_json,
    configuration,
    require_outputs,
    talk,
    write_json,
)
from adhesion_can.cli.reading import reading
from adhesion_can.offline.check import CheckResult, check, mean_cycle_ms
from adhesion_can.offline.compare_noise import ComparedNoise
from adhesion_can.offline.extract_samples import require_accepted_frame
from adhesion_can.recordings.problems import describe_problems
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import console, table


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    parser.description = (
        "Goes through recordings as the service would: signals, rates, gaps, checksum "
        "and counter faults, excitation. Exit status 1 where something is wrong."
    )
    parser.add_argument("log", nargs="+", type=Path, metavar="LOG")
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    config = configuration(options)
    require_outputs(options, {"--json": options.json}, [*options.log, config.database.path])
    recordings = open_recordings(options.log)
    with reading("checking", recordings) as watched:
        result = check(watched(blocks_in_sequence(recordings)), config)
    require_known_id(result, options)
    problems = describe_problems(recordings)
    result.failures.extend(problems)
    write_json(options.json, {**result.as_json(), **provenance(config, options.log)})
    if talk(options):
        _print(result)
    return 1 if result.failures else 0


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
