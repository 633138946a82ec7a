"""Rows of one recording or table on which the model equations are evaluated (before step 1).

A row is at each reading of an axle's effort. The effort is the noisy signal, and interpolating
it would change its noise with the delay that is estimated; so the smooth kinematics are
interpolated to its stamps. Rows of one axle are contiguous, in the order of their stamps.
"""

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from adhesion_can.arrays import Array
from adhesion_can.diagnosis.drive.kinematics import (
    RowSelection,
    SignalKinematics,
    SpeedError,
    TableKinematics,
)
from adhesion_can.physics.channels import UserChannel
from adhesion_can.physics.instrument_laws import Need, Situation, TrueValues, remove_errors
from adhesion_can.physics.instruments import PERFECT, Instruments
from adhesion_can.physics.kinematics import adhesion_coefficient, creep_speed
from adhesion_can.physics.lag_states import PAUSE_S, LagStates, RememberedLagStates

DELAY_MAX = {"speed": 1.0, "effort": 0.5}
"""Largest delay of a sensor that is tested, s, and largest lead of any; rows need kinematics that
far around them."""


KEPT = 4
"""Number of observations that are kept."""


class ContactObservation(NamedTuple):
    """Contact quantities of every row, as given instruments measure them; shape (n,) each.

    Attributes:
        slip: Slip ratio.
        creep_speed: Creep speed r·ω − v, m/s.
        speed: Vehicle speed, m/s.
        load: Axle load, N.
        adhesion: Adhesion coefficient.
        force_gain: Factor by which the force over load as read changes with the true adhesion: in
            these units the noise of the effort does not depend on what corrects it.

    """

    slip: Array
    creep_speed: Array
    speed: Array
    load: Array
    adhesion: Array
    force_gain: Array | float = 1.0


@dataclass(frozen=True, eq=False)
class DriveData:
    """Rows of one recording or table, axle after axle.

    Attributes:
        name: Name of the recording.
        t_s: Stamps since the first row, s; shape (n,). In a sample table, rows that do not follow
            each other are set further apart.
        axle: Axle numbers from 1; shape (n,).
        place: Ordinal position of the axle, counted from the leading one; shape (n,).
        effort: Tractive effort as read, N; shape (n,).
        covariates: Further channels by name, shape (n,) each.
        radius: Configured wheel radii, m; shape (axles,).
        inertia: Configured inertia of a wheelset, kg·m².
        position: Travelled distance, m; shape (n,).
        kinematics: Kinematics of the rows for any delays of the sensors.
        first_us: Stamp of time 0 on the recording's clock, µs.
        clock_s: True time of each row of a sample table since the first row, s; shape (n,); None
            where `t_s` is the true time.
        lost: Number of unusable rows by reason.
        table: Whether the rows come from a sample table with slip and adhesion.
        has_speed: Whether the vehicle speed is known.
        has_load: Whether the axle load is known.
        independent: Whether the rows are independent points of a sample table, in an arbitrary
            order, and no time series.
        user_channels: Covariates that the user brought: any of them may be a cause.
        derived_force: Whether the force was computed from the rate of change of the vehicle speed.
        lags: Lags over all rows, the latest of which are remembered.

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
    kinematics: SignalKinematics | TableKinematics
    first_us: int = 0
    clock_s: Array | None = None
    lost: Mapping[str, int] = field(default_factory=dict)
    table: bool = False
    has_speed: bool = True
    has_load: bool = True
    independent: bool = False
    user_channels: tuple[UserChannel, ...] = ()
    derived_force: bool = False
    lags: RememberedLagStates = field(default_factory=RememberedLagStates, init=False, repr=False)
    _observed: "deque[tuple[Instruments, ContactObservation]]" = field(
        default_factory=lambda: deque(maxlen=KEPT), init=False, repr=False
    )

    def __len__(self) -> int:
        return len(self.t_s)

    @property
    def time_s(self) -> Array:
        """Time of each row since the first one, s; shape (n,)."""
        return self.t_s if self.clock_s is None else self.clock_s

    @property
    def driven_s(self) -> float:
        """Time that the rows cover, s: pauses do not count, nor do points that stand alone."""
        steps = np.diff(np.unique(self.t_s))
        return float(steps[steps <= PAUSE_S].sum())

    def observe(self, instruments: Instruments = PERFECT) -> ContactObservation:
        """Slip ratio and adhesion of every row by eq. 1-3, for instruments with given errors.

        The latest few are kept: a search tries many effects on the same instruments.
        """
        for known, observation in self._observed:
            if known == instruments:
                return observation
        observation = self._observe(instruments)
        self._observed.append((instruments, observation))
        return observation

    def _observe(self, instruments: Instruments) -> ContactObservation:
        true, gain = self._correct(instruments)
        speed, load, wheel_accel, effort = true.speed, true.load, true.wheel_accel, true.effort
        factor = instruments.radius_factor(len(self.radius))
        radius = (self.radius * factor)[self.axle - 1]
        creep = creep_speed(true.wheel_speed, speed, radius)
        inertia = self.inertia + instruments.inertia_error
        adhesion = adhesion_coefficient(effort, load, wheel_accel, inertia, radius)
        # Rows stand where the vehicle moves (eq. 2 without its lower bound).
        return ContactObservation(creep / speed, creep, speed, load, adhesion, gain)

    def correct_effort(self, instruments: Instruments) -> Array:
        """Efforts of the rows, N, for instruments with given errors; shape (n,)."""
        return self._correct(instruments).values.effort

    def _correct(self, instruments: Instruments) -> TrueValues:
        """True values of the rows' readings, for instruments with given errors."""
        delays = instruments.speed_lag, instruments.effort_lag
        k = self.kinematics(*delays)
        read = Situation(
            time_s=self.time_s,
            axle=self.axle.astype(np.float64),
            wheel_speed=k.wheel_speed,
            wheel_accel=k.wheel_accel,
            speed=k.speed / (1.0 + instruments.speed_error),
            effort=self.effort - instruments.effort_bias,
            load=k.load,
            vehicle=self.kinematics.vehicle,
            covariates=self.covariates,
            series_s=self.t_s,
        )
        if not instruments.laws:
            return TrueValues(read)
        read = replace(
            read,
            travel=self.kinematics.travel,
            efforts=self.kinematics.efforts if instruments.needs(Need.EFFORTS) else None,
            wheel_angle=(
                self.kinematics.wheel_angle(instruments.effort_lag)
                if instruments.needs(Need.WHEEL_ANGLE)
                else None
            ),
            acceleration=(
                self.kinematics.acceleration(*delays) if instruments.needs(Need.SEQUENCE) else None
            ),
        )
        return remove_errors(instruments.laws, read, LagStates(pause_s=inf))

    def select_rows(self, kept: RowSelection) -> "DriveData":
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
            kinematics=self.kinematics.select_rows(kept),
        )

    @property
    def wheel_slip_std(self) -> Array:
        """Standard deviation of the slip ratio from the wheel speed's noise; shape (n,)."""
        k = self.kinematics(0.0, 0.0)
        return k.wheel_std / np.maximum(k.speed, 1e-3)

    @property
    def speed_error(self) -> SpeedError:
        """Error of the vehicle speed that all axles share."""
        return self.kinematics.speed_error


def observed_column(drives: Iterable[DriveData], name: str) -> Array:
    """One quantity of `ContactObservation` by perfect instruments, in all rows; shape (n,)."""
    return np.concatenate([getattr(drive.observe(), name) for drive in drives])
