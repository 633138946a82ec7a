"""The rows of a TABLE to a course."""

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.drive_data import Course
from adhesion_can.diagnosis.drive.kinematics import TableSource
from adhesion_can.physics.samples import Samples

PAUSE_S = 1.0
"""Rows of a TABLE further apart than this do not follow each other."""
BETWEEN_S, SAME_S = 10.0, 1e-6
"""Time put between rows that do not follow each other, and between those of one stamp."""
MOST_AXLES = 100


def course_of_table(
    name: str, samples: Samples, segment: NDArray[np.int64] | None, slip_max: float
) -> Course:
    """Course of a TABLE: slip and adhesion are taken as they stand there.

    Args:
        name: of the table.
        samples: its rows.
        segment: number of each row's segment, where the table has one.
        slip_max: no use of larger slips.

    """
    good = np.abs(samples.slip) <= slip_max
    good &= (samples.speed > 0) & (samples.load > 0)
    lost = {"slip, speed or load out of range": int((~good).sum())}
    rows = samples.select(good)
    parts = np.zeros(len(rows), dtype=np.int64) if segment is None else segment[good]
    number = _numbers(rows.axle)
    first_us = int(rows.t_us.min()) if len(rows) else 0
    t_s = _unrolled((rows.t_us - first_us) / 1e6, parts, number)
    order = np.lexsort((t_s, number))
    rows, t_s, number = rows.select(order), t_s[order], number[order]
    columns = np.stack([(1.0 + rows.slip) * rows.speed, rows.speed, rows.load])
    return Course(
        name=name,
        t_s=t_s,
        axle=number,
        place=number.astype(np.float64),
        effort=rows.adhesion * rows.load,
        covariates={n: c for n, c in rows.covariates.items() if np.isfinite(c).all()},
        radius=np.ones(int(number.max(initial=1))),
        inertia=0.0,
        position=_way(t_s, rows.speed, number),
        source=TableSource(number, t_s, columns),
        lost=lost,
        table=True,
        first_us=first_us,
        clock_s=(rows.t_us - first_us) / 1e6,
        has_speed=bool(np.any(rows.speed != 1.0)),
        has_load=bool(np.any(rows.load != 1.0)),
    )


def _numbers(axle: NDArray[np.int64]) -> NDArray[np.int64]:
    """Axles as the table numbers them, where these are numbers of axles; else counted through."""
    if len(axle) and (axle.min() < 1 or axle.max() > MOST_AXLES):
        return np.unique(axle, return_inverse=True)[1] + 1
    return axle


def _unrolled(t_s: Array, segment: NDArray[np.int64], axle: NDArray[np.int64]) -> Array:
    """Times that only run forwards: rows that do not follow each other are set well apart."""
    unrolled = np.empty(len(t_s))
    for number in np.unique(axle):
        rows = np.flatnonzero(axle == number)
        step = np.diff(t_s[rows], prepend=t_s[rows[:1]])
        new = np.diff(segment[rows], prepend=segment[rows[:1]]) != 0
        cut = new | (step < 0) | (step > PAUSE_S)
        # Rows of one stamp follow each other all the same.
        unrolled[rows] = np.cumsum(np.where(cut, BETWEEN_S, np.maximum(step, SAME_S)))
    return unrolled


def _way(t_s: Array, speed: Array, axle: NDArray[np.int64]) -> Array:
    step = np.diff(t_s, prepend=t_s[:1])
    follows = (step >= 0) & (step <= PAUSE_S) & (np.diff(axle, prepend=axle[:1]) == 0)
    return np.cumsum(np.where(follows, step * speed, 0.0))
