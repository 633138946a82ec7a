"""The setpoints of a replay as a table: `--table` in CSV, Parquet or MF4."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.physics.curves import FAMILIES
from adhesion_can.physics.doubt import Doubt
from adhesion_can.physics.objection import Objection
from adhesion_can.physics.status import Status
from adhesion_can.reporting.export import open_table
from adhesion_can.reporting.export.layout import Field, FieldColumn
from adhesion_can.service.output_messages import AXLE_FRAMES
from adhesion_can.service.outputs import Outputs, Setpoint

ROWS = 10_000
"""Number of rows written at once."""


@dataclass(frozen=True)
class SetpointColumn:
    """One column of the table, beside `time_s`.

    Attributes:
        field: Name and form of the column.
        read: Function from the outputs to the column's number, None where it is not available.
        missing: Number written where it is not available, of a column of names.

    """

    field: Field
    read: Callable[[Outputs], float | None]
    missing: int = 0

    def number(self, outputs: Outputs) -> float:
        """Number of a row; NaN where it is not available."""
        number = self.read(outputs)
        return nan if number is None or not isfinite(number) else float(number)

    def written(self, numbers: Array) -> FieldColumn:
        """Column as it is written, from the numbers of rows, shape (n,)."""
        missing = np.isnan(numbers) if self.field.optional else None
        if self.field.text:
            numbers = np.nan_to_num(numbers, nan=self.missing).astype(np.uint8)
        return FieldColumn(numbers, missing)

    def values(self, numbers: Array) -> NDArray[Any]:
        """Column as Python has it: names in place of their numbers, '' where not available."""
        if not self.field.text:
            return numbers
        names = self.field.names
        return np.array([names.get(number, "") for number in numbers.tolist()], np.str_)


def _number(
    name: str, comment: str, read: Callable[[Outputs], float | None], unit: str = ""
) -> SetpointColumn:
    return SetpointColumn(Field(name, unit=unit, comment=comment, optional=True, spec=".9g"), read)


def _names(
    name: str,
    comment: str,
    names: Mapping[float, str],
    read: Callable[[Outputs], float | None],
    *,
    missing: int | None = None,
) -> SetpointColumn:
    """A column of names; `missing` is the number where one is not available, None: always one."""
    field = Field(
        name,
        np.dtype(np.uint8),
        comment=comment,
        names=names,
        text=True,
        optional=missing is not None,
    )
    return SetpointColumn(field, read, missing or 0)


def _by_number(kinds: Iterable[Status | Doubt | Objection]) -> Mapping[float, str]:
    return {float(kind): kind.name for kind in kinds}


def _parameter(place: int) -> Callable[[Outputs], float | None]:
    return lambda outputs: outputs.theta[place] if outputs.theta else None


_NOT_AVAILABLE = Setpoint()


def _of_axle(axle: int, read: Callable[[Setpoint], float | None]) -> Callable[..., float | None]:
    return lambda outputs: read(outputs.axles.get(axle, _NOT_AVAILABLE))


_AXLES = range(1, AXLE_FRAMES + 1)
NO_FAMILY = 255
"""Number that means no family of curves."""
_FAMILY_NUMBERS = {name: number for number, name in enumerate(FAMILIES)}
COLUMNS = (
    _names("status", "status of the service", _by_number(Status), lambda o: o.status),
    _number("mu_max", "maximum adhesion coefficient", lambda o: o.setpoint.mu_max),
    _number("mu_max_std", "standard deviation of mu_max", lambda o: o.mu_max_std),
    _number("lambda_m", "slip ratio at the maximum", lambda o: o.setpoint.lambda_m),
    _number("lambda_m_std", "standard deviation of lambda_m", lambda o: o.lambda_m_std),
    _number("c1", "level of the curve", _parameter(0)),
    _number("c2", "steepness of the curve", _parameter(1)),
    _number("c3", "fall of the curve", _parameter(2)),
    _number("surface_age_s", "since the surface last changed", lambda o: o.surface_age_s, "s"),
    *(
        _number(f"mu_max_ax{axle}", f"mu_max of axle {axle}", _of_axle(axle, lambda p: p.mu_max))
        for axle in _AXLES
    ),
    *(
        _number(
            f"lambda_m_ax{axle}", f"lambda_m of axle {axle}", _of_axle(axle, lambda p: p.lambda_m)
        )
        for axle in _AXLES
    ),
    _number("speed_mps", "vehicle speed", lambda o: o.speed, "m/s"),
    _number(
        "creep_speed_setpoint_mps",
        "creep speed to control to",
        lambda o: o.setpoint.creep_speed,
        "m/s",
    ),
    # A reader that knows of no missing texts finds NOT_AVAILABLE.
    _names(
        "doubt",
        "what the residual depends on, if the curve cannot explain it",
        _by_number(Doubt),
        lambda o: None if o.doubt is Doubt.NOT_AVAILABLE else o.doubt,
        missing=Doubt.NOT_AVAILABLE,
    ),
    _names(
        "family",
        "most probable curve family, if families are compared",
        {
            **{float(number): name for name, number in _FAMILY_NUMBERS.items()},
            float(NO_FAMILY): Doubt.NOT_AVAILABLE.name,
        },
        lambda o: None if o.family is None else _FAMILY_NUMBERS[o.family],
        missing=NO_FAMILY,
    ),
    _names(
        "objection",
        "objection to the readings that makes the peak unreliable",
        _by_number(Objection),
        lambda o: o.objection,
    ),
)
"""Columns beside `time_s`."""


SPEED_SOURCE = _names(
    "speed_source",
    "source of speed_mps, if it is observed by wheels and efforts",
    {0.0: "NOT_AVAILABLE", 1.0: "observed"},
    lambda o: 1.0 if o.speed_observed else None,
    missing=0,
)
"""Further column, of a service that observes the vehicle speed."""


def setpoint_columns(*, speed_observed: bool) -> tuple[SetpointColumn, ...]:
    """Columns of a service's setpoints beside `time_s`."""
    return (*COLUMNS, SPEED_SOURCE) if speed_observed else COLUMNS


def setpoint_row(outputs: Outputs, columns: Iterable[SetpointColumn] = COLUMNS) -> list[float]:
    """Numbers of a row, one of each column; NaN where not available."""
    return [column.number(outputs) for column in columns]


@contextmanager
def setpoint_table(
    path: Path, origin: Mapping[str, str], *, speed_observed: bool = False
) -> Iterator[Callable[[int, Outputs], None]]:
    """A file with a row a setpoint; gives the function that adds one by stamp (µs) and outputs.

    Args:
        path: Path of the file; its suffix selects the format.
        origin: Version, inputs and hashes, written where the format has a place for them.
        speed_observed: Whether the service observes the vehicle speed, which a column says.

    Raises:
        InputError: The format is unknown, an extra is missing, or the disk is full.

    """
    chosen = setpoint_columns(speed_observed=speed_observed)
    with open_table(
        path, [column.field for column in chosen], origin, name="AdhesionSetpoint"
    ) as write:
        waiting: list[tuple[int, list[float]]] = []

        def flush() -> None:
            if waiting:
                t_us, values = zip(*waiting, strict=True)
                numbers = zip(chosen, np.array(values).T, strict=True)
                columns = [column.written(of_rows) for column, of_rows in numbers]
                write(np.array(t_us, dtype=np.int64) * 1000, columns)
                waiting.clear()

        def add(t_us: int, outputs: Outputs) -> None:
            waiting.append((t_us, setpoint_row(outputs, chosen)))
            if len(waiting) >= ROWS:
                flush()

        yield add
        flush()
