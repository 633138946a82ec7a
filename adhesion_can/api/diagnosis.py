"""Diagnosis of recordings or tables: what the simulation gets wrong, and the extended model."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from adhesion_can.api.configuration import ConfigurationLike, as_configuration
from adhesion_can.api.drive_signals import thin_signals
from adhesion_can.api.formulas import read_formulas, require_formula_applies
from adhesion_can.api.inputs import RecordingLike, as_paths, describe_table, require_plausible
from adhesion_can.config.configuration import Configuration
from adhesion_can.diagnosis.cause_result import Witness
from adhesion_can.diagnosis.diagnose import DiagnosisSettings, ShowProgress
from adhesion_can.diagnosis.diagnose import diagnose as _diagnose
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.from_table import build_drive_data_from_table
from adhesion_can.diagnosis.drive.from_traces import build_drive_data_from_traces
from adhesion_can.diagnosis.result import Diagnosis, InputFile
from adhesion_can.errors import InputError
from adhesion_can.input_files import file_sha256
from adhesion_can.offline.load_traces import LoadedTraces, load_traces
from adhesion_can.offline.plausibility import inspect_points, inspect_samples
from adhesion_can.offline.points import MeasuredPoints
from adhesion_can.offline.rim_speed import inspect_rim_speeds, slips_of_traces
from adhesion_can.offline.witness import compute_doubt_shares
from adhesion_can.physics.driving_plan import PlanLimits
from adhesion_can.physics.effects.formula import AnyFormula
from adhesion_can.recordings.problems import describe_problems, distinct_names
from adhesion_can.recordings.sequence import blocks_in_sequence, open_recordings
from adhesion_can.recordings.tables.choice import ColumnChoice
from adhesion_can.recordings.tables.sample_table import is_table, read_table
from adhesion_can.reporting.next_steps.after_diagnosis import after_diagnosis
from adhesion_can.reporting.next_steps.next_step import Typed
from adhesion_can.sampling.drive_signals import DriveSignals
from adhesion_can.simulation.plan_limits import limits_of


@dataclass(frozen=True, slots=True)
class LoadedInput:
    """An input file with its drive data.

    Attributes:
        input_file: File with its name and hash.
        drive: Drive data of the file.
        problems: Sentence for each kind of content that was left out.
        signals: Readings and slips over time, thinned; None of a table, and where they were not
            asked for.

    """

    input_file: InputFile
    drive: DriveData
    problems: list[str]
    signals: DriveSignals | None = None


def diagnose(
    inputs: RecordingLike | Iterable[RecordingLike],
    holdout: RecordingLike | Iterable[RecordingLike] = (),
    *,
    configuration: ConfigurationLike = None,
    formulas: Iterable[str] = (),
    next_drive: bool = False,
    witness: bool = False,
    show: ShowProgress | None = None,
) -> Diagnosis:
    """What the simulation gets wrong, why, the extended model, and its gain on held-out data.

    Args:
        inputs: Recordings or tables of samples, or their paths.
        holdout: Data for the gain alone; without any, blocks of the inputs are held out.
        configuration: Vehicle, database, roles and settings.
        formulas: Formulas that are tested as effects are, such as
            '1 + a * max(wind - b, 0) where a=0.1, b=5': the factor of the adhesion, or
            of a reading over its true value, with 'speed:' or 'effort:' in front.
        next_drive: Whether the drive is computed that would distinguish the remaining explanations,
            within `[limits]` of the configuration, the vehicle's loads and the ranges of its
            signals.
        witness: Whether named causes must also remove the service's doubt on the longest recording;
            a fifth of the time more.
        show: Callback with the work in progress and the share that is done.

    Returns:
        Diagnosis; `replay` and `simulate` take its `model` as `model`.

    Raises:
        InputError: A file is missing or given twice, not one row is usable, or a formula cannot be
            read or does not apply.
        ConfigError: The roles do not suffice to form adhesion.

    """
    config = as_configuration(configuration)
    files = list_input_files(as_paths(inputs), as_paths(holdout), config.columns)
    progress = show or (lambda _work, _share: None)
    texts = tuple(formulas)
    asked = read_formulas(texts)
    loaded = load_inputs(files, config, progress)
    sourced = limits_of(config.vehicle, config.limits, config.messages) if next_drive else None
    limits = sourced.limits if sourced else None
    diagnosis = diagnose_inputs(
        loaded, progress, asked, limits=limits, witness=config if witness else None
    )
    named = [] if isinstance(configuration, Configuration | None) else [str(configuration)]
    typed = Typed(
        inputs=tuple(file.path for file in files if not file.held_out),
        tables=any(read.drive.table for read in loaded),
        configuration=tuple(word for path in named for word in ("--config", path)),
        formulas=texts,
        holdout=tuple(file.path for file in files if file.held_out),
    )
    return replace(diagnosis, next_step=after_diagnosis(diagnosis, typed, config).line)


def list_input_files(
    inputs: Iterable[Path],
    holdout: Iterable[Path] = (),
    columns: Sequence[ColumnChoice] = (),
) -> list[InputFile]:
    """Input files without duplicates: recordings or tables, not both.

    Args:
        inputs: Paths of the data that decide.
        holdout: Paths of the data for the gain alone.
        columns: Columns that stand for known ones.

    Raises:
        InputError: A file is missing or given twice, or recordings and tables are mixed.

    """
    given = [(path, False) for path in inputs]
    given += [(path, True) for path in holdout]
    for path, _ in given:
        if not path.is_file():
            reason = "is a folder" if path.is_dir() else "No such file or directory"
            raise InputError(str(path), reason, "check the path")
    tables = [path for path, _ in given if is_table(path, columns)]
    if tables and len(tables) < len(given):
        raise InputError("diagnose", "recordings and tables together", "give one kind at a time")
    names = distinct_names([path for path, _ in given])
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
            f"has the same content as the input {before.path}",
            "hold out another drive, or remove --holdout",
        )
    return InputError(
        str(input_file.path), f"has the same content as {before.path}", "give it once"
    )


def load_inputs(
    input_files: Sequence[InputFile],
    config: Configuration,
    show: ShowProgress,
    spans: int = 0,
) -> list[LoadedInput]:
    """Drive data of all input files.

    Args:
        input_files: Recordings or tables, at least one.
        config: Vehicle, roles and settings.
        show: Callback with the work in progress and the share that is done.
        spans: Number of spans to which the signals of each recording are thinned; 0: they are not
            kept.

    Raises:
        ConfigError: The roles do not suffice to form adhesion.
        RecordingError: A recording cannot be read, or holds no known frame.
        TableError: A table cannot be read, or lacks a column.

    """
    tables = is_table(input_files[0].path, config.columns)
    if not tables:
        config.require_identification()
    loaded = []
    for number, input_file in enumerate(input_files):
        show(f"reading {input_file.name}", number / len(input_files))
        if tables:
            loaded.append(_load_table(input_file, config))
        else:
            loaded.append(_load_recording(input_file, config, spans))
    return loaded


def _load_recording(input_file: InputFile, config: Configuration, spans: int) -> LoadedInput:
    recordings = open_recordings([input_file.path])
    received = load_traces(
        blocks_in_sequence(recordings, config.service.restart_s), config, str(input_file.path)
    )
    problems = describe_problems(recordings, names=[input_file.name])
    loaded = load_from_traces(input_file, received, problems, config)
    return replace(loaded, signals=thin_signals(received, loaded.drive, spans)) if spans else loaded


def load_from_traces(
    input_file: InputFile, received: LoadedTraces, problems: list[str], config: Configuration
) -> LoadedInput:
    """Drive data of a recording whose traces are loaded.

    Args:
        input_file: File of the recording.
        received: Traces of all its signals.
        problems: Sentences about what was passed over while it was read.
        config: Vehicle, roles and settings.

    Raises:
        InputError: With the data as they are no honest answer is possible.

    """
    traces, v_min = received.traces(), config.sampling.v_min
    slips = slips_of_traces(traces, config.vehicle, v_min)
    odd = require_plausible(
        str(input_file.path), inspect_rim_speeds(slips), assumed=config.assume_plausible
    )
    drive = build_drive_data_from_traces(
        input_file.name,
        traces,
        config.vehicle,
        v_min,
        config.estimators.identifiability.slip_max,
        config.channels,
    )
    problems = problems + odd
    for points in _points_of_axles(drive):
        problems += require_plausible(
            str(input_file.path), inspect_points(points), assumed=config.assume_plausible
        )
    return LoadedInput(
        input_file, drive, [*problems, *_describe_unused_frames(input_file, received)]
    )


def _points_of_axles(drive: DriveData) -> Iterator[MeasuredPoints]:
    """Rows of every axle of a recording, to be looked at before anything is fitted."""
    observed = drive.observe()
    for axle in np.unique(drive.axle):
        axle_rows = drive.axle == axle
        yield MeasuredPoints(
            observed.slip[axle_rows],
            observed.adhesion[axle_rows],
            speed=observed.speed[axle_rows],
            load=observed.load[axle_rows],
            table=False,
            name=f"axle {axle}",
        )


def _describe_unused_frames(input_file: InputFile, received: LoadedTraces) -> list[str]:
    problems = []
    if received.rejected:
        problems.append(f"{input_file.name}: frames that failed their checks: {received.rejected}")
    problems += [f"{input_file.name}: {sentence}" for sentence in received.stuck]
    if received.derived:
        problems.append(
            f"{input_file.name}: dropped {received.derived} vehicle speeds that are derived from "
            "the driven axles: they contain no slip"
        )
    if received.trailing:
        problems.append(
            f"{input_file.name}: the vehicle speed comes from a trailing axle; every slip "
            "contains the error of its radius"
        )
    return problems


def _load_table(input_file: InputFile, config: Configuration) -> LoadedInput:
    rows = read_table(input_file.path, config.columns)
    slip_max = config.estimators.identifiability.slip_max
    drive = build_drive_data_from_table(
        input_file.name, rows.samples, rows.segment, slip_max, timed=rows.timed, units=rows.units
    )
    odd = inspect_samples(rows.samples, table=True, timed=rows.timed)
    problems = require_plausible(str(input_file.path), odd, assumed=config.assume_plausible)
    return LoadedInput(
        input_file, drive, [*problems, *describe_table(input_file.name, rows, slip_max)]
    )


def diagnose_inputs(
    loaded: Sequence[LoadedInput],
    show: ShowProgress,
    formulas: tuple[AnyFormula, ...] = (),
    *,
    effect_grams: bool = False,
    limits: PlanLimits | None = None,
    witness: Configuration | None = None,
) -> Diagnosis:
    """Diagnosis of loaded inputs.

    Args:
        loaded: Inputs, those that are held out included.
        show: Callback with the work in progress and the share that is done.
        formulas: Formulas that are tested as effects are.
        effect_grams: Whether the Gram matrices of the effects are wanted.
        limits: Limits of the drive that would distinguish the remaining explanations; None: none is
            computed.
        witness: Configuration of the service whose doubt is the second witness of named causes;
            None: no witness is asked.

    Raises:
        InputError: Not one row is usable, or a formula does not apply to them.

    """
    for formula in formulas:
        for read in loaded:
            if len(read.drive):
                require_formula_applies(formula, read.drive)
    parts = [
        [read for read in loaded if read.input_file.held_out is held] for held in (False, True)
    ]
    for part in parts:
        require_rows(part)
    drives, holdout = ([read.drive for read in part] for part in parts)
    settings = DiagnosisSettings(formulas=formulas, effect_grams=effect_grams, limits=limits)
    asked = None if witness is None else partial(ask_service, loaded, witness)
    diagnosis = _diagnose(drives, holdout, settings, show=show, ask_witness=asked)
    return replace(diagnosis, input_files=tuple(loaded_input.input_file for loaded_input in loaded))


def ask_service(
    loaded: Sequence[LoadedInput], configuration: Configuration, diagnosis: Diagnosis
) -> Witness | None:
    """The service's doubt on the longest input, with the plain curve and with the extended model.

    Args:
        loaded: Inputs; held-out ones are not asked.
        configuration: Messages, roles, vehicle and settings of the service.
        diagnosis: Diagnosis with an extended model.

    Returns:
        Doubt before and after; None for tables and for recordings without a test.

    """
    used = [read for read in loaded if not read.input_file.held_out and len(read.drive)]
    segment = diagnosis.longest_segment
    if diagnosis.model is None or segment is None or not used or used[0].drive.table:
        return None
    longest = max(used, key=lambda read: float(np.ptp(read.drive.time_s)))
    name = longest.input_file.name
    segments = [segment for segment in diagnosis.surfaces if segment.recording == name]
    changes_us = [round(segment.from_s * 1e6) for segment in segments[1:]]
    start = (segments[0] if segments else segment).base.theta
    path = longest.input_file.path
    shares = compute_doubt_shares(path, configuration, diagnosis.model, start, changes_us)
    return None if shares is None else Witness(name, shares.before, shares.after)


def require_rows(loaded: Sequence[LoadedInput]) -> None:
    """Raise an InputError where there are inputs, and none of them has a usable row."""
    if loaded and not any(len(read.drive) for read in loaded):
        raise InputError(
            ", ".join(str(read.input_file.path) for read in loaded),
            f"no usable row: {explain_empty(loaded[0])}",
            "give a drive in which the vehicle moves and its axles pull or brake",
        )


def explain_empty(read: LoadedInput) -> str:
    """Reasons why a file gave no rows."""
    reasons = [f"{count} {reason}" for reason, count in read.drive.lost.items() if count]
    return "; ".join([*reasons, *read.problems]) or "no signal was received"
