"""Rows of slip and adhesion that are looked at before anything is fitted."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array

LEAST_ROWS = 20
"""Rows, and rows with a clear sign, without which sizes and signs say nothing."""


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Rows of a table, or of one axle of a recording; shape (n,) each.

    Attributes:
        slip: Slip ratio with its sign.
        adhesion: Adhesion coefficient with its sign.
        t_us: Stamps, µs; None where the rows are independent points.
        speed: Vehicle speed, m/s; None where it is not known.
        load: Axle load, N; None where it is not known.
        table: Whether the rows are of a table, whose columns can be renamed.
        name: Name of the axle, for sentences; '' where it needs none.
        inertial: Part of the adhesion that the configured inertia of the wheelset takes, with its
            sign; None where it is not known.
        inertia: That inertia, kg·m².

    """

    slip: Array
    adhesion: Array
    t_us: NDArray[np.int64] | None = None
    speed: Array | None = None
    load: Array | None = None
    table: bool = True
    name: str = ""
    inertial: Array | None = None
    inertia: float = 0.0

    def select(self, rows: NDArray[np.bool_]) -> "MeasuredPoints":
        """Some of the rows."""
        t_us = None if self.t_us is None else self.t_us[rows]
        speed = None if self.speed is None else self.speed[rows]
        load = None if self.load is None else self.load[rows]
        inertial = None if self.inertial is None else self.inertial[rows]
        return replace(
            self,
            slip=self.slip[rows],
            adhesion=self.adhesion[rows],
            t_us=t_us,
            speed=speed,
            load=load,
            inertial=inertial,
        )
