"""One recording as columns on which every equation can be written down, with any instruments.

A row stands at each reading of an axle's effort, which is the noisy one: the smooth kinematics are
brought to its stamp, never the other way round, since interpolation would change the noise with
the delay that is looked for. Rows of one axle stand together, in the order of their stamps.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.kinematics import Rows, Source, TableSource
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.kinematics import adhesion_coefficient, creep_speed

DELAY_MAX = {"speed": 1.0, "effort": 0.5}
"""s; rows need kinematics so far around them."""


class Observed(NamedTuple):
    """What the equations see in each row with given instruments: shape (n,) each."""

    slip: Array
    creep_speed: Array
    speed: Array
    load: Array
    adhesion: Array


@dataclass(frozen=True, eq=False)
class Course:
    """Rows of one recording, axle after axle.

    Attributes:
        name: of the recording.
        t_s: stamps since its first row, s.
        axle: numbers, 1...
        place: of the axle, counted from the leading one.
        effort: as read, N.
        covariates: other channels by name.
        radius: configured, by axle, m.
        inertia: configured, kg·m².
        position: way travelled, m.
        source: gives kinematics with delays.
        first_us: stamp of time 0.
        clock_s: time of each row where `t_s` is not it: a TABLE's stretches are set well apart.
        lost: rows that were not formed, by reason.
        table: whether it is a TABLE, with slip and adhesion as they stand there.
        has_speed: whether the speed is known.
        has_load: whether the load is known.

    """

    name: str
    t_s: Array
    axle: NDArray[np.int64]
    place: Array
    effort: Array
    covariates: Mapping[str, Array]
    radius: Array
    inertia: float
    position: Array
    source: Source | TableSource
    first_us: int = 0
    clock_s: Array | None = None
    lost: Mapping[str, int] = field(default_factory=dict)
    table: bool = False
    has_speed: bool = True
    has_load: bool = True

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def time_s(self) -> Array:
        """Time of each row since the first one, s; shape (n,)."""
        return self.t_s if self.clock_s is None else self.clock_s

    def observe(self, instruments: Instruments = PERFECT) -> Observed:
        """Eq. 1-3 in every row."""
        k = self.source(instruments.speed_delay, instruments.effort_delay)
        factor = instruments.radius_factor(len(self.radius))
        radius = (self.radius * factor)[self.axle - 1]
        speed = k.speed / (1.0 + instruments.speed_error)
        creep = creep_speed(k.wheel_speed, speed, radius)
        inertia = self.inertia + instruments.inertia_error
        effort = self.effort - instruments.effort_bias
        adhesion = adhesion_coefficient(effort, k.load, k.wheel_accel, inertia, radius)
        # Rows stand where the vehicle moves (eq. 2 without its lower bound).
        return Observed(creep / speed, creep, speed, k.load, adhesion)

    def rows(self, kept: Rows) -> "Course":
        """The same recording with some of its rows."""
        return replace(
            self,
            t_s=self.t_s[kept],
            axle=self.axle[kept],
            place=self.place[kept],
            effort=self.effort[kept],
            covariates={name: column[kept] for name, column in self.covariates.items()},
            position=self.position[kept],
            clock_s=None if self.clock_s is None else self.clock_s[kept],
            source=self.source.rows(kept),
        )

    @property
    def wheel_slip_std(self) -> Array:
        """Standard deviation of the slip from the wheel speed, an axle's own; shape (n,)."""
        k = self.source(0.0, 0.0)
        return k.wheel_std / np.maximum(k.speed, 1e-3)

    @property
    def speed_doubt(self) -> tuple[float, float]:
        """Standard deviation of the vehicle speed, m/s, and the time over which it lasts, s."""
        return self.source.speed_doubt
