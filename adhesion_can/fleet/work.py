"""What a worker does with one unit, and what it passes back: a few words."""

import gc
import json
import pickle
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from hashlib import sha256
from typing import NamedTuple

from adhesion_can.config import Configuration
from adhesion_can.errors import InputError
from adhesion_can.fleet.analysis import READ, Analysis, analyse, describe_error
from adhesion_can.fleet.dataset import DONE, FAILED, DataSet, Kept
from adhesion_can.fleet.places import open_place
from adhesion_can.fleet.rows import Row
from adhesion_can.fleet.schema import RESULT_VERSION, STEPS
from adhesion_can.fleet.units import Unit
from adhesion_can.version import __version__

LARGE = 1 << 22
"""Size of a file, bytes, whose memory is freed at once, which takes 0.1 s."""
WORKER = "worker"
"""What failed where a unit ended its worker several times."""


@dataclass(frozen=True, slots=True)
class Task:
    """A unit with all that a worker needs to analyse it.

    Attributes:
        unit: Unit.
        out: Path or URL of the data set.
        steps: Steps to take.
        configuration: Pickled configuration: its files need not be where the worker is.
        settings: Hash of all that the results depend on beside the content of the file.
        kept: What the data set has of the unit; None: nothing.
        again: Whether a unit that failed is analysed again though nothing has changed.

    """

    unit: Unit
    out: str
    steps: tuple[str, ...]
    configuration: bytes
    settings: str
    kept: Kept | None = None
    again: bool = False


class Outcome(NamedTuple):
    """What became of a unit.

    Attributes:
        path: Path or URL of the unit.
        vehicle: Name of its vehicle.
        sha256: Hash of the file; None where it could not be read.
        failed_step: First step that failed; None where none did.
        error: What is wrong; None where nothing is.
        duration_s: Length of the recording, s; 0 where it is not known.
        kept: Whether the data set had it already.

    """

    path: str
    vehicle: str
    sha256: str | None
    failed_step: str | None
    error: str | None
    duration_s: float = 0.0
    kept: bool = False


def hash_settings(unit: Unit, config: Configuration, steps: Sequence[str]) -> str:
    """Hash of all that the rows of a unit depend on, beside the content of its file.

    Args:
        unit: Unit, whose names stand in its rows.
        config: Vehicle, database, roles, settings and model.
        steps: Steps to take, in any order.

    """
    model = config.model
    parts = {
        "version": [__version__, RESULT_VERSION],
        "steps": [step for step in STEPS if step in steps],
        "configuration": config.sha256,
        "database": config.database.sha256,
        "left_out": list(config.database.left_out),
        "columns": [repr(column) for column in config.columns],
        "model": None if model is None else model.sha256 or repr(model.to_dict()),
        "unit": [unit.vehicle, unit.line, unit.latitude_deg, unit.longitude_deg],
    }
    return sha256(json.dumps(parts).encode()).hexdigest()


def hash_vehicle_data(config: Configuration, *, table: bool) -> str:
    """Hash of what sizes of effects depend on beside the data, hexadecimal.

    Wheel radii are left out: each vehicle has its own, from its calibration. For a TABLE the model
    alone counts: its slips and adhesions are formed already.
    """
    model = config.model
    parts: list[str] = [repr(None if model is None else model.to_dict())]
    if not table:
        vehicle = config.vehicle
        plain = replace(vehicle, wheel_radius=(1.0,) * vehicle.axles)
        parts += [repr(plain), repr(config.sampling), repr(config.estimators.identifiability)]
    return sha256("\n".join(parts).encode()).hexdigest()


def hash_unit(content: str, settings: str) -> str:
    """Key of a unit: hash of its content and of its settings, both hexadecimal."""
    return sha256(f"{content} {settings}".encode()).hexdigest()


def is_current(task: Task) -> bool:
    """Whether the data set has the unit as it is, as far as the file's cheap signs show."""
    kept, unit = task.kept, task.unit
    if kept is None or (task.again and kept.status == FAILED):
        return False
    return kept.settings == task.settings and kept.fingerprint == unit.fingerprint != ""


def work_on(task: Task) -> Outcome:
    """Analyse a unit, and write its files.

    Raises:
        InputError: The data set cannot be written.

    """
    unit, kept = task.unit, task.kept
    place, content = open_place(unit.path), None
    analysis, is_kept = Analysis(), False
    try:
        with place.fetched() as (path, content):
            key = hash_unit(content, task.settings)
            is_kept = (
                kept is not None and kept.key == key and not (task.again and kept.status == FAILED)
            )
            if not is_kept:
                config = _configuration(task.configuration)
                analysis = analyse(path, unit.path, content, config, task.steps)
                table = analysis.fields.get("frames") is None
                analysis.fields["vehicle_data"] = hash_vehicle_data(config, table=table)
                if not place.is_local:
                    _name(analysis, str(path), unit.path)
    except (InputError, OSError) as error:
        analysis.fail(READ, describe_error(error))
    if kept is not None and is_kept:
        if kept.fingerprint != unit.fingerprint:
            with writing_errors(task):  # it is the same in spite of it, and not hashed again
                DataSet(task.out).write_fingerprint(kept, unit.fingerprint)
        return describe_kept(kept)
    fields = describe_unit(task, content) | analysis.fields
    fields["status"] = FAILED if analysis.failed else DONE
    store(task, fields, analysis)
    if unit.size is None or unit.size >= LARGE:
        gc.collect()  # what a recording leaves stands in cycles
    return Outcome(
        *(unit.path, unit.vehicle, content, fields.get("failed_step"), fields.get("error")),
        fields.get("duration_s") or 0.0,
    )


def give_up(task: Task, deaths: int) -> Outcome:
    """Write the row of a unit that ended its worker several times."""
    error = (
        f"{task.unit.path}: killed its worker {deaths} times, the last time as its only unit; "
        "give workers more memory with --memory, or run the commands of the steps on it by hand"
    )
    analysis = Analysis()
    analysis.fail(WORKER, error)
    fields = describe_unit(task, None) | analysis.fields | {"status": FAILED}
    store(task, fields, analysis)
    return Outcome(task.unit.path, task.unit.vehicle, None, WORKER, error)


def store(task: Task, fields: Row, analysis: Analysis) -> None:
    """Write the files of a unit in place of those that were there before."""
    with writing_errors(task):
        data_set = DataSet(task.out)
        if task.kept is not None:
            data_set.remove(task.kept)
        data_set.write(fields, analysis.rows)


@contextmanager
def writing_errors(task: Task) -> Iterator[None]:
    """Raise an error of the file system as one that names the data set."""
    try:
        yield
    except OSError as error:
        reason = " ".join(str(error).split())[:200]
        fix = "free some space or check the permissions; the same command continues from here"
        raise InputError(f"--out {task.out}", f"cannot be written ({reason})", fix) from error


def describe_kept(kept: Kept) -> Outcome:
    """Outcome of a unit that the data set has already."""
    return Outcome(kept.path, kept.vehicle, kept.sha256, kept.failed_step, kept.error, kept=True)


def describe_unit(task: Task, content: str | None) -> Row:
    """Columns of `units` that say what was analysed, and with what."""
    unit = task.unit
    return {
        "unit_id": unit.unit_id,
        "path": unit.path,
        "vehicle": unit.vehicle,
        "line": unit.line,
        "latitude_deg": unit.latitude_deg,
        "longitude_deg": unit.longitude_deg,
        "steps": list(task.steps),
        "bytes": unit.size,
        "sha256": content,
        "fingerprint": unit.fingerprint,
        "settings": task.settings,
        "key": None if content is None else hash_unit(content, task.settings),
        "package_version": __version__,
    }


def _name(analysis: Analysis, path: str, name: str) -> None:
    """Name the URL of a unit where an error names the file that was fetched for it."""
    for column in ("error", "first_failure"):
        if analysis.fields.get(column):
            analysis.fields[column] = analysis.fields[column].replace(path, name)


@lru_cache(maxsize=4)
def _configuration(pickled: bytes) -> Configuration:
    """Configuration of a task; of thousands of units most have the same."""
    config: Configuration = pickle.loads(pickled)  # noqa: S301  our own, from the command
    return config
