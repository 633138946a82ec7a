"""The work on one recording or TABLE: all steps, whose failures are data of the unit."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TypeVar

from adhesion_can.api.diagnosis import LoadedInput, diagnose_inputs
from adhesion_can.config import Configuration
from adhesion_can.diagnosis.result import InputFile
from adhesion_can.errors import AdhesionCanError, TableError
from adhesion_can.fleet.effect_records import effect_rows
from adhesion_can.fleet.rows import (
    Row,
    cause_rows,
    diagnosis_fields,
    segment_rows,
)
from adhesion_can.fleet.schema import STEPS, seconds_column, tables_of
from adhesion_can.fleet.unit_sources import RecordingUnit, TableUnit
from adhesion_can.recordings.tables.sample_table import is_table

Result = TypeVar("Result")
READ = "read"
"""Step before the others: the file is fetched, read and decoded."""


@dataclass(slots=True)
class Analysis:
    """What the steps found in one unit.

    Attributes:
        fields: Values of the columns of `units`.
        rows: Rows of the other tables by their names.

    """

    fields: Row = field(default_factory=dict)
    rows: dict[str, list[Row]] = field(default_factory=dict)

    def take(self, name: str, work: Callable[[], Result]) -> Result | None:
        """Result of a step, whose time is taken; None where it failed, which becomes data."""
        began = perf_counter()
        try:
            return work()
        # One recording of thousands may hold what nobody thought of; the others go on.
        except Exception as error:  # noqa: BLE001
            self.fail(name, describe_error(error))
            return None
        finally:
            self.fields[seconds_column(name)] = perf_counter() - began

    def fail(self, step: str, error: str) -> None:
        """Note a failure; of several the first one stays."""
        if self.fields.get("failed_step") is None:
            self.fields |= {"failed_step": step, "error": error}

    @property
    def failed(self) -> bool:
        """Whether a step failed."""
        return self.fields.get("failed_step") is not None


def describe_error(error: BaseException) -> str:
    """An error in one line; one that this package does not raise on purpose with its place."""
    text = " ".join(str(error).split())
    if isinstance(error, AdhesionCanError):
        return text
    place, trace = "", error.__traceback__
    while trace is not None:
        code = trace.tb_frame.f_code
        place = f" ({Path(code.co_filename).name}:{trace.tb_lineno})"
        trace = trace.tb_next
    return f"{type(error).__name__}: {text or 'no reason given'}{place}"


def analyse(
    path: Path, name: str, sha256: str, config: Configuration, steps: Collection[str]
) -> Analysis:
    """Analyse a recording or TABLE.

    Args:
        path: Path of the file.
        name: Name of the unit, for sentences.
        sha256: Hash of the file, hexadecimal.
        config: Vehicle, database, roles, settings and, where one is used, the model.
        steps: Steps to take, of `schema.STEPS`.

    """
    analysis = Analysis(rows={table.name: [] for table in tables_of(steps)})
    unit = analysis.take(READ, lambda: _open(InputFile(path, name, sha256), config))
    if unit is None:
        return analysis
    analysis.fields |= unit.describe()
    work: tuple[Callable[[], Row], ...] = (
        unit.check,
        unit.calibrate,
        unit.replay,
        lambda: _identify(analysis, unit),
        lambda: _diagnose(analysis, unit.load_drive()),
    )
    for step, run in zip(STEPS, work, strict=True):
        if step in steps:
            analysis.fields |= analysis.take(step, run) or {}
    return analysis


def _open(file: InputFile, config: Configuration) -> "RecordingUnit | TableUnit":
    return (TableUnit if is_table(file.path, config.columns) else RecordingUnit)(file, config)


def _identify(analysis: Analysis, unit: "RecordingUnit | TableUnit") -> Row:
    result = unit.identify()
    if result is None:
        what = "no usable sample (a moving vehicle, slip within the curve's range)"
        raise TableError(unit.file.name, what, "see the columns of 'check'")
    analysis.rows["segments"] = segment_rows(result, unit.position)
    return {}


def _diagnose(analysis: Analysis, loaded: LoadedInput) -> Row:
    diagnosis = diagnose_inputs([loaded], lambda _work, _share: None, effect_grams=True)
    analysis.rows["causes"] = cause_rows(diagnosis)
    if diagnosis.effect_grams is not None:
        analysis.rows["effects"] = effect_rows(diagnosis.effect_grams)
    return diagnosis_fields(diagnosis)
