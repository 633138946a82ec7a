"""Environments: partitions of the rows between which a true cause has one and the same size.

A quantity that takes many values is cut into thirds, one with a few values is taken as it is. The
quantities are those through which a mechanism could act that is not the named one: speed, load,
creep and its rate of change, time, the total effort, the slip work of the last seconds, the heat
of the motors, every covariate; and axle, bogie and direction of the force.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import ContactObservation, DriveData
from adhesion_can.diagnosis.drive.kinematics import SignalKinematics
from adhesion_can.diagnosis.formatting import short, short_apart, unit_text
from adhesion_can.diagnosis.regression.model import RegressionData
from adhesion_can.physics.channels import channel_label, channel_unit
from adhesion_can.physics.effects import LagStates

WORK_TIME_S, HEAT_TIME_S = 2.0, 60.0
"""Memory of the slip work, and of the squared effort that heats a motor, s."""
RATE_TIME_S = 1.0
"""Time over which the rate of change of the slip is taken, s."""
FEW_VALUES = 12
"""Number of values up to which each value is an environment."""
THIRDS = (1 / 3, 2 / 3)


@dataclass(frozen=True, eq=False)
class Partition:
    """A partition of all rows into environments.

    Attributes:
        name: Name of the quantity by which the rows are divided.
        labels: Description of each environment, such as 'speed below 8.2 m/s'.
        number: Number of the environment of each row, shape (n,).

    """

    name: str
    labels: tuple[str, ...]
    number: NDArray[np.int64]


def build_partitions(data: RegressionData, slip: Array) -> list[Partition]:
    """Every partition that divides the rows of some drives.

    Args:
        data: Rows of all drives.
        slip: Slip ratio of each row at the curve, shape (n,).

    """
    parts = [
        _quantities(drive, part)
        for drive, part in zip(data.drives, data.split(slip), strict=True)
        if len(drive)
    ]
    names = [name for name in parts[0] if all(name in part for part in parts)]
    quantities = {name: np.concatenate([part[name] for part in parts]) for name in names}
    numeric = (_divide(name, values) for name, values in quantities.items())
    partitions = [partition for partition in numeric if partition is not None]
    return [*partitions, *_groups(data, slip)]


def _quantities(drive: DriveData, slip: Array) -> Mapping[str, Array]:
    """Quantities of the rows of a drive by name, shape (n,) each."""
    observed = drive.observe()
    quantities = {"creep": np.abs(slip)}
    if drive.has_speed:
        quantities["speed"] = observed.speed
    if drive.has_load:
        quantities["axle_load"] = observed.load
    if not drive.independent:
        quantities["time"] = drive.time_s
        quantities["slip_rate"] = _compute_rate(drive, slip)
        quantities |= _memories(drive, observed)
    if isinstance(drive.kinematics, SignalKinematics):
        quantities["total_effort"] = drive.kinematics.total_effort
    return quantities | {name: np.abs(values) for name, values in drive.covariates.items()}


def _compute_rate(drive: DriveData, slip: Array) -> Array:
    """Size of the mean rate of change of the slip about each row, 1/s, axle by axle."""
    rate = np.zeros(len(slip))
    for axle in np.unique(drive.axle):
        rows = np.flatnonzero(drive.axle == axle)
        t_s = drive.t_s[rows]
        first = np.searchsorted(t_s, t_s - RATE_TIME_S / 2)
        last = np.searchsorted(t_s, t_s + RATE_TIME_S / 2, side="right") - 1
        # A row that has no other one near changes by nothing.
        duration = np.where(last > first, t_s[last] - t_s[first], np.inf)
        rate[rows] = np.abs(slip[rows[last]] - slip[rows[first]]) / duration
    return rate


def _memories(drive: DriveData, observed: ContactObservation) -> Mapping[str, Array]:
    """Mean slip power of the last seconds, and rms force of the last minute, which heats motors."""
    lags, axle = LagStates(), drive.axle.astype(np.float64)
    force = observed.adhesion * observed.load
    power = np.abs(force * observed.creep_speed)
    return {
        "slip_work": lags.follow("work", axle, drive.t_s, power, 1.0 / WORK_TIME_S, 0.0),
        "motor_heat": np.sqrt(
            np.maximum(lags.follow("heat", axle, drive.t_s, force**2, 1.0 / HEAT_TIME_S, 0.0), 0.0)
        ),
    }


def _divide(name: str, values: Array) -> Partition | None:
    """Partition by a quantity; None where it has one value."""
    levels, counts = np.unique(values, return_counts=True)
    if len(levels) < 2:
        return None
    label = _LABELS.get(name) or channel_label(name)
    unit = unit_text(_UNITS.get(name, channel_unit(name)))
    if len(levels) <= FEW_VALUES:
        labels = tuple(f"{label} {short(float(level))} {unit}".strip() for level in levels)
        return Partition(name, labels, np.searchsorted(levels, values))
    if counts.max() > len(values) / 3:
        return _divide_at(name, values, float(levels[np.argmax(counts)]), label, unit)
    low, high = (float(edge) for edge in np.quantile(values, THIRDS))
    low_text, high_text = (f"{edge} {unit}".strip() for edge in short_apart(low, high))
    labels = (
        f"{label} below {low_text}",
        f"{label} {low_text} to {high_text}",
        f"{label} above {high_text}",
    )
    return Partition(name, labels, np.searchsorted([low, high], values).astype(np.int64))


def _divide_at(name: str, values: Array, usual: float, label: str, unit: str) -> Partition:
    """Partition at a value that most rows have, as a curvature of 0: below, there and above."""
    text = f"{short(usual)} {unit}".strip()
    named = (f"{label} below {text}", f"{label} {text}", f"{label} above {text}")
    there, number = np.unique(np.sign(values - usual), return_inverse=True)
    return Partition(name, tuple(named[int(sign) + 1] for sign in there), number)


_UNITS: Mapping[str, str] = {
    "total_effort": "N", "slip_work": "W", "motor_heat": "N", "creep": "1",
}  # fmt: skip
_LABELS: Mapping[str, str] = {
    "creep": "slip ratio",
    "total_effort": "total effort",
    "slip_work": f"mean slip power of {WORK_TIME_S:g} s",
    "motor_heat": f"rms effort of {HEAT_TIME_S:g} s",
}


def _groups(data: RegressionData, slip: Array) -> Iterator[Partition]:
    """Partitions by axle, bogie, direction of the force, and recording."""
    axle = data.column("axle")
    axles = np.unique(axle)
    yield from _group("axle", axle, [f"axle {number}" for number in axles])
    middle = axles[(len(axles) - 1) // 2] if len(axles) else 0
    if len(axles) > 2:
        halves = [f"axles {axles[0]} to {middle}", f"axles {middle + 1} to {axles[-1]}"]
        yield from _group("bogie", axle > middle, halves)
    yield from _group("direction", slip > 0.0, ["braking", "traction"])
    yield from _group("recording", data.drive_number, [drive.name for drive in data.drives])


def _group(name: str, values: NDArray[np.generic], labels: Sequence[str]) -> Iterator[Partition]:
    """Partition by a quantity of named values; none where there is one value."""
    levels, number = np.unique(values, return_inverse=True)
    if len(levels) == len(labels) > 1:
        yield Partition(name, tuple(labels), number)
