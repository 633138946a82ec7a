"""`calibrate`: wheel radii and the zero error of the vehicle speed, from coasting."""

import argparse
from collections.abc import Sequence
from math import isfinite
from pathlib import Path

import numpy as np

from adhesion_can.api.calibration import (
    build_coasting_drive,
    load_coasting_traces,
    require_calibration_roles,
    require_calibration_signals,
)
from adhesion_can.calibration.agreement import agreement_dict
from adhesion_can.calibration.coasting import CalibrationSettings
from adhesion_can.calibration.fit import Calibration, calibrate
from adhesion_can.cli.common import add_configuration, configuration, require_positive
from adhesion_can.cli.next_step import typed_words
from adhesion_can.cli.outputs import add_file, add_json, require_outputs
from adhesion_can.cli.reading import reading
from adhesion_can.cli.reports import Result, add_report
from adhesion_can.config import Configuration
from adhesion_can.config.calibrated_file import Correction, with_correction
from adhesion_can.config.calibrated_radii import rim_axles
from adhesion_can.errors import InputError
from adhesion_can.files import whole_file
from adhesion_can.input_files import file_sha256
from adhesion_can.offline.load_traces import LoadedTraces
from adhesion_can.physics.readings import Role
from adhesion_can.plurals import counted
from adhesion_can.recordings.problems import describe_problems
from adhesion_can.recordings.reference_speed import read_reference, reference_path
from adhesion_can.recordings.sequence import open_recordings
from adhesion_can.reporting.calibration import (
    agreement_line,
    calibration_notes,
    radius_columns,
    radius_rows,
    speed_lines,
)
from adhesion_can.reporting.calibration_page import page, plot_drives
from adhesion_can.reporting.next_steps.after_recording import after_calibration
from adhesion_can.reporting.page import Page
from adhesion_can.reporting.provenance import provenance
from adhesion_can.reporting.text import FittingTable
from adhesion_can.sampling.traces import Trace
from adhesion_can.version import __version__

_NUMBERS = (
    ("--adhesion-max", "adhesion_max", "MU", "adhesion below which an axle counts as coasting"),
    ("--acceleration-max", "acceleration_max", "A", "skip larger accelerations, m/s²"),
    ("--settle", "settle_s", "S", "time after the start of coasting that is skipped"),
    (
        "--block",
        "block_s",
        "S",
        (
            "length of a block of data; errors of the vehicle speed must be independent after "
            "about a fifth of it"
        ),
    ),
)
"""Options of numbers: name, field of the settings, name of the value in the help, and meaning."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the description and the options of the command to its parser."""
    defaults = CalibrationSettings()
    parser.description = (
        "Finds the radius of each wheel relative to the vehicle speed, and the offset of the "
        "vehicle speed, from coasting axles, with standard errors."
    )
    parser.add_argument("log", nargs="+", type=Path, metavar="LOG")
    add_file(parser, "--out", "CONFIG.toml", "write the configuration with the result")
    parser.add_argument(
        "--speed",
        metavar="CSV[:COLUMN]",
        help="vehicle speed of another recorder: m/s or the unit in its heading, time_s on the "
        "recording's clock",
    )
    for option, field, metavar, what in _NUMBERS:
        default = getattr(defaults, field)
        about = f"{what} (default {default:g})"
        parser.add_argument(
            option, dest=field, type=float, default=default, metavar=metavar, help=about
        )
    parser.add_argument(
        "--delay",
        dest="delay_s",
        type=float,
        metavar="S",
        help="known delay of the vehicle speed (default: estimated)",
    )
    add_report(parser)
    add_json(parser)
    add_configuration(parser)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    settings = _settings(options)
    config = configuration(options)
    inputs = [*options.log, *([reference_path(options.speed)[0]] if options.speed else [])]
    require_outputs(options, [*inputs, config.database.path], renewed="--out")
    reference = (
        None if options.speed is None else Trace.from_readings(*read_reference(options.speed))
    )
    require_calibration_roles(config, reference)
    recordings = open_recordings(options.log)
    with reading("reading", recordings) as watched:
        loaded = list(load_coasting_traces(recordings, config, reference, watched))
    drives = [build_coasting_drive(traces, config, reference) for traces in loaded]
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
    agreement = agreement_line(result)
    about = [agreement, *speed_lines(result, settings), *notes, *problems]
    document = {**result.to_dict(rim), **agreement_dict(result), "agreement": agreement}
    written = None if options.out is None else str(options.out)
    document |= {"written": written, "notes": notes, "problems": problems}
    new = _write_configuration(options, config, _correction(result, config, options, inputs))

    def build_page(said: dict[str, str]) -> Page:
        names = [recording.path.name for recording in recordings]
        plots = plot_drives(drives, names, config.vehicle, settings, result)
        return page(result, plots, rim, about, said)

    title = "Wheel radii, ± standard error"
    radii = FittingTable(title, radius_columns(result), radius_rows(result, rim))
    Result(
        document=document,
        origin=provenance(config, inputs),
        parts=[radii, *about, new],
        step=after_calibration(result, typed_words(options, options.log), rim),
        page=build_page,
    ).deliver(options)
    return 0


def _settings(options: argparse.Namespace) -> CalibrationSettings:
    for name in ("adhesion_max", "acceleration_max"):
        require_positive(getattr(options, name), f"--{name.replace('_', '-')}")
    settle, block, delay = options.settle_s, options.block_s, options.delay_s
    if not (isfinite(settle) and settle >= 0):
        raise InputError("--settle", f"{settle} is not a waiting time", "give seconds, 0 or more")
    if not (isfinite(block) and block >= 1):
        what = f"{block} s is too short for errors to be independent"
        raise InputError("--block", what, "give 1 s or more")
    if delay is not None and not isfinite(delay):
        raise InputError("--delay", f"{delay} is not finite", "give seconds")
    numbers = {field: getattr(options, field) for _, field, *_ in _NUMBERS}
    return CalibrationSettings(**numbers, delay_s=delay)


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
    if derived := sum(traces.derived for traces in loaded):
        notes.append(f"Dropped {derived} vehicle speeds that are derived from the driven axles.")
    if any(traces.trailing for traces in loaded):
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
