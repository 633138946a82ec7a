"""Laws by which a reading differs from the truth, beyond the constant errors of `Instruments`.

A law gives the error of one kind of reading in a situation: measured = true · (1 + relative) +
absolute. The simulated sensors add it, sample formation and diagnosis remove it, by the same law.
Removal evaluates the law at the readings in place of the truth, which differs by the square of the
error.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum, auto
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from adhesion_can.arrays import Array
from adhesion_can.physics.vehicle import Locomotive

if TYPE_CHECKING:  # the effects import the instruments
    from adhesion_can.physics.lag_states import LagStates

LEAST_SENSOR_GAIN = 0.05
"""Least share of a true value that a reading is taken to have: a reading of 0 has no gain."""


class Quantity(Enum):
    """Kind of reading that a law makes wrong."""

    WHEEL_SPEED = auto()
    SPEED = auto()
    EFFORT = auto()
    LOAD = auto()


class Need(Enum):
    """What a law needs to know of a situation beside the reading itself."""

    AXLE = auto()
    """The axle that a reading is of."""
    EFFORTS = auto()
    """The efforts of all axles."""
    WHEEL_ANGLE = auto()
    """The angle that the wheel has turned since the recording began."""
    SEQUENCE = auto()
    """When a reading was taken, or the readings before it."""


@dataclass(frozen=True, slots=True)
class Situation:
    """Readings of one axle each and what an error may depend on; arrays of one shape (n,).

    Attributes:
        time_s: Time since the recording began, s.
        axle: Number of the axle, from 1.
        wheel_speed: Wheel speed, rad/s.
        wheel_accel: Acceleration of the wheel, rad/s².
        speed: Vehicle speed, m/s.
        effort: Effort of the axle, N.
        load: Wheelset load, N.
        vehicle: Configured vehicle; None where it is not known.
        travel: Direction of travel, 1 or −1.
        efforts: Efforts of all axles, N, shape (n, axles); None where they are not known.
        acceleration: Acceleration of the vehicle, m/s²; None where a law has to find it from the
            speeds.
        wheel_angle: Angle that the wheel has turned since the recording began, rad; None where it
            is not known.
        covariates: Values of other channels by name.
        series_s: Time in which lags run, s; None: the time itself.
        is_true: Whether the values are true ones, and no readings.

    """

    time_s: Array
    axle: Array
    wheel_speed: Array
    wheel_accel: Array
    speed: Array
    effort: Array
    load: Array
    vehicle: Locomotive | None = None
    travel: Array | float = 1.0
    efforts: Array | None = None
    acceleration: Array | None = None
    wheel_angle: Array | None = None
    covariates: Mapping[str, Array] = field(default_factory=dict)
    series_s: Array | None = None
    is_true: bool = False

    @property
    def lag_time_s(self) -> Array:
        """Time in which lags run, s; shape (n,)."""
        return self.time_s if self.series_s is None else self.series_s

    @property
    def total_effort(self) -> Array:
        """Effort of all axles together, N, shape (n,); NaN where it is not known."""
        total = np.zeros(len(self.axle))
        if self.efforts is None:
            return np.full(len(self.axle), np.nan)
        # Column by column: a sum of rows rounds by the layout.
        for column in range(self.efforts.shape[1]):
            total += self.efforts[:, column]
        return total

    def channel(self, name: str) -> Array:
        """Values of a covariate, shape (n,); NaN where it is not known."""
        known = self.covariates.get(name)
        return np.full(len(self.axle), np.nan) if known is None else known


class ReadingError(NamedTuple):
    """Error of readings: measured = true · (1 + relative) + absolute.

    Attributes:
        relative: Relative error, shape (n,) or one number.
        absolute: Absolute error in the reading's unit, shape (n,) or one number.
        relative_rate: Rate of change of the relative error, 1/s, where it changes so fast that
            differences of readings show it; shape (n,) or one number.

    """

    relative: Array | float = 0.0
    absolute: Array | float = 0.0
    relative_rate: Array | float = 0.0


class InstrumentLaw(Protocol):
    """Error of one kind of reading as a function of the situation; a frozen, comparable value."""

    @property
    def quantity(self) -> Quantity:
        """Kind of reading that is wrong."""

    @property
    def needs(self) -> frozenset[Need]:
        """What the situation must hold."""

    @property
    def covariates(self) -> tuple[str, ...]:
        """Names of the covariates that the situation must hold."""

    def error(self, situation: Situation, lags: "LagStates") -> ReadingError:
        """Error of the readings.

        Args:
            situation: Readings or true values; rows of one axle in the order of time.
            lags: Lagging states, carried from call to call; fresh for a whole drive.

        """


@dataclass(frozen=True, slots=True)
class LoadShift:
    """Loads that move under effort and are not read so: measured = true − size · transfer.

    Attributes:
        size: Share of the transfer by the geometry that the readings miss.
        traction: Height of the link that pulls the body, relative to that of the geometry.

    """

    size: float
    traction: float = 1.0
    quantity: Quantity = Quantity.LOAD
    needs: frozenset[Need] = frozenset({Need.EFFORTS})
    covariates: tuple[str, ...] = ()

    def error(self, situation: Situation, _lags: "LagStates") -> ReadingError:
        """Error of the readings."""
        if situation.vehicle is None or situation.efforts is None:
            return ReadingError(absolute=np.full(len(situation.axle), np.nan))
        shares = self.shares(situation.vehicle)
        axle_index = situation.axle.astype(np.int64) - 1
        moved = np.zeros(len(axle_index))
        for column in range(shares.shape[1]):
            moved += shares[axle_index, column] * situation.efforts[:, column]
        return ReadingError(absolute=-(moved * situation.travel))

    def shares(self, vehicle: Locomotive) -> Array:
        """Load that each axle gains for each axle's effort, 1, shape (axles, axles)."""
        return self.size * vehicle.transfer_shares(self.traction)


def total_error(
    laws: Iterable[InstrumentLaw], quantity: Quantity, situation: Situation, lags: "LagStates"
) -> ReadingError:
    """Error of one kind of reading by several laws: their gains multiply, and their zeros add up.

    No gain is below `LEAST_SENSOR_GAIN`, whatever a law says.
    """
    gain: Array | float = 1.0
    absolute: Array | float = 0.0
    rate: Array | float = 0.0
    for law in laws:
        if law.quantity is quantity:
            error = law.error(situation, lags)
            rate = rate * (1.0 + error.relative) + gain * error.relative_rate
            gain = gain * (1.0 + error.relative)
            absolute = absolute + error.absolute
    return ReadingError(np.maximum(gain, LEAST_SENSOR_GAIN) - 1.0, absolute, rate)


class TrueValues(NamedTuple):
    """True values of readings.

    Attributes:
        values: Situation with true values.
        force_gain: Factor by which the readings' force over load changes with a true adhesion,
            shape (n,) or one number.

    """

    values: Situation
    force_gain: Array | float = 1.0


def remove_errors(
    laws: tuple[InstrumentLaw, ...], readings: Situation, lags: "LagStates"
) -> TrueValues:
    """True values of readings; NaN where a law lacks something that it needs.

    Args:
        laws: Laws by which the readings are wrong.
        readings: Readings; rows of one axle in the order of time.
        lags: Lagging states, carried from call to call; fresh for a whole drive.

    """
    kinds = {law.quantity for law in laws}
    effort, load, speed = readings.effort, readings.load, readings.speed
    wheel_speed, wheel_accel = readings.wheel_speed, readings.wheel_accel
    gain: Array | float = 1.0
    if Quantity.EFFORT in kinds:
        error = total_error(laws, Quantity.EFFORT, readings, lags)
        effort = _corrected(effort, error)
        gain = 1.0 + error.relative
    if Quantity.LOAD in kinds:
        load = _corrected(load, total_error(laws, Quantity.LOAD, readings, lags))
        gain = gain * load / readings.load
    if Quantity.SPEED in kinds:
        speed = _corrected(speed, total_error(laws, Quantity.SPEED, readings, lags))
    if Quantity.WHEEL_SPEED in kinds:
        error = total_error(laws, Quantity.WHEEL_SPEED, readings, lags)
        wheel_speed = _corrected(wheel_speed, error)
        wheel_accel = np.asarray(
            (wheel_accel - wheel_speed * error.relative_rate) / (1.0 + error.relative)
        )
    true = replace(
        readings,
        effort=effort,
        load=load,
        speed=speed,
        wheel_speed=wheel_speed,
        wheel_accel=wheel_accel,
    )
    return TrueValues(true, gain)


def _corrected(measured: Array, error: ReadingError) -> Array:
    return np.asarray((measured - error.absolute) / (1.0 + error.relative))
