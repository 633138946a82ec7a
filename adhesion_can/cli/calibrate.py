"""`calibrate`: wheel radii and the zero error of the vehicle speed, from coasting."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path

import numpy as np

from adhesion_can.api.calibration import (
    build_coasting_drive,
    needed_roles,
    require_calibration_roles,
    require_calibration_signals,
)
from adhesion_can.calibration.agreement import agreement_dict
from adhesion_can.calibration.coasting import CalibrationSettings
from adhesion_can.calibration.fit import Calibration, calibrate
from adhesion_can.cli.common import (
    add_configuration,
    add_json,
    configuration,
    require_outputs,
    require_positive,
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
from adhesion_can.config.calibrated_file import Correction, with_correction
from adhesion_can.config.calibrated_radii import rim_axles
from adhesion_can.errors import InputError
from adhesion_can.files import file_sha256, whole_file
from adhesion_can.offline.load_traces import LoadedTraces, load_traces
from adhesion_can.physics.readings import Role
from adhesion_can.plurals import counted
from adhesion_can.recordings.problems import describe_problems
from adhesion_can.recordings.reference_speed import read_reference, reference_path
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.reporting.calibration import (
    agreement_line,
    calibration_notes,
    radius_table,
    speed_lines,
)
from adhesion_can.reporting.calibration_page import CoastingPlots, page
from adhesion_can.reporting.next_steps.after_calibration import after_calibration
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import console
from adhesion_can.sampling.traces import Trace
from adhesion_can.version import __version__


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    defaults = CalibrationSettings()
    parser.description = (
        "Finds the radius of each wheel relative to the vehicle speed, and the offset of the "
        "vehicle speed, from coasting axles, with standard errors."
    )
    parser.add_argument("log", nargs="+", type=Path, metavar="LOG")
    parser.add_argument(
        "--out", type=Path, metavar="CONFIG.toml", help="write the configuration with the result"
    )
    parser.add_argument(
        "--speed",
        metavar="CSV[:COLUMN]",
        help="vehicle speed of another recorder: m/s or the unit in its heading, time_s on the "
        "recording's clock",
    )
    parser.add_argument(
        "--adhesion-max",
        type=float,
        default=defaults.adhesion_max,
        metavar="MU",
        help=f"adhesion below which an axle counts as coasting (default {defaults.adhesion_max:g})",
    )
    parser.add_argument(
        "--acceleration-max",
        type=float,
        default=defaults.acceleration_max,
        metavar="A",
        help=f"skip larger accelerations, m/s² (default {defaults.acceleration_max:g})",
    )
    parser.add_argument(
        "--settle",
        type=float,
        default=defaults.settle_s,
        metavar="S",
        help=f"time after the start of coasting that is skipped (default {defaults.settle_s:g})",
    )
    parser.add_argument(
        "--block",
        type=float,
        default=defaults.block_s,
        metavar="S",
        help=(
            "length of a block of data; errors of the vehicle speed must be independent after "
            f"about a fifth of it (default {defaults.block_s:g})"
        ),
    )
    parser.add_argument(
        "--delay",
        type=float,
        metavar="S",
        help=("known delay of the vehicle speed (default: estimated)"),
    )
    add_report(parser)
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    settings = _settings(options)
    config = configuration(options)
    inputs = [*options.log, *([reference_path(options.speed)[0]] if options.speed else [])]
    require_outputs(
        options,
        {"--out": options.out, "--json": options.json, **report_files(options)},
        [*inputs, config.database.path],
        renewed="--out",
    )
    require_report(options)
    reference = (
        None if options.speed is None else Trace.from_readings(*read_reference(options.speed))
    )
    require_calibration_roles(config, reference)
    recordings = open_recordings(options.log)
    loaded = []
    with reading("reading", recordings) as watched:
        for recording in recordings:
            blocks = watched(blocks_in_sequence([recording], config.service.restart_s))
            loaded.append(
                load_traces(
                    blocks, config, str(recording.path), needed_roles(reference), partly=True
                )
            )
    drives = [build_coasting_drive(one, config, reference) for one in loaded]
    where = ", ".join(map(str, options.log))
    require_calibration_signals(drives, where, options.speed)
    result = calibrate(drives, config.vehicle, settings)
    if all(axle.estimate is None for axle in result.axles):
        raise InputError(where, *_no_coasting(result, settings))
    rim = rim_axles(config)
    named = "the vehicle speed" if options.speed is None else f"--speed {options.speed}"
    notes = calibration_notes(result, settings, rim, named)
    notes += _notes_on_source(result, loaded, reference)
    problems = describe_problems(recordings)
    origin = provenance(config, inputs)
    agreement = agreement_line(result)
    step = after_calibration(result, typed_words(options, options.log), rim)
    document = {**result.to_dict(rim), **agreement_dict(result), "agreement": agreement}
    written = None if options.out is None else str(options.out)
    document |= {"written": written, "notes": notes, "problems": problems}
    write_json(options.json, {**document, "next": step.line, **origin})
    lines = [_write_configuration(options, config, _correction(result, config, options, inputs))]
    if is_asked_for(options):
        said = page_provenance(origin, options)
        names = [recording.path.name for recording in recordings]
        made = CoastingPlots.build(drives, names, config.vehicle, settings, result)
        about = [agreement, *speed_lines(result, settings), *notes, *problems]
        report = page(result, made, rim, about, said)
        lines += write_report(replace(report, next_step=step.line), options)
    if talk(options):
        out = console()
        out.print(radius_table(result, rim))
        for line in [agreement, *speed_lines(result, settings), *notes, *problems, *lines]:
            out.print(line, markup=False)
        print_next(step)
    return 0


def _settings(options: argparse.Namespace) -> CalibrationSettings:
    for name in ("adhesion_max", "acceleration_max"):
        require_positive(getattr(options, name), f"--{name.replace('_', '-')}")
    if not (isfinite(options.settle) and options.settle >= 0):
        raise InputError(
            "--settle", f"{options.settle} is not a waiting time", "give seconds, 0 or more"
        )
    if not (isfinite(options.block) and options.block >= 1):
        raise InputError(
            "--block",
            f"{options.block} s is too short for errors to be independent",
            "give 1 s or more",
        )
    if options.delay is not None and not isfinite(options.delay):
        raise InputError("--delay", f"{options.delay} is not finite", "give seconds")
    return CalibrationSettings(
        adhesion_max=options.adhesion_max,
        acceleration_max=options.acceleration_max,
        settle_s=options.settle,
        block_s=options.block,
        delay_s=options.delay,
    )


def _no_coasting(result: Calibration, settings: CalibrationSettings) -> tuple[str, str]:
    """What is wrong and what to do about it, where no axle has enough coasting.

    The advice is that for the first condition that leaves too little time.
    """
    kind = "coasts" if result.effort_known else "runs at a steady speed"
    times = result.times
    longest = int(np.argmax(times.settled if times.settled.any() else times.idle))
    simulated = "of the simulated scenarios, 'sweep' coasts from 90 s on"
    # Condition, time that it leaves of what the ones before it left, and what to do about it.
    conditions = (
        ("with both a wheel speed and the vehicle speed", times.read, "check the roles' signals"),
        (f"above {settings.speed_min:g} m/s", times.fast, "record a faster drive"),
        (
            f"with an acceleration below {settings.acceleration_max:g} m/s²",
            times.steady,
            "record a steadier drive, or raise --acceleration-max",
        ),
        (
            f"with an adhesion below {settings.adhesion_max:g}",
            times.idle,
            f"record a drive in which an axle coasts, or raise --adhesion-max; {simulated}",
        ),
        (
            f"after {settings.settle_s:g} s of that",
            times.settled,
            "record longer coasting, or lower --settle",
        ),
    )
    least = settings.coasting_min_s
    parts = []
    if times.recorded < least:
        advice = f"record a longer drive in which an axle coasts; {simulated}"
    else:
        advice = (
            f"record a longer drive: the coasting fills fewer than {settings.blocks_min} blocks"
        )
        for text, seconds, own_advice in conditions:
            parts.append(f"{seconds[longest]:.1f} s {text}")
            if seconds[longest] < least:
                advice = own_advice
                break
    left = f"of {times.recorded:.1f} s, {', of those '.join(parts)}".rstrip()
    what = (
        f"no axle {kind} for {least:g} s in {settings.blocks_min} blocks of "
        f"{settings.block_s:g} s ({left})"
    )
    return what, advice


def _notes_on_source(
    result: Calibration, loaded: list[LoadedTraces], reference: Trace | None
) -> list[str]:
    """Notes on the source of the vehicle speed."""
    if reference is not None:
        if result.offset is None:
            return []
        return ["The offset belongs to --speed, so no role receives it."]
    notes = []
    if derived := sum(one.derived for one in loaded):
        notes.append(f"Dropped {derived} vehicle speeds that are derived from the driven axles.")
    if any(one.trailing for one in loaded):
        notes.append(
            "The vehicle speed comes from a trailing axle; all radii contain the error of its "
            "radius."
        )
    return notes


def _write_configuration(
    options: argparse.Namespace, config: Configuration, correction: Correction
) -> str:
    """Write the file of --out; says whether and where that was done, and what in it is new."""
    if options.out is None:
        return "No configuration was written: --out CONFIG.toml writes one with these values."
    text = with_correction(config, options.config, options.out, correction)
    with whole_file(options.out) as file:
        file.write(text)
    what = "factors" if set(correction.radius_ratio) <= set(rim_axles(config)) else "radii"
    changed = [f"{what} of {counted(len(correction.radius_ratio), 'axle')}"]
    if correction.offset is not None:
        changed.append("offset of the vehicle speed")
    return f"written: {options.out}, the configuration with the {' and the '.join(changed)}"


def _correction(
    result: Calibration,
    config: Configuration,
    options: argparse.Namespace,
    sources: Sequence[Path],
) -> Correction:
    """Values and remarks for the configuration file."""
    origin = f"by adhesion-can {__version__} from " + ", ".join(
        f"{path.name} (sha256 {file_sha256(path)[:12]})" for path in sources
    )
    rim = rim_axles(config)
    estimated = {a.axle: a for a in result.axles if a.estimate is not None}
    radii = ", ".join(
        f"axle {i} ± {a.estimate.std:.2g}"
        for i, a in estimated.items()
        if a.estimate and i not in rim
    )
    factor = {c.axle: c.used_factor for c in config.choices if c.role is Role.WHEEL_SPEED}
    offset = result.offset if options.speed is None else None
    errors = [a.estimate.std / a.configured for a in estimated.values() if a.estimate]
    return Correction(
        radius_ratio={i: a.ratio for i, a in estimated.items()},
        offset=offset.value if offset else None,
        # Against another speed than the bus has, the slips' scale is not calibrated.
        speed_error_std=max(errors) if errors and options.speed is None else None,
        radii_remark=f"standard errors in m: {radii}; {origin}",
        factor_remark={
            i: f"factor ± {factor[i] * a.estimate.std / a.configured:.2g}; {origin}"
            for i, a in estimated.items()
            if a.estimate
        },
        offset_remark=f"offset ± {offset.std:.2g} m/s; {origin}" if offset else "",
        speed_error_remark=f"standard error of the radii; {origin}",
    )
