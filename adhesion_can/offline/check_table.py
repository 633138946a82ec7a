"""Check of a table of samples: what each column was taken for, and what can be estimated."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.config import Configuration
from adhesion_can.estimation.batch_fit import identify
from adhesion_can.estimation.batch_result import BatchResult
from adhesion_can.offline.excitation import describe_excitation
from adhesion_can.offline.plausibility import inspect_samples
from adhesion_can.offline.points import LEAST_ROWS
from adhesion_can.physics.samples import Samples
from adhesion_can.recordings.tables.sample_table import SampleTable

SLOW_ROWS_S = 3.0
"""Time between two rows, s, beyond which their times are more often ms or us."""


class ColumnRange(NamedTuple):
    """Range of a column.

    Attributes:
        name: Known name, or that of a covariate.
        meaning: What the column was taken for.
        lowest: Smallest value, SI unit; None where all are missing.
        highest: Largest value, SI unit; None where all are missing.
        missing: Number of rows without a value.

    """

    name: str
    meaning: str
    lowest: float | None
    highest: float | None
    missing: int


@dataclass
class TableCheck:
    """Result of the check of a table.

    Attributes:
        name: Name of the table.
        rows: Number of rows.
        columns: Ranges of the columns in use.
        failures: Reasons for which the table cannot be used as it is, a sentence each.
        warnings: What is odd about it, or not used, a sentence each.
        limits: What cannot be estimated from it, a sentence each.
        findings: What can be estimated from it, a sentence each.
        samples: Samples of the table.
        fit: Batch fit of the samples; None where none is usable.
        shows_peak: Whether a segment shows its peak.

    """

    name: str
    rows: int
    columns: tuple[ColumnRange, ...]
    failures: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    limits: list[str] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)
    samples: Samples | None = None
    fit: BatchResult | None = None
    shows_peak: bool = False

    def to_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "name": self.name,
            "usable": not self.failures,
            "shows_peak": self.shows_peak,
            "failures": self.failures,
            "warnings": self.warnings,
            "limits": self.limits,
            "findings": self.findings,
            "rows": self.rows,
            "columns": [column._asdict() for column in self.columns],
        }


def check_table(
    name: str, table: SampleTable, left_out: list[str], config: Configuration
) -> TableCheck:
    """Check a table.

    Args:
        name: Name of the table.
        table: Table as read from its file.
        left_out: Sentences about rows and columns that are not used.
        config: Limits of slip and identifiability.

    """
    samples = table.samples
    result = TableCheck(name, table.rows, tuple(_columns(table)), samples=samples)
    result.warnings.extend(left_out)
    result.findings.extend(table.notes)
    result.warnings.extend(_slow_rows(table))
    odd = inspect_samples(samples, table=True, timed=table.timed)
    for finding in odd:
        is_wrong = finding.fatal and not config.assume_plausible
        (result.failures if is_wrong else result.warnings).append(finding.sentence)
    if not result.failures:
        return replace(result, fit=_check_excitation(result, table, config))
    return result


def _slow_rows(table: SampleTable) -> Iterator[str]:
    """Rows so far apart that their times may be of another unit."""
    samples = table.samples
    if not table.timed or len(samples) < LEAST_ROWS:
        return
    axle = samples.axle == samples.axle[0]
    step_s = float(np.median(np.diff(np.sort(samples.t_us[axle])))) / 1e6
    if step_s > SLOW_ROWS_S:
        unit = "ms" if step_s < 1e3 * SLOW_ROWS_S else "us"
        yield (
            f"time_s: the rows of an axle are {step_s:.4g} s apart; if the column is in {unit}, "
            f"pass --column time_s=time_s,unit={unit}"
        )


def _columns(table: SampleTable) -> list[ColumnRange]:
    samples, ones = table.samples, np.ones(len(table.samples))
    known: Mapping[str, tuple[str, Array]] = {
        "time_s": ("time, s", samples.t_us / 1e6),
        "slip": ("slip ratio", samples.slip),
        "adhesion": ("adhesion coefficient, given or force over load", samples.adhesion),
        "normal_load_N": ("axle load, N", samples.load),
        "speed_mps": ("vehicle speed, m/s", samples.speed),
        "axle": ("number of the axle", samples.axle.astype(np.float64)),
    }
    without = {"normal_load_N": ones, "speed_mps": ones, "axle": 0.0 * ones}
    if not table.timed:
        without["time_s"] = samples.t_us / 1e6
    ranges = [
        _range(name, meaning, values)
        for name, (meaning, values) in known.items()
        if name not in without or not np.array_equal(values, without[name])
    ]
    covariates = samples.covariates.items()
    return ranges + [_range(name, "candidate cause", values) for name, values in covariates]


def _range(name: str, meaning: str, values: Array) -> ColumnRange:
    there = values[np.isfinite(values)]
    if not len(there):
        return ColumnRange(name, meaning, None, None, len(values))
    missing = len(values) - len(there)
    return ColumnRange(name, meaning, float(there.min()), float(there.max()), missing)


def _check_excitation(
    result: TableCheck, table: SampleTable, config: Configuration
) -> BatchResult | None:
    """Batch fit of a table's samples, described in the result; None where none is usable."""
    samples: Samples = table.samples
    estimators = config.estimators
    labels = table.segment if table.timed else np.zeros(len(samples), dtype=np.int64)
    fitted = identify(samples, estimators.identifiability, labels=labels, noise=estimators.noise)
    if fitted is None:
        result.failures.append("every row lies outside the slip range of the curve")
        return None
    for sign, way in ((1.0, "traction"), (-1.0, "braking")):
        if not np.any(sign * samples.slip > 0.0):
            result.limits.append(f"no {way}: instrument errors cannot be separated from the curve")
    result.shows_peak = describe_excitation(samples, fitted, result.findings, result.limits)
    return fitted
