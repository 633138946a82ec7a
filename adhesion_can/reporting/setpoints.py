"""The setpoints of a replay as a table: `--table` in CSV, Parquet or MF4."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from math import isfinite, nan
from pathlib import Path

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.reporting.export import Field, FieldColumn, TableWriter, open_table
from adhesion_can.service.output_messages import AXLE_FRAMES
from adhesion_can.service.outputs import Outputs, Setpoint

ROWS = 10_000
"""Number of rows written at once."""


def _number(name: str, comment: str, unit: str = "") -> Field:
    return Field(name, unit=unit, comment=comment, optional=True, spec=".9g")


def _names(name: str, comment: str, names: Mapping[float, str], *, optional: bool = False) -> Field:
    return Field(
        name, np.dtype(np.uint8), comment=comment, names=names, text=True, optional=optional
    )


def _by_number(kinds: Iterable[Status | Doubt | Objection]) -> Mapping[float, str]:
    return {float(kind): kind.name for kind in kinds}


_AXLES = range(1, AXLE_FRAMES + 1)
NO_FAMILY = 255
"""Number that means no family of curves."""
_FAMILY_NUMBERS = {name: number for number, name in enumerate(FAMILIES)}
FIELDS = (
    _names("status", "status of the service", _by_number(Status)),
    _number("mu_max", "maximum adhesion coefficient"),
    _number("mu_max_std", "standard deviation of mu_max"),
    _number("lambda_m", "slip ratio at the maximum"),
    _number("lambda_m_std", "standard deviation of lambda_m"),
    _number("c1", "level of the curve"),
    _number("c2", "steepness of the curve"),
    _number("c3", "fall of the curve"),
    _number("surface_age_s", "since the surface last changed", "s"),
    *(_number(f"mu_max_ax{axle}", f"mu_max of axle {axle}") for axle in _AXLES),
    *(_number(f"lambda_m_ax{axle}", f"lambda_m of axle {axle}") for axle in _AXLES),
    _number("speed_mps", "vehicle speed", "m/s"),
    _number("creep_speed_setpoint_mps", "creep speed to control to", "m/s"),
    _names(
        "doubt",
        "what the residual depends on, if the curve cannot explain it",
        _by_number(Doubt),
        optional=True,
    ),
    _names(
        "family",
        "most probable curve family, if families are compared",
        {
            **{float(number): name for name, number in _FAMILY_NUMBERS.items()},
            float(NO_FAMILY): Doubt.NOT_AVAILABLE.name,
        },
        optional=True,
    ),
    _names(
        "objection",
        "objection to the readings that makes the peak unreliable",
        _by_number(Objection),
    ),
)
"""Columns beside `time_s`."""


class _RowBuffer:
    """Buffer of rows, written many at once."""

    def __init__(self, writer: TableWriter) -> None:
        self._writer = writer
        self._t_us: list[int] = []
        self._values: list[list[float]] = []

    def add(self, t_us: int, outputs: Outputs) -> None:
        self._t_us.append(t_us)
        self._values.append(setpoint_row(outputs))
        if len(self._t_us) >= ROWS:
            self.flush()

    def flush(self) -> None:
        if not self._t_us:
            return
        status, *numbers, doubt, family, objection = np.array(self._values).T
        columns = [
            FieldColumn(status.astype(np.uint8)),
            *(FieldColumn(n, np.isnan(n)) for n in numbers),
            # A reader that knows of no missing texts finds NOT_AVAILABLE.
            _names_column(doubt, Doubt.NOT_AVAILABLE),
            _names_column(family, NO_FAMILY),
            FieldColumn(objection.astype(np.uint8)),
        ]
        self._writer.write(np.array(self._t_us, dtype=np.int64) * 1000, columns)
        self._t_us, self._values = [], []


def setpoint_row(outputs: Outputs) -> list[float]:
    """Numbers of a row; NaN where not available."""
    theta = outputs.theta or (None, None, None)
    axles = [outputs.axles.get(axle, Setpoint()) for axle in _AXLES]
    numbers = (
        outputs.setpoint.mu_max,
        outputs.mu_max_std,
        outputs.setpoint.lambda_m,
        outputs.lambda_m_std,
        *theta,
        outputs.surface_age_s,
        *(point.mu_max for point in axles),
        *(point.lambda_m for point in axles),
        outputs.speed,
        outputs.setpoint.creep_speed,
    )
    known = (nan if number is None or not isfinite(number) else number for number in numbers)
    doubt = outputs.doubt
    shown = nan if doubt is Doubt.NOT_AVAILABLE else float(doubt)
    family = nan if outputs.family is None else float(_FAMILY_NUMBERS[outputs.family])
    return [float(outputs.status), *known, shown, family, float(outputs.objection)]


def _names_column(numbers: Array, missing: int) -> FieldColumn:
    """Column of numbers that stand for names, NaN where not available."""
    return FieldColumn(np.nan_to_num(numbers, nan=missing).astype(np.uint8), np.isnan(numbers))


@contextmanager
def setpoint_table(
    path: Path, origin: Mapping[str, str]
) -> Iterator[Callable[[int, Outputs], None]]:
    """A file with a row a setpoint; gives the function that adds one by stamp (µs) and outputs.

    Args:
        path: Path of the file; its suffix selects the format.
        origin: Version, inputs and hashes, written where the format has a place for them.

    Raises:
        InputError: The format is unknown, an extra is missing, or the disk is full.

    """
    with open_table(path, FIELDS, origin, name="AdhesionSetpoint") as writer:
        rows = _RowBuffer(writer)
        yield rows.add
        rows.flush()
