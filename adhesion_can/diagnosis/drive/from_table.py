"""Build drive data from the rows of a sample table."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import DriveData
from adhesion_can.diagnosis.drive.kinematics import TableKinematics
from adhesion_can.physics.channels import UserChannel
from adhesion_can.physics.lag_states import PAUSE_S
from adhesion_can.physics.samples import Samples
from adhesion_can.sampling.derived_force import find_derived_force

PAUSE_CYCLES = 8.0
"""Number of cycles of a sample table after which its rows do not follow each other, as after
`PAUSE_S`. A cycle is the median step."""
SEPARATION_S, SAME_STAMP_S = 10.0, 1e-6
"""Time put between rows that do not follow each other, and between rows of one stamp, s."""
LEAST_LOAD_SHARE = 0.01
"""Share of the median load below which force over load says nothing: the wheel hardly touches."""
MOST_AXLES = 100
SERIES_ROWS = 400
"""Rows without which a sample table is too short to show what its rows have in common in time: they
are taken as independent points."""


def build_drive_data_from_table(
    name: str,
    samples: Samples,
    segment: NDArray[np.int64] | None,
    slip_max: float,
    *,
    timed: bool = True,
    units: Mapping[str, str] | None = None,
) -> DriveData:
    """Build drive data from a sample table, whose slip and adhesion are used unchanged.

    Args:
        name: Name of the table.
        samples: Rows of the table.
        segment: Segment number of each row, shape (n,); None: the table has no such column.
        slip_max: Largest slip ratio that is used.
        timed: Whether the rows have times; without any they are independent points.
        units: Units of the columns that state one; None: none does.

    """
    good = np.abs(samples.slip) <= slip_max
    good &= (samples.speed > 0) & (samples.load > 0)
    if good.any():
        good &= samples.load >= LEAST_LOAD_SHARE * float(np.median(samples.load[good]))
    lost = {"slip, speed or load out of range": int((~good).sum())}
    rows = samples.select(good)
    parts = np.zeros(len(rows), dtype=np.int64) if segment is None else segment[good]
    number = rows.axle
    if len(number) and (number.min() < 1 or number.max() > MOST_AXLES):
        # Where they are not plausible, consecutive numbers take their place.
        number = np.unique(number, return_inverse=True)[1] + 1
    first_us = int(rows.t_us.min()) if len(rows) else 0
    independent = len(samples) < SERIES_ROWS or not timed
    if independent:
        # Far apart and in random order, so that blocks are random.
        shuffled = np.random.default_rng(len(rows)).permutation(len(rows))
        t_s = SEPARATION_S * shuffled.astype(np.float64)
    else:
        t_s = _monotonic_times((rows.t_us - first_us) / 1e6, parts, number)
    order = np.lexsort((t_s, number))
    rows, t_s, number = rows.select(order), t_s[order], number[order]
    covariates = {n: c for n, c in rows.covariates.items() if np.isfinite(c).all()}
    for column in set(rows.covariates) - set(covariates):
        lost[f"channel {column}"] = int((~np.isfinite(rows.covariates[column])).sum())
    columns = np.stack([(1.0 + rows.slip) * rows.speed, rows.speed, rows.load])
    return DriveData(
        name=name,
        t_s=t_s,
        axle=number,
        place=number.astype(np.float64),
        effort=rows.adhesion * rows.load,
        covariates=covariates,
        radius=np.ones(int(number.max(initial=1))),
        inertia=0.0,
        position=_travelled_distance(t_s, rows.speed, number),
        kinematics=TableKinematics(number, t_s, columns),
        lost=lost,
        table=True,
        first_us=first_us,
        clock_s=(rows.t_us - first_us) / 1e6,
        has_speed=bool(np.any(rows.speed != 1.0)),
        has_load=bool(np.any(rows.load != 1.0)),
        independent=independent,
        user_channels=tuple(UserChannel(n, (units or {}).get(n, "")) for n in covariates),
        derived_force=not independent and _is_force_derived(samples),
    )


def _is_force_derived(samples: Samples) -> bool:
    """Whether the force of any axle was computed from the rate of change of the speed."""
    force = samples.adhesion * samples.load
    derived_forces = (
        find_derived_force(samples.t_us[axle_rows], samples.speed[axle_rows], force[axle_rows])
        for axle_rows in (samples.axle == axle for axle in np.unique(samples.axle))
    )
    return any(table is not None for table in derived_forces)


def _monotonic_times(t_s: Array, segment: NDArray[np.int64], axle: NDArray[np.int64]) -> Array:
    """Times that increase for each axle, s, the same clock for all of them.

    Where the clock of an axle goes back, or its segment changes, a new stretch starts. Stretches,
    and what a pause of all axles parts, are set well apart.
    """
    stretch, longest = np.zeros(len(t_s), dtype=np.int64), 0.0
    repeated = np.zeros(len(t_s))
    for number in np.unique(axle):
        rows = np.flatnonzero(axle == number)
        step = np.diff(t_s[rows], prepend=t_s[rows[:1]])
        new = np.diff(segment[rows], prepend=segment[rows[:1]]) != 0
        stretch[rows] = np.cumsum(new | (step < 0))
        longest = max(longest, _longest_step(step))
        # Rows of one stamp follow each other all the same.
        repeats = (step == 0.0) & ~new
        repeats[:1] = False
        place = np.arange(len(rows))
        repeated[rows] = place - np.maximum.accumulate(np.where(repeats, 0, place))
    monotonic, offset = np.empty(len(t_s)), 0.0
    for number in np.unique(stretch):
        rows = np.flatnonzero(stretch == number)
        stamps, place = np.unique(t_s[rows], return_inverse=True)
        step = np.diff(stamps, prepend=stamps[:1])
        time = offset + np.cumsum(np.where(step > longest, SEPARATION_S, step))
        monotonic[rows] = time[place]
        offset = float(time[-1]) + SEPARATION_S
    # A little late, so that the rounding of stamps at the border of two blocks decides nothing.
    return np.asarray(monotonic + SAME_STAMP_S * (1.0 + repeated))


def _longest_step(step: Array) -> float:
    """Longest step between rows that follow each other, s, from all steps (n,), s."""
    forward = step[step > 0]
    return min(PAUSE_S, PAUSE_CYCLES * float(np.median(forward))) if len(forward) else PAUSE_S


def _travelled_distance(t_s: Array, speed: Array, axle: NDArray[np.int64]) -> Array:
    """Distance travelled along each axle's rows, m; shape (n,)."""
    step = np.diff(t_s, prepend=t_s[:1])
    follows = (step >= 0) & (step <= _longest_step(step)) & (np.diff(axle, prepend=axle[:1]) == 0)
    travelled = np.cumsum(np.where(follows, step * speed, 0.0))
    new = np.diff(axle, prepend=axle[:1] - 1) != 0
    return np.asarray(travelled - travelled[new][np.cumsum(new) - 1])
